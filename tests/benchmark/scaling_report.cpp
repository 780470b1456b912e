// SPDX-License-Identifier: Apache-2.0
// How af-precompute would scale on a cluster: the model of scaling_model.h, fed by a benchmark's
// measurements.
#include <iostream>

#include <CLI/CLI.hpp>

#include "benchmark/benchmark_case.h"
#include "benchmark/scaling_model.h"
#include "cli/app_main.h"
#include "files/csv_table.h"
#include "files/output_file.h"

namespace {

using namespace af;
using namespace af::benchmark;

constexpr int kMostRanks = 4096;
/// 128x128 x 1024x1024 rays, and 2 million training tiles, against the field measured.
constexpr double kLargeRays = 64.0;
constexpr double kMostTrainingTiles = 2e6;

struct ReportOptions {
  std::string benchmark;
  std::string table;
  double ct_megabytes = 0.0;
  ClusterAssumptions cluster;
};

double phase(const nlohmann::json& job, const char* name) {
  return job.at("seconds").value(name, 0.0);
}

/// Rank 0's time per unit: what handing out short items added to their own time.
double hand_out_seconds(const nlohmann::json& between_ranks) {
  const nlohmann::json& short_items = between_ranks.at("ranks-2").at("hand_out").at(1);
  return short_items.at("seconds_beyond_the_busiest_rank").get<double>() /
         short_items.at("items").get<double>();
}

JobCosts costs_of(const nlohmann::json& inputs, double ct_bytes) {
  const nlohmann::json& one = inputs.at("phase_seconds").at("ranks-1");
  const nlohmann::json& two = inputs.at("phase_seconds").at("ranks-2");
  JobCosts job;
  const auto costs = [&](auto&& split, const char* name) {
    return split(phase(one, name), phase(two, name));
  };
  double phases = 0.0;
  for (const auto& [name, seconds] : one.at("seconds").items()) phases += seconds.get<double>();
  job.start_seconds = one.at("wall_seconds").get<double>() - phases;
  job.read_seconds = phase(one, "read");
  job.resample = costs(PhaseCost::without_fixed_part, "resample");
  job.cast = costs(PhaseCost::without_fixed_part, "cast");
  job.train = costs(PhaseCost::from_one_and_two_ranks, "train");
  job.encode = costs(PhaseCost::without_fixed_part, "encode");
  job.write = costs(PhaseCost::from_one_and_two_ranks, "write");
  job.ct_bytes = ct_bytes;
  job.reduced_bytes = one.at("bytes_reduced_per_iteration").get<double>();
  job.training_iterations = one.at("training_iterations").get<int>();
  job.file_bytes = one.at("file_bytes").get<double>();
  job.hand_out_seconds = hand_out_seconds(inputs.at("between_ranks"));
  return job;
}

std::vector<ModelledRun> curve_of(const JobCosts& job, const ClusterAssumptions& cluster) {
  std::vector<ModelledRun> runs;
  for (int ranks = 1; ranks <= kMostRanks; ranks *= 2)
    runs.push_back(modelled_run(job, cluster, ranks));
  return runs;
}

void print_table(const std::string& title, const std::vector<ModelledRun>& runs) {
  std::cout << "\n"
            << title << "\n\n"
            << "| ranks | start, read, resample | cast | train | encode | write | total s | "
               "efficiency |\n|---|---|---|---|---|---|---|---|\n";
  std::cout.precision(3);
  for (const ModelledRun& run : runs)
    std::cout << "| " << run.ranks << " | " << run.start << " | " << run.cast << " | " << run.train
              << " | " << run.encode << " | " << run.write << " | " << run.total() << " | "
              << 100.0 * parallel_efficiency(runs.front(), run) << " % |\n";
}

void add_rows(const std::string& field, const std::vector<ModelledRun>& runs, CsvTable& table) {
  for (const ModelledRun& run : runs)
    table.add_row({field,
                   std::to_string(run.ranks),
                   number_text(run.start),
                   number_text(run.cast),
                   number_text(run.train),
                   number_text(run.encode),
                   number_text(run.write),
                   number_text(run.total())});
}

void run(const ReportOptions& options) {
  const nlohmann::json inputs = read_json(options.benchmark).at("model_inputs");
  const JobCosts job = costs_of(inputs, options.ct_megabytes * 1e6);
  const double tiles = inputs.at("phase_seconds").at("ranks-1").at("training_tiles").get<double>();
  const auto paper = curve_of(job, options.cluster);
  const auto large = curve_of(scaled(job, kLargeRays, kMostTrainingTiles / tiles), options.cluster);
  print_table("The field measured", paper);
  print_table("128x128 x 1024x1024 (64 times the rays)", large);
  CsvTable table({"field", "ranks", "start", "cast", "train", "encode", "write", "total"});
  add_rows("measured", paper, table);
  add_rows("large", large, table);
  write_text_file(options.table, table.to_text());
}

}  // namespace

int main(int argc, char** argv) {
  ReportOptions options;
  CLI::App app{"Models af-precompute on up to 4096 ranks from what a benchmark measured."};
  app.add_option(
         "--benchmark", options.benchmark, "benchmark.json with the sections efficiency and ranks")
      ->required();
  app.add_option("--table", options.table, "CSV of the curves, of which af-report draws a figure")
      ->required();
  app.add_option("--ct-mb", options.ct_megabytes, "Size of the CT, which every node receives, MB")
      ->required();
  app.add_option("--cores-per-node", options.cluster.cores_per_node, "Ranks that share one CT")
      ->capture_default_str();
  app.add_option(
         "--network-bytes-per-second", options.cluster.network_bytes_per_second, "Of one node")
      ->capture_default_str();
  app.add_option("--file-system-bytes-per-second",
                 options.cluster.file_system_bytes_per_second,
                 "Of all ranks together")
      ->capture_default_str();
  return cli::app_main(app, argc, argv, [&](const Communicator& world) {
    if (world.is_root()) run(options);
  });
}
