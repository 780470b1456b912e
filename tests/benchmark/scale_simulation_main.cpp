// SPDX-License-Identifier: Apache-2.0
// How af-evaluate registration would scale: simulates the work queue on up to 10 000 ranks, with
// the costs of messages and rows on this machine.
#include <array>
#include <cmath>
#include <iomanip>
#include <iostream>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "benchmark/benchmark_case.h"
#include "benchmark/queue_costs.h"
#include "cli/app_main.h"
#include "files/csv_table.h"

namespace {

using namespace af;
using namespace af::benchmark;

struct ScaleOptions {
  std::int64_t items = 10'000'000;
  std::vector<int> ranks = {16, 256, 1024, 4096, 10000};
  std::vector<std::string> registrations;
  int repetitions = 20000;
  double host_log_sigma = 0.1;
  QueueCosts costs;
  double request_microseconds = 0.0;
  double receive_microseconds = 0.0;
};

/// Medians and spreads of studies of clean and hard X-rays on one core.
std::vector<ItemTimes> known_times() {
  return {{"fast, 1.6 ms", 1.6e-3, 0.4},
          {"robust on clean X-rays, 3 ms", 3e-3, 0.2},
          {"robust on hard ones, 15 ms", 15e-3, 0.2},
          {"paper, 50 ms", 50e-3, 0.3}};
}

/// Median and spread of the field registrations in "NAME=registrations.csv".
ItemTimes times_of(const std::string& named_file) {
  const std::size_t equals = named_file.find('=');
  if (equals == std::string::npos) throw UsageError("--registrations wants NAME=FILE");
  const CsvTable table = CsvTable::read(named_file.substr(equals + 1));
  std::vector<double> logs;
  for (std::size_t row = 0; row < table.row_count(); ++row)
    if (table.text(row, "renderer") == "field")
      logs.push_back(std::log(std::max(1e-6, table.number(row, "seconds"))));
  if (logs.empty()) throw InputError(named_file + ": has no registration by fields");
  double mean = 0.0;
  double square = 0.0;
  for (const double value : logs) mean += value / static_cast<double>(logs.size());
  for (const double value : logs)
    square += (value - mean) * (value - mean) / static_cast<double>(logs.size());
  return {named_file.substr(0, equals), std::exp(mean), std::sqrt(square)};
}

void print_costs(const QueueCosts& costs) {
  std::cout << "Rank 0: " << 1e6 * costs.request_seconds << " us per request, "
            << 1e6 * costs.receive_seconds
            << " us per row received; a rank: " << 1e6 * costs.write_seconds
            << " us per row written by itself.\nA row: " << costs.row_bytes << " bytes sent, "
            << costs.kept_row_bytes << " bytes kept. Assumed: " << 1e6 * costs.latency_seconds
            << " us per message.\n";
}

void print_table(const ItemTimes& times,
                 const ScaleOptions& options,
                 const SimulatedQueue& policy) {
  std::cout
      << "\n| ranks | ideal s | s | efficiency | rank 0 busy | lost at the end | longest wait ms "
         "| MB through rank 0 | MB waiting | MB kept |\n"
         "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n";
  for (const int ranks : options.ranks) {
    SimulatedQueue queue = policy;
    queue.ranks = ranks;
    queue.items = options.items;
    const SimulatedRun run = simulated_run(queue, times, options.costs);
    std::cout << "| " << ranks << " | " << run.seconds * run.efficiency << " | " << run.seconds
              << " | " << 100.0 * run.efficiency << " % | " << 100.0 * run.manager_busy << " % | "
              << 100.0 * run.lost_at_end << " % | " << 1e3 * run.longest_wait_seconds << " | "
              << run.manager_bytes / 1e6 << " | " << run.waiting_bytes / 1e6 << " | "
              << run.kept_bytes / 1e6 << " |\n"
              << std::flush;
  }
}

void simulate(const ScaleOptions& options) {
  struct Policy {
    const char* name;
    SimulatedQueue queue;
  };
  constexpr std::int64_t kMostCollected = 64;
  std::array<Policy, 2> policies = {Policy{"rows to the rank's own shard, as it is", {}},
                                    Policy{"rows to rank 0, blocks of at most 64", {}}};
  policies[1].queue.rows = RowsGo::ToRankZero;
  policies[1].queue.most_per_block = kMostCollected;
  std::vector<ItemTimes> all_times;
  for (const std::string& named_file : options.registrations)
    all_times.push_back(times_of(named_file));
  if (all_times.empty()) all_times = known_times();
  print_costs(options.costs);
  for (ItemTimes& times : all_times) {
    times.host_log_sigma = options.host_log_sigma;
    for (const Policy& policy : policies) {
      std::cout << "\n### " << times.name << " (median " << 1e3 * times.median_seconds
                << " ms, log-sigma " << times.log_sigma << "); " << policy.name << "\n";
      print_table(times, options, policy.queue);
    }
  }
}

void run(ScaleOptions options, const Communicator& world) {
  if (world.is_root()) measure_rows(options.repetitions, options.costs);
  world.barrier();
  if (world.size() > 1) measure_messages(world, options.repetitions, options.costs);
  if (options.request_microseconds > 0.0)
    options.costs.request_seconds = 1e-6 * options.request_microseconds;
  if (options.receive_microseconds > 0.0)
    options.costs.receive_seconds = 1e-6 * options.receive_microseconds;
  std::cout << std::setprecision(3);
  if (world.is_root()) simulate(options);
}

}  // namespace

int main(int argc, char** argv) {
  ScaleOptions options;
  CLI::App app{
      "Simulates the work queue of af-evaluate registration on many ranks. Under mpirun -n 2 the "
      "cost "
      "of messages is measured, too."};
  app.add_option("--items", options.items, "Registrations")->capture_default_str();
  app.add_option("--ranks", options.ranks, "Numbers of ranks")->capture_default_str();
  app.add_option(
      "--registrations",
      options.registrations,
      "NAME=registrations.csv: durations as in these studies (default: four known ones)");
  app.add_option("--host-log-sigma", options.host_log_sigma, "Spread of the hosts' speed")
      ->capture_default_str();
  app.add_option("--latency-s", options.costs.latency_seconds, "Of a message, one way, s")
      ->capture_default_str();
  app.add_option("--request-us", options.request_microseconds, "Instead of measuring, us");
  app.add_option("--receive-us", options.receive_microseconds, "Instead of measuring, us");
  app.add_option("--repetitions", options.repetitions, "Of what is measured")
      ->capture_default_str();
  return cli::app_main(app, argc, argv, [&](const Communicator& world) { run(options, world); });
}
