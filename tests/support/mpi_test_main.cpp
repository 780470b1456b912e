// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdint>
#include <iostream>

#include <gtest/gtest.h>

#include "parallel/communicator.h"
#include "parallel/mpi_environment.h"

/// Runs all tests on every rank; rank 0 prints. The program fails when any rank failed.
int main(int argc, char** argv) {
  const af::MpiEnvironment environment(argc, argv);
  testing::InitGoogleTest(&argc, argv);
  const af::Communicator world = af::Communicator::world();
  if (!world.is_root()) {
    auto& listeners = testing::UnitTest::GetInstance()->listeners();
    delete listeners.Release(listeners.default_result_printer());
  }
  std::array<std::uint64_t, 1> failed{RUN_ALL_TESTS() == 0 ? std::uint64_t{0} : std::uint64_t{1}};
  world.sum(failed);
  if (world.is_root() && failed[0] > 0)
    std::cout << failed[0] << " of " << world.size() << " ranks failed\n";
  return failed[0] == 0 ? 0 : 1;
}
