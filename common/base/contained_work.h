// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace af {

/// What became of contained_work().
struct ContainedWork {
  bool is_done = false;     ///< the work returned true, and `bytes` are what it made
  std::vector<char> bytes;  ///< as many as were asked for, where it is done
  std::string trouble;      ///< why not, in words: "refused it", "ended by signal 6 (Aborted)"
};

/// Runs work that other people's code may end by a signal, such as a failed assertion in a decoder:
/// in a copy of this process, which has memory of its own but for the bytes that it makes. The copy
/// has one thread, says nothing on the terminal, leaves no core, and is ended when it asks for far
/// more memory or time than the bytes are worth. `work` must neither talk to other processes nor
/// wait for other threads; what it throws counts as false. \test ContainedWork.*
ContainedWork contained_work(std::size_t bytes, const std::function<bool(std::span<char>)>& work);

}  // namespace af
