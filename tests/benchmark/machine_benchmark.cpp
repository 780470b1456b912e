// SPDX-License-Identifier: Apache-2.0
// The most that one core of this machine can do: reading from each level of the memory, and the
// arithmetic of the casters and of the codeword search. A profile compares phases with these
// bounds.
#include <CLI/CLI.hpp>

#include "base/vector_width.h"
#include "benchmark/alternating_rounds.h"
#include "benchmark/benchmark_case.h"
#include "benchmark/machine_kernel.h"
#include "cli/app_main.h"

namespace af::benchmark {

namespace {

struct MachineOptions {
  std::string output;
  bool is_quick = false;
};

/// Values that the compiler cannot know.
std::vector<std::int32_t> some_values(std::size_t count) {
  std::vector<std::int32_t> values(count);
  std::uint32_t state = 1;
  for (std::int32_t& value : values) {
    state = state * 1664525u + 1013904223u;
    value = static_cast<std::int32_t>(state >> 20u);
  }
  return values;
}

/// A contender that runs `loop` over the first `count` values. It keeps the results, so that the
/// compiler cannot drop the work.
Contender loop_contender(const std::string& name,
                         MachineLoop loop,
                         const std::vector<std::int32_t>& values,
                         std::size_t count,
                         std::size_t repetitions,
                         double work,
                         const std::string& unit) {
  return {name, work, unit, [loop, &values, count, repetitions] {
            volatile std::int32_t result = 0;
            return seconds_of([&] { result = loop(values.data(), count, repetitions); });
          }};
}

void run(const MachineOptions& options) {
  const std::size_t largest = std::size_t{options.is_quick ? 1u : 64u} << 20u;
  const std::vector<std::int32_t> values = some_values(largest);
  const auto read = select_kernel<MachineLoop>(
      kernels_128::read_all, kernels_256::read_all, kernels_512::read_all);
  std::vector<Contender> contenders;
  struct Level {
    const char* name;
    std::size_t values;
  };
  // 24 KiB, 512 KiB, 8 MiB and 256 MiB.
  for (const Level& level : {Level{"read, 24 KiB", 6u << 10u},
                             Level{"read, 512 KiB", 128u << 10u},
                             Level{"read, 8 MiB", 2u << 20u},
                             Level{"read, 256 MiB", 64u << 20u}}) {
    const std::size_t count = std::min(level.values, largest);
    const std::size_t repetitions = largest / count;
    contenders.push_back(loop_contender(level.name,
                                        read,
                                        values,
                                        count,
                                        repetitions,
                                        4.0 * static_cast<double>(count * repetitions),
                                        "bytes"));
  }
  constexpr std::size_t kSmall = 4096;
  const std::size_t repetitions = options.is_quick ? 10 : 5000;
  const auto steps = static_cast<double>(kSmall * repetitions);
  const double lanes_16_bit = static_cast<double>(static_cast<int>(active_vector_width())) / 16.0;
  const auto add_arithmetic =
      [&](const char* name, MachineLoop loop, double per_step, const char* unit) {
        contenders.push_back(
            loop_contender(name, loop, values, kSmall, repetitions, per_step * steps, unit));
      };
  add_arithmetic("multiply-add of 16-bit pairs",
                 select_kernel<MachineLoop>(kernels_128::multiply_add_pairs,
                                            kernels_256::multiply_add_pairs,
                                            kernels_512::multiply_add_pairs),
                 8.0 * lanes_16_bit,
                 "16-bit products");
  add_arithmetic("squared differences",
                 select_kernel<MachineLoop>(kernels_128::squared_differences,
                                            kernels_256::squared_differences,
                                            kernels_512::squared_differences),
                 8.0 * 16.0,
                 "differences");
  const auto gather = select_kernel<MachineLoop>(
      kernels_128::gather_all, kernels_256::gather_all, kernels_512::gather_all);
  const auto add_gather = [&](const char* name, std::size_t count, std::size_t times) {
    const double gathered = 16.0 * static_cast<double>(count * times);
    contenders.push_back(loop_contender(name, gather, values, count, times, gathered, "values"));
  };
  const std::size_t fewer = repetitions / 4;
  const std::size_t fewest = repetitions / 64;
  add_gather("gather, 32 KiB", 8192, fewer + 1);
  add_gather("gather, 512 KiB", std::size_t{128} << 10u, fewest + 1);
  write_section(options.output,
                "machine",
                {{"results", to_json(alternate(contenders, options.is_quick ? 1 : 5))}});
}

}  // namespace

}  // namespace af::benchmark

// Outside app_main only the declaration of options can throw, and that would be a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::benchmark::MachineOptions options;
  CLI::App app{"What one core of this machine can do at most."};
  app.add_option("-o,--output", options.output, "The section's JSON file")->required();
  app.add_flag("--quick", options.is_quick, "Small amounts of work: shows that it works");
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator&) { af::benchmark::run(options); });
}
