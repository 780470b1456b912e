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
  static std::set<std::string> known;
  const std::scoped_lock lock(mutex);
  if (known.insert(message).second) inform(communicator, "warning: " + message);
}

}  // namespace af
