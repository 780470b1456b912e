// SPDX-License-Identifier: Apache-2.0
#include "run/terminal.h"

#include <iostream>

namespace af {

void inform(const Communicator& communicator, const std::string& message) {
  if (communicator.is_root()) std::cerr << message << '\n';
}

void warn(const Communicator& communicator, const std::string& message) {
  if (communicator.is_root()) std::cerr << "warning: " << message << '\n';
}

}  // namespace af
