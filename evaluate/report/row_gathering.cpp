// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/row_gathering.h"

#include <chrono>
#include <exception>

#include "ranks/progress_printer.h"
#include "ranks/terminal.h"

namespace af::evaluation {

void announce_time(const Communicator& world,
                   const std::string& what,
                   std::int64_t count,
                   const std::function<double()>& sample) {
  if (!world.is_root() || count < 2) return;
  const auto start = std::chrono::steady_clock::now();
  double samples = 0.0;
  try {
    samples = sample();
  } catch (const std::exception&) {
    return;
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  inform(world, expected_time_text(what, count, samples * seconds.count(), world.size()));
}

}  // namespace af::evaluation
