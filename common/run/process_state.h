// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace af {

/// Whose process numbers this process sees: the boot of its kernel and its namespaces of process
/// numbers and time. Two containers of one host differ, and so do two hosts of one name. Empty
/// where /proc does not say.
std::string process_space();

/// When a process began, in ticks since the boot of its host; 0 when /proc does not say.
std::uint64_t process_start(int process);

enum class ProcessState { Runs, HasEnded, NotTold };

/// The state of the process of this number that began at `start`: numbers are used again. A zombie,
/// which nobody has waited for, has ended; a process whose first thread ended before the others has
/// not. NotTold: there is a process of this number, and /proc hides it from this user.
ProcessState process_state(int process, std::uint64_t start);

}  // namespace af
