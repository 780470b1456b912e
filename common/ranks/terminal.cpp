// SPDX-License-Identifier: Apache-2.0
#include "ranks/terminal.h"

#include <iostream>
#include <mutex>
#include <set>

namespace af {

void inform(const Communicator& communicator, const std::string& message) {
  // Written in one piece, because mpirun forwards pieces as they come, with those of other ranks
  // between.
  if (communicator.is_root()) std::cerr << message + "\n";
}

void warn(const Communicator& communicator, const std::string& message) {
  // Every case, renderer or camera that reads a file finds the same oddities in it.
  static std::mutex mutex;
  // Never destroyed: threads of a host program may still load cases while the process ends.
  static auto& known = *new std::set<std::string>;
  const std::scoped_lock lock(mutex);
  if (known.insert(message).second) inform(communicator, "warning: " + message);
}

}  // namespace af
