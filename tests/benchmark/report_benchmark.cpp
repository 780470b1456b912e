// SPDX-License-Identifier: Apache-2.0
// Joins the sections' JSON files into one, with what a model of scaling needs, and writes the
// tables and the list of their numbers.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "benchmark/benchmark_case.h"
#include "cli/app_main.h"

namespace af::benchmark {

namespace {
using nlohmann::json;
namespace fs = std::filesystem;

struct ReportOptions {
  std::string folder;
  std::string commit = "unknown";
  std::string command;
};

std::string number(double value, const char* format = "%.3g") {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

const json* section(const json& sections, const std::string& name) {
  const auto found = sections.find(name);
  return found == sections.end() ? nullptr : &*found;
}

std::string row(const std::vector<std::string>& cells) {
  std::string text = "|";
  for (const std::string& cell : cells) text += " " + cell + " |";
  return text + "\n";
}

std::string header(const std::vector<std::string>& cells) {
  std::string rule = "|";
  for (std::size_t i = 0; i < cells.size(); ++i) rule += i == 0 ? "---|" : "---:|";
  return row(cells) + rule + "\n";
}

std::string ratio_lines(const json& ratios) {
  std::string text;
  for (const json& ratio : ratios)
    text += row(
        {ratio.at("faster").get<std::string>() + " against " + ratio.at("than").get<std::string>(),
         number(ratio.at("by_median")),
         number(ratio.at("by_minimum"))});
  return text;
}

std::string ratio_table(const json& ratios) {
  return "\n" + header({"times as fast per unit of work", "medians", "minima"}) +
         ratio_lines(ratios);
}

std::string machine_table(const json& machine) {
  std::string text = "## Machine, one core\n\n" + header({"", "10^9 per second"});
  for (const auto& [name, result] : machine.at("results").items())
    text += row({name + " (" + result.at("unit").get<std::string>() + ")",
                 number(result.at("per_second").get<double>() / 1e9)});
  return text;
}

std::string casting_table(const json& casting) {
  std::string text = "## Casting, one core\n\n" +
                     header({"caster", "million rays/s", "ms per 65536 rays", "least ms"});
  for (const auto& [name, result] : casting.at("results").items()) {
    const double work = result.at("work");
    text += row({name,
                 number(result.at("per_second").get<double>() / 1e6),
                 number(result.at("seconds").at("median").get<double>() * 65536e3 / work),
                 number(result.at("seconds").at("min").get<double>() * 65536e3 / work)});
  }
  text += ratio_table(casting.at("ratios")) + "\n" +
          header({"same image as the reference caster", "factor", "PSNR dB"});
  for (const auto& [name, agreement] : casting.at("agreement_with_reference").items())
    text += row({name, number(agreement.at("factor")), number(agreement.at("psnr_db"), "%.1f")});
  return text;
}

std::string encoding_table(const json& encoding) {
  std::string text = "## Encoding, one core\n\n" +
                     header({"search", "codewords", "thousand tiles/s", "us per tile"});
  json ratios = json::array();
  for (const json& codebook : encoding.at("codebooks")) {
    const std::string size = std::to_string(codebook.at("codewords").get<int>());
    for (const auto& [name, result] : codebook.at("results").items()) {
      const double rate = result.at("per_second");
      text += row({name, size, number(rate / 1e3), number(1e6 / rate)});
    }
    for (json ratio : codebook.at("ratios")) {
      ratio["than"] = ratio.at("than").get<std::string>() + ", " + size + " codewords";
      ratios.push_back(ratio);
    }
  }
  text += ratio_table(ratios);
  for (const json& codebook : encoding.at("codebooks"))
    text +=
        "\n" + std::to_string(codebook.at("answers_other_than_brute_force").get<int>()) + " of " +
        std::to_string(codebook.at("answers_compared").get<int>()) +
        " answers differ from brute force with " +
        std::to_string(codebook.at("codewords").get<int>()) + " codewords" +
        (codebook.contains("faiss_answers_other_than_brute_force")
             ? " (Faiss: " +
                   std::to_string(codebook.at("faiss_answers_other_than_brute_force").get<int>()) +
                   ")"
             : "") +
        ".\n";
  const std::string blas = encoding.at("blas");
  return text +
         (blas.empty() ? "" : "\nBLAS under Faiss: " + fs::path(blas).filename().string() + "\n");
}

std::string drr_table(const std::string& heading, const json& look_up) {
  std::string text = "## " + heading + "\n\n" + header({"renderer", "ms", "least ms"});
  for (const auto& [name, result] : look_up.at("results").items()) {
    const double work = result.at("work");
    text += row({name,
                 number(result.at("seconds").at("median").get<double>() * 1e3 / work),
                 number(result.at("seconds").at("min").get<double>() * 1e3 / work)});
  }
  return text + ratio_table(look_up.at("ratios"));
}

/// The entry of a section's "jobs" of that name; nullptr when there is none.
const json* job_named(const json* of_section, const std::string& name) {
  if (of_section == nullptr) return nullptr;
  for (const json& job : of_section->at("jobs"))
    if (job.at("name") == name) return &job;
  return nullptr;
}

std::string fields_table(const json& sections) {
  const json* memory = section(sections, "memory");
  const json* quality = section(sections, "quality");
  std::string text =
      "## Whole fields, 2 ranks\n\n" +
      header({"field", "s", "peak MB", "file MB", "payload MB", "median dB", "5 % dB", "least dB"});
  for (const json& job : section(sections, "fields")->at("jobs")) {
    const std::string name = job.at("name");
    std::vector<std::string> cells{name,
                                   number(job.at("seconds").at("median")),
                                   "",
                                   number(job.at("file_mb")),
                                   number(job.at("payload_mb")),
                                   "",
                                   "",
                                   ""};
    if (const json* peak = job_named(memory, name))
      cells[2] = number(peak->at("peak_node_mb"), "%.0f");
    if (const json* good = job_named(quality, name)) {
      const json& psnr = good->at("psnr_db");
      cells[5] = number(psnr.at("median"), "%.1f");
      cells[6] = number(psnr.at("p5"), "%.1f");
      cells[7] = number(psnr.at("min"), "%.1f");
    }
    text += row(cells);
  }
  return text;
}

std::string phases_table(const json& jobs, const std::string& title) {
  const std::vector<std::string> phases{
      "read", "resample", "cast", "train", "fit filter", "encode", "write"};
  std::vector<std::string> titles{"field", "ranks", "total", "start and end"};
  titles.insert(titles.end(), phases.begin(), phases.end());
  std::string text = "## " + title + "\n\n" + header(titles);
  for (const json& job : jobs) {
    const json& seconds = job.at("phase_seconds");
    const double total = job.at("seconds").at("median");
    double known = 0.0;
    std::vector<std::string> cells;
    for (const std::string& phase : phases) {
      const double of_phase = seconds.value(phase, 0.0);
      known += of_phase;
      cells.push_back(number(of_phase));
    }
    cells.insert(cells.begin(),
                 {job.at("name").get<std::string>(),
                  std::to_string(job.at("ranks").get<int>()),
                  number(total),
                  number(total - known)});
    text += row(cells);
  }
  return text;
}

std::string efficiency_table(const json& efficiency) {
  std::string text =
      phases_table(efficiency.at("jobs"), "The same field on 1, 2 and 4 ranks, seconds");
  const json& alone = efficiency.at("jobs").at(0);
  const double cores = efficiency.at("machine").at("cores");
  text +=
      "\n" +
      header(
          {"ranks", "cores", "efficiency of the job", "of casting", "of training", "of encoding"});
  for (const json& job : efficiency.at("jobs")) {
    const double ranks = job.at("ranks");
    const double used = std::min(ranks, cores);
    const auto of_phase = [&](const char* phase) {
      return number(alone.at("phase_seconds").at(phase).get<double>() /
                        (used * job.at("phase_seconds").at(phase).get<double>()),
                    "%.2f");
    };
    text += row({std::to_string(job.at("ranks").get<int>()) +
                     (ranks > cores ? " (more ranks than cores)" : ""),
                 number(used),
                 number(alone.at("seconds").at("median").get<double>() /
                            (used * job.at("seconds").at("median").get<double>()),
                        "%.2f"),
                 of_phase("cast"),
                 of_phase("train"),
                 of_phase("encode")});
  }
  return text;
}

/// What a model of larger machines needs, from the sections that were run.
json model_inputs(const json& sections) {
  json inputs = json::object();
  if (const json* casting = section(sections, "casting")) {
    inputs["units_of_one_rank"] = casting->at("units");
    inputs["resample_seconds_one_core"] = casting->at("resample_seconds");
  }
  for (const char* name : {"fields", "efficiency"})
    if (const json* jobs = section(sections, name))
      for (const json& job : jobs->at("jobs"))
        inputs["phase_seconds"][job.at("name").get<std::string>()] = {
            {"ranks", job.at("ranks")},
            {"seconds", job.at("phase_seconds")},
            {"wall_seconds", job.at("seconds").at("median")},
            {"training_iterations", job.at("training_iterations")},
            {"training_tiles", job.at("training_tiles")},
            {"tiles_not_empty", job.at("tiles_not_empty")},
            {"rays_cast", job.at("rays_cast")},
            // element sums and counts of every codeword, and two errors
            {"bytes_reduced_per_iteration", (job.at("codewords").get<double>() * 17 + 2) * 8},
            {"payload_bytes", job.at("payload_mb").get<double>() * 1e6},
            {"file_bytes", job.at("file_mb").get<double>() * 1e6}};
  for (const auto& [name, of_section] : sections.items())
    if (name.starts_with("ranks-")) inputs["between_ranks"][name] = of_section;
  return inputs;
}

/// One measured number per line, for docs/data.
class NumberList {
 public:
  /// Numbers that follow are of this section.
  void begin(const std::string& name, const json& of_section) {
    section_ = name;
    const json of_case = of_section.value("case", json::object());
    origin_ = of_case.value("ct_content_sha256", std::string()).substr(0, 16) + "," +
              of_section.value("commit", std::string("unknown"));
  }
  void add(const std::string& name, const std::string& quantity, double value) {
    text_ += section_ + ",\"" + name + "\"," + quantity + "," + number(value, "%.4g") + "," +
             origin_ + "\n";
  }
  /// Medians and minima of what alternated.
  void add_timings(const json& results, const std::string& suffix = {}) {
    for (const auto& [name, result] : results.items()) {
      std::string unit = result.at("unit");
      if (unit.ends_with('s')) unit.pop_back();
      for (const char* which : {"median", "min"})
        add(name + suffix,
            std::string(which) + " us per " + unit,
            result.at("seconds").at(which).get<double>() * 1e6 / result.at("work").get<double>());
    }
  }
  /// What jobs report: seconds, sizes, decibels.
  void add_jobs(const json& jobs) {
    for (const json& job : jobs) {
      const std::string name = job.at("name");
      if (job.contains("seconds"))
        add(name, "median s", job.at("seconds").at("median").get<double>());
      for (const char* size : {"file_mb", "payload_mb", "peak_node_mb"})
        if (job.contains(size)) add(name, size, job.at(size).get<double>());
      if (job.contains("phase_seconds"))
        for (const auto& [phase, seconds] : job.at("phase_seconds").items())
          add(name, "median s of " + phase, seconds.get<double>());
      if (job.contains("psnr_db"))
        for (const char* which : {"median", "p5", "min"})
          add(name, std::string(which) + " PSNR dB", job.at("psnr_db").at(which).get<double>());
    }
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string section_;
  std::string origin_;  ///< hash of the CT and commit
  std::string text_ = "section,name,quantity,value,ct_content_sha256,commit\n";
};

std::string numbers(const json& sections) {
  NumberList list;
  for (const auto& [name, of_section] : sections.items()) {
    list.begin(name, of_section);
    if (of_section.contains("jobs")) list.add_jobs(of_section.at("jobs"));
    if (of_section.contains("results")) list.add_timings(of_section.at("results"));
    if (of_section.contains("agreement_with_reference"))
      for (const auto& [caster, agreement] : of_section.at("agreement_with_reference").items())
        list.add(caster, "PSNR dB against RayCaster", agreement.at("psnr_db").get<double>());
    if (of_section.contains("codebooks"))
      for (const json& codebook : of_section.at("codebooks"))
        list.add_timings(codebook.at("results"),
                         ", " + std::to_string(codebook.at("codewords").get<int>()) + " codewords");
  }
  return list.text();
}

std::string tables(const json& result) {
  const json& sections = result.at("sections");
  std::string text;
  const auto add = [&](const char* name, auto&& table) {
    if (const json* found = section(sections, name)) text += table(*found) + "\n";
  };
  add("casting", casting_table);
  add("encoding", encoding_table);
  add("drr-look-up",
      [](const json& drrs) { return drr_table("One DRR of the paper's field, one core", drrs); });
  add("drr-standard",
      [](const json& drrs) { return drr_table("One DRR of the default field, one core", drrs); });
  add("python", [](const json& drrs) { return drr_table("One DRR from Python, one core", drrs); });
  add("fields", [&](const json& fields) {
    return fields_table(sections) + "\n" +
           phases_table(fields.at("jobs"), "Seconds per phase, 2 ranks");
  });
  add("efficiency", efficiency_table);
  add("machine", machine_table);
  return text;
}

void run(const ReportOptions& options) {
  json result{{"format", "attenuation-fields benchmark"},
              {"format_version", 1},
              {"commit", options.commit},
              {"command", options.command},
              {"machine", machine_description()},
              {"sections", json::object()}};
  for (const auto& entry : fs::directory_iterator(fs::path(options.folder) / "sections"))
    if (entry.path().extension() == ".json") {
      const json of_section = read_json(entry.path());
      result["sections"][of_section.at("section").get<std::string>()] = of_section;
    }
  result["model_inputs"] = model_inputs(result.at("sections"));
  const std::string text = tables(result);
  const fs::path json_path = fs::path(options.folder) / "benchmark.json";
  const fs::path table_path = fs::path(options.folder) / "benchmark.md";
  std::ofstream(json_path) << result.dump(2) << '\n';
  const fs::path number_path = fs::path(options.folder) / "benchmark.csv";
  std::ofstream(table_path) << text;
  std::ofstream(number_path) << numbers(result.at("sections"));
  std::cout << text << "Wrote " << json_path.string() << ", " << table_path.string() << " and "
            << number_path.string() << '\n';
}

}  // namespace

}  // namespace af::benchmark

// Only what CLI11 throws while the options are bound: a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::benchmark::ReportOptions options;
  CLI::App app{"Joins the sections of a benchmark into one JSON file and one page of tables."};
  app.add_option(
         "--folder", options.folder, "Holds sections/*.json; receives benchmark.json, .md and .csv")
      ->required();
  app.add_option("--commit", options.commit, "What was measured")->capture_default_str();
  app.add_option("--command", options.command, "How it was measured");
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator&) { af::benchmark::run(options); });
}
