// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "ranks/communicator.h"
#include "ranks/mpi_environment.h"
#include "ranks/process_group.h"

namespace {

/// Prints the failures of a rank other than 0.
class FailurePrinter : public testing::EmptyTestEventListener {
 public:
  explicit FailurePrinter(int rank) : rank_(rank) {}

 private:
  void OnTestStart(const testing::TestInfo& test) override {
    test_ = std::string(test.test_suite_name()) + "." + test.name();
  }
  // GoogleTest holds its lock here; asking it for the current test would wait for ever.
  void OnTestPartResult(const testing::TestPartResult& result) override {
    if (!result.failed()) return;
    std::cout << "rank " << rank_ << ": " << test_ << ": "
              << (result.file_name() == nullptr ? "" : result.file_name()) << ':'
              << result.line_number() << ": " << result.message() << std::endl;
  }
  std::string test_;
  int rank_;
};

}  // namespace

/// Runs all tests on every rank: of mpirun, or with the words "--processes N" of as many processes.
/// Rank 0 prints all results, the others print their failures. The program fails when any rank
/// failed.
int main(int argc, char** argv) {
  const bool has_processes = argc > 2 && std::string(argv[1]) == "--processes";
  std::optional<af::MpiEnvironment> environment;
  if (!has_processes) environment.emplace(argc, argv);
  const af::ProcessGroup processes(has_processes ? std::stoi(argv[2]) : 1,
                                   [](const std::string& loss) {
                                     std::cout << loss << std::endl;
                                     std::_Exit(1);
                                   });
  testing::InitGoogleTest(&argc, argv);
  const af::Communicator world = af::Communicator::world();
  if (!world.is_root()) {
    auto& listeners = testing::UnitTest::GetInstance()->listeners();
    delete listeners.Release(listeners.default_result_printer());
    listeners.Append(new FailurePrinter(world.rank()));  // the list owns and deletes it
  }
  std::array<std::uint64_t, 1> failed{RUN_ALL_TESTS() == 0 ? std::uint64_t{0} : std::uint64_t{1}};
  world.sum(failed);
  if (world.is_root() && failed[0] > 0)
    std::cout << failed[0] << " of " << world.size() << " ranks failed\n";
  return failed[0] == 0 ? 0 : 1;
}
