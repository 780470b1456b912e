// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

namespace af {

/// Keeps in memory, by way of a pipe, what `write` writes to the open file descriptor it is given.
/// This is for libraries and programs that can only write to a file and do not notice a full disk.
/// They must write from beginning to end, and can reopen the descriptor as "/proc/self/fd/NUMBER".
/// Throws FileError, naming `what`, when the system gives no pipe.
std::string captured_output(const std::string& what, const std::function<void(int)>& write);

}  // namespace af
