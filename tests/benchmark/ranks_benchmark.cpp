// SPDX-License-Identifier: Apache-2.0
// What ranks cost each other: sums over all ranks, hand-out of work, writing to disk. Run it under
// mpirun.
#include <chrono>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "benchmark/alternating_rounds.h"
#include "benchmark/benchmark_case.h"
#include "cli/app_main.h"
#include "ranks/work_queue.h"

namespace af::benchmark {

namespace {

struct RankOptions {
  std::string output;
  std::string work;
  bool is_quick = false;
};

/// Median seconds of one sum of `count` integers over all ranks.
double sum_seconds(const Communicator& world, std::size_t count, int repetitions) {
  std::vector<std::uint64_t> values(count, 1);
  std::vector<double> seconds;
  for (int i = 0; i < repetitions; ++i) {
    world.barrier();
    seconds.push_back(seconds_of([&] { world.sum(values); }));
    values.assign(count, 1);
  }
  return median_of(seconds);
}

nlohmann::json measure_sums(const Communicator& world, bool is_quick) {
  nlohmann::json measured = nlohmann::json::array();
  // One integer; 64 KiB; the centroid sums of one training iteration for three codebook sizes.
  for (const std::size_t count : {std::size_t{1},
                                  std::size_t{8192},
                                  std::size_t{4096 * 17 + 2},
                                  std::size_t{16384 * 17 + 2},
                                  std::size_t{65536 * 17 + 2}})
    measured.push_back({{"bytes", count * sizeof(std::uint64_t)},
                        {"median_seconds", sum_seconds(world, count, is_quick ? 3 : 40)}});
  return measured;
}

void spin(double seconds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < end) {
  }
}

/// Items of equal length: what the hand-out adds to the time of the work itself.
nlohmann::json measure_hand_out(const Communicator& world, double item_seconds, int items) {
  std::uint64_t mine = 0;
  world.barrier();
  const double seconds = seconds_of([&] {
    for_each_item(world, items, [&](std::int64_t) {
      spin(item_seconds);
      ++mine;
    });
  });
  std::vector<std::uint64_t> most{mine};
  world.maximum(most);
  return {
      {"item_seconds", item_seconds},
      {"items", items},
      {"seconds", seconds},
      {"most_items_of_a_rank", most[0]},
      {"seconds_beyond_the_busiest_rank", seconds - item_seconds * static_cast<double>(most[0])}};
}

/// Sequential write and sync of one file by rank 0, bytes per second.
double disk_bytes_per_second(const std::filesystem::path& folder, std::size_t bytes) {
  const std::filesystem::path path = folder / "disk-speed.tmp";
  const std::vector<char> data(bytes, 'x');
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0) throw FileError(path.string(), "cannot be written");
  std::size_t written = 0;
  const double seconds = seconds_of([&] {
    while (written < bytes) {
      const ssize_t count = write(file, data.data() + written, bytes - written);
      if (count <= 0) break;
      written += static_cast<std::size_t>(count);
    }
    fsync(file);
  });
  close(file);
  std::filesystem::remove(path);
  if (written < bytes) throw FileError(path.string(), "cannot be written");
  return static_cast<double>(bytes) / seconds;
}

void run(const RankOptions& options, const Communicator& world) {
  nlohmann::json body{{"ranks", world.size()}};
  body["sums"] = measure_sums(world, options.is_quick);
  body["hand_out"] = nlohmann::json::array();
  for (const double item_seconds : {0.0, 1e-4, 1e-2})
    body["hand_out"].push_back(
        measure_hand_out(world, item_seconds, (options.is_quick ? 8 : 100) * world.size()));
  const double disk = all_or_none(world, [&] {
    const std::size_t bytes = std::size_t{options.is_quick ? 1u : 256u} << 20u;
    return world.is_root() ? disk_bytes_per_second(options.work, bytes) : 0.0;
  });
  body["disk_write_bytes_per_second"] = disk;
  all_or_none(world, [&] {
    if (world.is_root())
      write_section(options.output, "ranks-" + std::to_string(world.size()), body);
  });
}

}  // namespace

}  // namespace af::benchmark

// Outside app_main only the declaration of options can throw, and that would be a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::benchmark::RankOptions options;
  CLI::App app{"What ranks cost each other: sums, hand-out of work, writing. For mpirun."};
  app.add_flag("--quick", options.is_quick, "Small amounts of work: shows that it works");
  app.add_option("-o,--output", options.output, "The section's JSON file")->required();
  app.add_option("--work", options.work, "Folder on the disk to write to")->required();
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator& world) { af::benchmark::run(options, world); });
}
