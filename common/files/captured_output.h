// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

namespace af {

/// What `write` writes to the open file descriptor it is given, kept in memory by way of a pipe:
/// for libraries and programs that can only write to a file and do not notice a full disk. They
/// must write from the beginning to the end, and can open the descriptor once more by the name
/// "/proc/self/fd/NUMBER". FileError, naming `what`, when the system gives no pipe.
std::string captured_output(const std::string& what, const std::function<void(int)>& write);

}  // namespace af
