// SPDX-License-Identifier: Apache-2.0
#include "ranks/terminal.h"

#include <iostream>

namespace af {

void inform(const Communicator& communicator, const std::string& message) {
  // Written in one piece, because mpirun forwards pieces as they come, with those of other ranks
  // between.
  if (communicator.is_root()) std::cerr << message + "\n";
}

void warn(const Communicator& communicator, const std::string& message) {
  inform(communicator, "warning: " + message);
}

}  // namespace af
