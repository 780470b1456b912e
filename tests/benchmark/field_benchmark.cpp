// SPDX-License-Identifier: Apache-2.0
// Whole fields by af-precompute under mpirun: seconds from start to the complete verified file, the
// program's own seconds per phase, peak memory, file size; and how good the DRRs of some of them
// are.
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "benchmark/alternating_rounds.h"
#include "benchmark/benchmark_case.h"
#include "benchmark/watched_program.h"
#include "cli/app_main.h"
#include "support/run_program.h"

namespace af::benchmark {

namespace {
namespace fs = std::filesystem;

struct FieldOptions {
  CaseOptions of_case;
  std::string programs;  ///< folder of af-precompute, af-evaluate, af-inspect
  std::string work;
  std::string part = "fields";
  std::string mpirun = "mpirun";
};

/// One af-precompute command.
struct Job {
  std::string name;
  int ranks = 2;
  std::vector<std::string> arguments;  ///< besides those of the case
};

Job design(const std::string& name,
           const std::string& preset,
           const std::vector<std::string>& options = {}) {
  Job job{name, 2, {"--preset", preset}};
  job.arguments.insert(job.arguments.end(), options.begin(), options.end());
  return job;
}

const std::vector<std::string> kLittleTraining{"--codewords", "64", "--training-fraction", "0.5"};

Job paper_job(bool is_quick) {
  return design("paper", "paper", is_quick ? kLittleTraining : std::vector<std::string>{});
}

/// The default design, the paper's, and the paper's with single choices changed.
std::vector<Job> field_jobs(bool is_quick) {
  if (is_quick) return {design("standard", "standard", kLittleTraining), paper_job(true)};
  return {design("standard", "standard"),
          paper_job(false),
          design("st-512", "paper", {"--st-nodes", "512"}),
          design("codewords-65536", "paper", {"--codewords", "65536"}),
          design("slabs-8",
                 "paper",
                 {"--slabs", "8", "--uv-nodes", "8", "--st-nodes", "512", "--codewords", "65536"})};
}

std::vector<Job> rank_jobs(bool is_quick) {
  std::vector<Job> jobs;
  for (const int ranks : {1, 2, 4}) {
    Job job = paper_job(is_quick);
    job.name = "ranks-" + std::to_string(ranks);
    job.ranks = ranks;
    jobs.push_back(job);
  }
  return jobs;
}

std::vector<std::string> under_mpirun(const FieldOptions& options, int ranks) {
  return {options.mpirun, "-n", std::to_string(ranks), "--oversubscribe", "--bind-to", "none"};
}

fs::path field_path(const FieldOptions& options, const Job& job) {
  return fs::path(options.work) / (job.name + ".af.h5");
}

fs::path log_path(const FieldOptions& options, const Job& job) {
  return fs::path(options.work) / (job.name + ".log");
}

std::vector<std::string> precompute_command(const FieldOptions& options, const Job& job) {
  std::vector<std::string> command = under_mpirun(options, job.ranks);
  command.insert(command.end(),
                 {(fs::path(options.programs) / "af-precompute").string(),
                  "--ct",
                  options.of_case.ct,
                  "--rig",
                  options.of_case.rig,
                  "--camera",
                  options.of_case.camera});
  command.insert(command.end(), job.arguments.begin(), job.arguments.end());
  if (options.of_case.is_quick)
    command.insert(command.end(), {"--uv-nodes", "8", "--st-nodes", "64"});
  command.insert(command.end(), {"-o", field_path(options, job).string()});
  return command;
}

std::string one_line(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words)
    line += (line.empty() ? "" : " ") +
            (word.find('/') == 0 ? fs::path(word).filename().string() : word);
  return line;
}

WatchedRun run_or_throw(const std::vector<std::string>& command,
                        const fs::path& log,
                        WatchMemory watch_memory) {
  WatchedRun run = run_watched(command, log, "af-precompute", watch_memory);
  if (run.exit_code != 0)
    throw FileError(log.string(),
                    "'" + one_line(command) + "' ended with " + std::to_string(run.exit_code));
  return run;
}

/// A cold start: there is no earlier result, and the CT is not in the page cache. The program and
/// its libraries are.
WatchedRun build_field(const FieldOptions& options, const Job& job, WatchMemory watch_memory) {
  const fs::path field = field_path(options, job);
  fs::remove(field);
  forget_cached_pages(options.of_case.ct);
  return run_or_throw(precompute_command(options, job), log_path(options, job), watch_memory);
}

nlohmann::json inspected(const FieldOptions& options, const Job& job) {
  const test::ProgramRun run =
      test::run_command("'" + (fs::path(options.programs) / "af-inspect").string() + "' --json '" +
                        field_path(options, job).string() + "'");
  if (run.exit_code != 0) throw FileError(field_path(options, job).string(), run.output);
  return nlohmann::json::parse(run.output).at(0).at("facts");
}

/// What the tables say of the file, and the seconds per phase that the program wrote into it.
nlohmann::json facts_of(const nlohmann::json& inspection) {
  const nlohmann::json& details = inspection.at("provenance").at("details");
  return {{"file_mb", inspection.at("sizes").at("file_mb")},
          {"payload_mb", inspection.at("sizes").at("payload_mb")},
          {"uncompressed_mb", inspection.at("sizes").at("uncompressed_mb")},
          {"payload_sha256", inspection.at("payload_sha256")},
          {"codewords", inspection.at("codewords")},
          {"training_iterations", details.at("training").at("iterations")},
          {"training_tiles", details.at("training").at("training_tiles")},
          {"tiles_not_empty", details.at("occupied_tiles")},
          {"rays_cast", details.at("rays_cast")}};
}

/// Seconds per phase, from the file. Those of writing come from the log, because the file cannot
/// hold them.
nlohmann::json phases_of(const nlohmann::json& inspection, const fs::path& log) {
  nlohmann::json phases = inspection.at("provenance").at("details").at("seconds");
  std::ifstream file(log);
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const std::string key = " write ";
  const std::size_t at = text.find(key, text.find("seconds:"));
  if (at == std::string::npos) throw FileError(log.string(), "does not say the seconds of writing");
  phases["write"] = std::strtod(text.c_str() + at + key.size(), nullptr);
  return phases;
}

/// Every phase's median over the rounds.
nlohmann::json median_phases(const std::vector<nlohmann::json>& phases) {
  nlohmann::json medians = nlohmann::json::object();
  for (const auto& [phase, ignored] : phases.front().items()) {
    std::vector<double> seconds;
    seconds.reserve(phases.size());
    for (const nlohmann::json& of_round : phases)
      seconds.push_back(of_round.at(phase).get<double>());
    medians[phase] = median_of(seconds);
  }
  return medians;
}

nlohmann::json measure_jobs(const FieldOptions& options, const std::vector<Job>& jobs) {
  const int rounds = options.of_case.is_quick ? 1 : options.of_case.rounds;
  std::vector<std::vector<double>> seconds(jobs.size());
  std::vector<std::vector<nlohmann::json>> phases(jobs.size());
  std::vector<nlohmann::json> facts(jobs.size());
  for (int round = 0; round < rounds; ++round)
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      seconds[i].push_back(build_field(options, jobs[i], WatchMemory::No).seconds);
      const nlohmann::json inspection = inspected(options, jobs[i]);
      phases[i].push_back(phases_of(inspection, log_path(options, jobs[i])));
      facts[i] = facts_of(inspection);
    }
  nlohmann::json measured = nlohmann::json::array();
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    nlohmann::json json = facts[i];
    json["name"] = jobs[i].name;
    json["ranks"] = jobs[i].ranks;
    json["command"] = one_line(precompute_command(options, jobs[i]));
    json["seconds"] = {{"median", median_of(seconds[i])}, {"all", seconds[i]}};
    json["phase_seconds"] = median_phases(phases[i]);
    measured.push_back(json);
  }
  return measured;
}

nlohmann::json measure_memory(const FieldOptions& options) {
  nlohmann::json measured = nlohmann::json::array();
  for (const Job& job : field_jobs(options.of_case.is_quick)) {
    const WatchedRun run = build_field(options, job, WatchMemory::Yes);
    measured.push_back({{"name", job.name},
                        {"ranks", job.ranks},
                        {"peak_node_mb", static_cast<double>(run.peak_bytes) / 1e6}});
  }
  return measured;
}

/// DRRs of the fields that the other parts left, against ray casting.
nlohmann::json measure_quality(const FieldOptions& options) {
  nlohmann::json measured = nlohmann::json::array();
  for (const Job& job : field_jobs(options.of_case.is_quick)) {
    if (!fs::exists(field_path(options, job))) build_field(options, job, WatchMemory::No);
    const fs::path folder = fs::path(options.work) / ("quality-" + job.name);
    fs::remove_all(folder);
    std::vector<std::string> command = under_mpirun(options, 2);
    command.insert(command.end(),
                   {(fs::path(options.programs) / "af-evaluate").string(),
                    "image-quality",
                    "--field",
                    field_path(options, job).string(),
                    "--ct",
                    options.of_case.ct,
                    "--pose-count",
                    options.of_case.is_quick ? "4" : "100",
                    "-o",
                    folder.string()});
    run_or_throw(
        command, fs::path(options.work) / ("quality-" + job.name + ".log"), WatchMemory::No);
    const nlohmann::json summary = read_json(folder / "summary.json");
    measured.push_back({{"name", job.name},
                        {"command", one_line(command)},
                        {"poses", summary.at("poses")},
                        {"psnr_db", summary.at("psnr_db")}});
  }
  return measured;
}

void run(const FieldOptions& options) {
  fs::create_directories(options.work);
  const bool is_quick = options.of_case.is_quick;
  nlohmann::json body{{"case", BenchmarkCase(options.of_case).description()}};
  if (options.part == "fields")
    body["jobs"] = measure_jobs(options, field_jobs(is_quick));
  else if (options.part == "efficiency")
    body["jobs"] = measure_jobs(options, rank_jobs(is_quick));
  else if (options.part == "memory")
    body["jobs"] = measure_memory(options);
  else if (options.part == "quality")
    body["jobs"] = measure_quality(options);
  else
    throw UsageError("--part: fields, efficiency, memory or quality");
  write_section(options.of_case.output, options.part, body);
}

}  // namespace

}  // namespace af::benchmark

// Outside app_main only the declaration of options can throw, and that would be a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::benchmark::FieldOptions options;
  options.of_case.rounds = 3;
  CLI::App app{"Whole fields by af-precompute: seconds, memory, size, image quality."};
  af::benchmark::bind_case(app, options.of_case);
  app.add_option("--programs", options.programs, "Folder of the programs")->required();
  app.add_option("--work", options.work, "Folder for fields and logs")->required();
  app.add_option("--part", options.part, "fields, efficiency, memory or quality")
      ->capture_default_str();
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator&) { af::benchmark::run(options); });
}
