// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/measure_population.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/sample_summary.h"
#include "cli/bind_options.h"
#include "evaluate/registration/population_statistics.h"
#include "evaluate/report/evaluation_run.h"
#include "figures/gnuplot_figure.h"
#include "files/output_file.h"
#include "text/csv_table.h"

namespace af::evaluation {

namespace {

/// The patients of one condition (clean or stressed, views, preset) by one renderer.
struct PopulationCondition {
  std::string name;
  std::vector<PatientOutcomes> patients;
};

/// Some of a condition's patients, by both errors.
struct PopulationGroup {
  std::string condition;
  std::string group;
  PopulationSuccess by_tre;
  PopulationSuccess by_mrpd;
  double median_tre_mm = kNan;  ///< of successes
  double median_seconds = kNan;
};

using PatientsByRenderer = std::map<std::string, std::map<std::string, PatientOutcomes>>;

void add_population_rows(const CsvTable& table, PatientsByRenderer& found) {
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    const std::string patient = patient_of_case(table.text(row, "case"));
    PatientOutcomes& outcomes = found[table.text(row, "renderer")][patient];
    outcomes.patient = patient;
    const double initial_mm = table.number(row, "initial_tre_mm");
    outcomes.by_tre.push_back({initial_mm, table.number_or_nan(row, "tre_mm")});
    outcomes.by_mrpd.push_back({initial_mm, table.number_or_nan(row, "mrpd_mm")});
    outcomes.seconds.push_back(table.number_or_nan(row, "seconds"));
  }
}

/// Intervals and threshold, which all runs must share.
PopulationCounting counting_of(const EvaluationRun& run, std::uint64_t seed) {
  try {
    const nlohmann::json& intervals = run.summary.at("renderers").at(0).at("intervals");
    return {static_cast<int>(intervals.size()),
            intervals.at(0).at("high_mm").get<double>(),
            run.summary.at("success_tre_mm").get<double>(),
            seed};
  } catch (const nlohmann::json::exception&) {
    throw FileError((run.folder / "summary.json").string(),
                    "renderers",
                    "intervals of initial TRE, and success_tre_mm",
                    "something else");
  }
}

class PopulationReader {
 public:
  explicit PopulationReader(std::uint64_t seed) : seed_(seed) {}

  /// The conditions of NAME=FOLDER, one per renderer.
  void read(const std::string& condition) {
    const std::size_t equals = condition.find('=');
    if (equals == 0 || equals == std::string::npos)
      throw InputError("--condition", condition, "must be NAME=FOLDER");
    PatientsByRenderer found;
    for (const EvaluationRun& run : find_runs({condition.substr(equals + 1)})) {
      if (run.kind != "registration") continue;
      check_counting(run);
      run.read_in_parts("registrations.csv",
                        [&](const CsvTable& part) { add_population_rows(part, found); });
    }
    if (found.empty())
      throw InputError("--condition", condition, "holds no finished registration run");
    for (auto& [renderer, patients] : found) {
      PopulationCondition one{condition.substr(0, equals), {}};
      if (found.size() > 1) one.name += ", " + renderer;
      for (auto& [name, outcomes] : patients) one.patients.push_back(std::move(outcomes));
      conditions_.push_back(std::move(one));
    }
  }
  [[nodiscard]] const std::vector<PopulationCondition>& conditions() const { return conditions_; }
  [[nodiscard]] const PopulationCounting& counting() const { return *counting_; }

 private:
  void check_counting(const EvaluationRun& run) {
    const PopulationCounting counting = counting_of(run, seed_);
    if (!counting_) counting_ = counting;
    if (counting.intervals != counting_->intervals ||
        counting.interval_width_mm != counting_->interval_width_mm ||
        counting.success_mm != counting_->success_mm)
      throw InputError("--condition",
                       run.folder.string(),
                       "must have the intervals and the success threshold of the other runs");
  }

  std::uint64_t seed_;
  std::optional<PopulationCounting> counting_;
  std::vector<PopulationCondition> conditions_;
};

PopulationGroup group_of(const PopulationCondition& condition,
                         const std::string& name,
                         const std::vector<const PatientOutcomes*>& patients,
                         const PopulationCounting& counting) {
  PopulationGroup group{condition.name,
                        name,
                        population_success(patients, CountedEnd::Tre, counting),
                        population_success(patients, CountedEnd::Mrpd, counting)};
  std::vector<double> tre_mm;
  std::vector<double> seconds;
  for (const PatientOutcomes* patient : patients) {
    for (const TreOutcome& outcome : patient->by_tre)
      if (outcome.tre_mm < counting.success_mm) tre_mm.push_back(outcome.tre_mm);
    for (const double value : patient->seconds)
      if (std::isfinite(value)) seconds.push_back(value);
  }
  group.median_tre_mm = summarize(tre_mm).median;
  group.median_seconds = summarize(seconds).median;
  return group;
}

/// All patients, the two halves, and the kinds.
std::vector<PopulationGroup> groups_of(const PopulationCondition& condition,
                                       const PopulationCounting& counting) {
  std::vector<std::string> names{"all"};
  std::map<std::string, std::vector<const PatientOutcomes*>> members;
  const auto add = [&](const std::string& name, const PatientOutcomes& patient) {
    std::vector<const PatientOutcomes*>& list = members[name];
    if (list.empty() && name != "all") names.push_back(name);
    list.push_back(&patient);
  };
  for (const PatientOutcomes& patient : condition.patients) add("all", patient);
  for (const PatientOutcomes& patient : condition.patients) add(half_of(patient), patient);
  for (const PatientOutcomes& patient : condition.patients)
    if (patient.number() > 0) add(patient.kind(), patient);
  std::vector<PopulationGroup> groups;
  for (const std::string& name : names)
    groups.push_back(group_of(condition, name, members[name], counting));
  return groups;
}

std::vector<std::string> success_columns(const std::string& error) {
  std::vector<std::string> names;
  for (const char* const what : {"_successes",
                                 "_rate",
                                 "_student_low",
                                 "_student_high",
                                 "_bootstrap_low",
                                 "_bootstrap_high",
                                 "_worst_patient_rate",
                                 "_capture_mm",
                                 "_capture_bootstrap_low_mm",
                                 "_capture_bootstrap_high_mm",
                                 "_patients_capture_mean_mm",
                                 "_patients_capture_student_low_mm",
                                 "_patients_capture_student_high_mm",
                                 "_patients_capture_bootstrap_low_mm",
                                 "_patients_capture_bootstrap_high_mm",
                                 "_patients_capture_smallest_mm"})
    names.push_back(error + what);
  return names;
}

void add_success_fields(const PopulationSuccess& success, std::vector<std::string>& fields) {
  double worst = 1.0;
  double smallest_mm = std::numeric_limits<double>::infinity();
  for (const PatientSuccess& patient : success.patients) {
    worst = std::min(worst,
                     static_cast<double>(patient.successes) / static_cast<double>(patient.starts));
    smallest_mm = std::min(smallest_mm, patient.capture.initial_tre_mm);
  }
  fields.push_back(std::to_string(success.successes));
  for (const double value : {success.rate.value,
                             success.rate.student.low,
                             success.rate.student.high,
                             success.rate.bootstrap.low,
                             success.rate.bootstrap.high,
                             worst,
                             success.pooled.initial_tre_mm,
                             success.pooled_interval_mm.low,
                             success.pooled_interval_mm.high,
                             success.capture_mm.value,
                             success.capture_mm.student.low,
                             success.capture_mm.student.high,
                             success.capture_mm.bootstrap.low,
                             success.capture_mm.bootstrap.high,
                             smallest_mm})
    fields.push_back(number_text(value));
}

CsvTable population_table(const std::vector<PopulationGroup>& groups) {
  std::vector<std::string> columns{
      "condition", "group", "patients", "starts", "median_tre_mm", "median_seconds"};
  for (const char* const error : {"tre", "mrpd"})
    for (const std::string& name : success_columns(error)) columns.push_back(name);
  CsvTable table(columns);
  for (const PopulationGroup& group : groups) {
    std::vector<std::string> fields{group.condition,
                                    group.group,
                                    std::to_string(group.by_tre.patients.size()),
                                    std::to_string(group.by_tre.starts),
                                    number_text(group.median_tre_mm),
                                    number_text(group.median_seconds)};
    add_success_fields(group.by_tre, fields);
    add_success_fields(group.by_mrpd, fields);
    table.add_row(std::move(fields));
  }
  return table;
}

CsvTable patients_table(const std::vector<PopulationGroup>& groups) {
  CsvTable table({"condition",
                  "patient",
                  "starts",
                  "tre_successes",
                  "wilson_low",
                  "wilson_high",
                  "capture_mm",
                  "capture_low_mm",
                  "capture_high_mm",
                  "mrpd_successes",
                  "mrpd_capture_mm"});
  for (const PopulationGroup& group : groups) {
    if (group.group != "all") continue;
    for (std::size_t i = 0; i < group.by_tre.patients.size(); ++i) {
      const PatientSuccess& tre = group.by_tre.patients[i];
      const PatientSuccess& mrpd = group.by_mrpd.patients[i];
      table.add_row({group.condition,
                     tre.patient,
                     std::to_string(tre.starts),
                     std::to_string(tre.successes),
                     number_text(tre.wilson.low),
                     number_text(tre.wilson.high),
                     number_text(tre.capture.initial_tre_mm),
                     number_text(tre.capture_interval_mm.low),
                     number_text(tre.capture_interval_mm.high),
                     std::to_string(mrpd.successes),
                     number_text(mrpd.capture.initial_tre_mm)});
    }
  }
  return table;
}

CsvTable intervals_table(const std::vector<PopulationGroup>& groups) {
  CsvTable table({"condition",
                  "error",
                  "low_mm",
                  "high_mm",
                  "starts",
                  "successes",
                  "bootstrap_low",
                  "bootstrap_high"});
  for (const PopulationGroup& group : groups) {
    if (group.group != "all") continue;
    for (const bool is_tre : {true, false}) {
      const PopulationSuccess& success = is_tre ? group.by_tre : group.by_mrpd;
      for (std::size_t k = 0; k < success.intervals.size(); ++k)
        table.add_row({group.condition,
                       is_tre ? "tre" : "mrpd",
                       number_text(success.intervals[k].low_mm),
                       number_text(success.intervals[k].high_mm),
                       std::to_string(success.intervals[k].trials),
                       std::to_string(success.intervals[k].successes),
                       number_text(success.interval_bootstraps[k].low),
                       number_text(success.interval_bootstraps[k].high)});
    }
  }
  return table;
}

std::string percent(double share) {
  return std::isfinite(share) ? fixed_text(100.0 * share, 1) : "-";
}

std::string millimetre_text(double value) {
  return std::isfinite(value) ? fixed_text(value, 1) : "-";
}

std::string success_cells(const PopulationSuccess& success) {
  return percent(success.rate.value) + " | " + percent(success.rate.bootstrap.low) + " to " +
         percent(success.rate.bootstrap.high) + " | " + percent(success.rate.student.low) + " to " +
         percent(success.rate.student.high) + " | " +
         millimetre_text(success.pooled.initial_tre_mm) + " | " +
         millimetre_text(success.capture_mm.value) + " (" +
         millimetre_text(success.capture_mm.bootstrap.low) + " to " +
         millimetre_text(success.capture_mm.bootstrap.high) + ")";
}

bool is_kind(const PopulationGroup& group) {
  return group.group != "all" && group.group != "odd" && group.group != "even" &&
         group.group != "real";
}

/// All patients, and the halves.
std::string population_markdown(const std::vector<PopulationGroup>& groups, bool by_mrpd) {
  std::string text =
      "| Condition | Group | Patients | Starts | Success, % | Bootstrap | Student's | "
      "Capture range of all, mm | Patients' own, mean, mm | Median TRE, mm | Seconds |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const PopulationGroup& group : groups)
    if (!is_kind(group))
      text += "| " + group.condition + " | " + group.group + " | " +
              std::to_string(group.by_tre.patients.size()) + " | " +
              std::to_string(group.by_tre.starts) + " | " +
              success_cells(by_mrpd ? group.by_mrpd : group.by_tre) + " | " +
              (std::isfinite(group.median_tre_mm) ? fixed_text(group.median_tre_mm, 2) : "-") +
              " | " + fixed_text(group.median_seconds, 3) + " |\n";
  return text;
}

/// A column per kind of patient: success and capture range of all its starts, by TRE and by mRPD.
std::string kinds_markdown(const std::vector<PopulationGroup>& groups) {
  std::vector<std::string> kinds;
  std::vector<std::string> conditions;
  std::map<std::pair<std::string, std::string>, std::string> cells;
  const auto add_new = [](std::vector<std::string>& names, const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (const PopulationGroup& group : groups) {
    add_new(conditions, group.condition);
    if (!is_kind(group) && group.group != "real") continue;
    add_new(kinds, group.group);
    cells[{group.condition, group.group}] =
        percent(group.by_tre.rate.value) + " / " + percent(group.by_mrpd.rate.value) + ", " +
        millimetre_text(group.by_tre.pooled.initial_tre_mm) + " / " +
        millimetre_text(group.by_mrpd.pooled.initial_tre_mm);
  }
  std::string text = "| Condition |";
  std::string line = "|---|";
  for (const std::string& kind : kinds) {
    text += " " + kind + " |";
    line += "---|";
  }
  text += "\n" + line + "\n";
  for (const std::string& condition : conditions) {
    text += "| " + condition + " |";
    for (const std::string& kind : kinds) {
      const auto cell = cells.find({condition, kind});
      text += " " + (cell == cells.end() ? std::string("-") : cell->second) + " |";
    }
    text += "\n";
  }
  return text;
}

constexpr std::array kPopulationColors{palette::kBlue,
                                       palette::kVermilion,
                                       palette::kGreen,
                                       palette::kPurple,
                                       palette::kOrange,
                                       palette::kSkyBlue};

/// "clean-2-robust": what all but the last word say.
std::string panel_of(const std::string& condition) {
  return condition.substr(0, condition.rfind('-'));
}

/// Success against the initial error: a panel per variant and views, a line per preset.
void draw_population_success(const std::vector<PopulationGroup>& groups,
                             const PopulationCounting& counting,
                             const std::filesystem::path& path) {
  std::vector<std::string> panels;
  std::map<std::string, std::vector<const PopulationGroup*>> members;
  for (const PopulationGroup& group : groups) {
    if (group.group != "all" || group.condition.find(", ") != std::string::npos) continue;
    std::vector<const PopulationGroup*>& list = members[panel_of(group.condition)];
    if (list.empty()) panels.push_back(panel_of(group.condition));
    list.push_back(&group);
  }
  if (panels.empty()) return;
  constexpr int kColumns = 2;
  const int rows = (static_cast<int>(panels.size()) + kColumns - 1) / kColumns;
  GnuplotFigure figure("", 900, 300 * rows);
  std::string script =
      "set multiplot layout " + std::to_string(rows) + "," + std::to_string(kColumns) +
      "\nset xlabel 'initial TRE (mm)'\nset ylabel 'success (%)'\nset yrange [0:102]\n"
      "set xrange [0:" +
      number_text(counting.intervals * counting.interval_width_mm) + "]\nset key bottom left\n";
  int block = 0;
  for (const std::string& panel : panels) {
    const bool is_one_view = panel.size() > 2 && panel.compare(panel.size() - 2, 2, "-1") == 0;
    script +=
        "set title " + gnuplot_quoted(panel + (is_one_view ? " view, by mRPD" : " views")) + "\n";
    std::string plot;
    std::size_t color = 0;
    for (const PopulationGroup* group : members[panel]) {
      const PopulationSuccess& success = is_one_view ? group->by_mrpd : group->by_tre;
      std::vector<std::vector<double>> data;
      const double shift_mm = 0.25 * (static_cast<double>(color) - 1.0);
      for (std::size_t k = 0; k < success.intervals.size(); ++k)
        if (success.intervals[k].trials > 0)
          data.push_back(
              {0.5 * (success.intervals[k].low_mm + success.intervals[k].high_mm) + shift_mm,
               100.0 * success.intervals[k].rate(),
               100.0 * success.interval_bootstraps[k].low,
               100.0 * success.interval_bootstraps[k].high});
      const std::string name = "data" + std::to_string(block++);
      figure.add_data(name, data);
      const std::string style =
          " lc rgb '" + std::string(kPopulationColors[color++ % kPopulationColors.size()]) + "'";
      plot += (plot.empty() ? "plot $" : ", $") + name + " using 1:2 with lines lw 1.5" + style +
              " notitle, $" + name + " using 1:2:3:4 with yerrorbars lw 1.5 pt 7 ps 0.6" + style +
              " title " + gnuplot_quoted(group->condition.substr(panel.size() + 1));
    }
    script += plot + "\n";
  }
  figure.add(script + "unset multiplot\n");
  figure.draw(path);
}

/// Every patient's own capture range: a row per condition, a mark per patient.
void draw_capture_ranges(const std::vector<PopulationGroup>& groups,
                         const PopulationCounting& counting,
                         const std::filesystem::path& path) {
  std::vector<std::vector<double>> odd;
  std::vector<std::vector<double>> even;
  std::vector<std::vector<double>> means;
  std::string tics;
  double place = 0.0;
  for (const PopulationGroup& group : groups) {
    if (group.group != "all" || group.condition.find(", ") != std::string::npos) continue;
    place += 1.0;
    tics +=
        (tics.empty() ? "" : ", ") + gnuplot_quoted(group.condition) + " -" + number_text(place);
    const bool is_one_view = panel_of(group.condition).find("-1") != std::string::npos;
    const PopulationSuccess& success = is_one_view ? group.by_mrpd : group.by_tre;
    std::map<double, int> stacked;
    for (const PatientSuccess& patient : success.patients) {
      const double range_mm = patient.capture.initial_tre_mm;
      PatientOutcomes named;
      named.patient = patient.patient;
      (half_of(named) == "odd" ? odd : even)
          .push_back({range_mm + 0.3 * stacked[range_mm], -place + 0.12 * (stacked[range_mm] % 3)});
      ++stacked[range_mm];
    }
    means.push_back({success.capture_mm.value,
                     -place - 0.2,
                     success.capture_mm.bootstrap.low,
                     success.capture_mm.bootstrap.high});
  }
  if (means.empty()) return;
  GnuplotFigure figure("Capture range of every patient (van de Kraats)",
                       900,
                       120 + 38 * static_cast<int>(means.size()));
  const auto points = [](const std::string& name, std::string_view color, const char* title) {
    return "$" + name + " using 1:2 with points pt 7 ps 0.7 lc rgb '" + std::string(color) +
           "' title '" + title + "'";
  };
  std::string plot;
  if (!odd.empty()) {
    figure.add_data("odd", odd);
    plot += points("odd", palette::kSkyBlue, "odd patients") + ", ";
  }
  if (!even.empty()) {
    figure.add_data("even", even);
    plot += points("even", palette::kBlue, "even and real patients") + ", ";
  }
  figure.add_data("means", means);
  plot += "$means using 1:2:3:4 with xerrorbars lw 1.5 pt 5 ps 0.7 lc rgb '" +
          std::string(palette::kVermilion) + "' title 'mean, 95 % over patients'";
  figure.add("set xlabel 'capture range (mm of initial TRE)'\nset ytics (" + tics +
             ")\nset yrange [" + number_text(-place - 0.6) + ":-0.4]\nset xrange [-1:" +
             number_text(counting.intervals * counting.interval_width_mm + 5.0) +
             "]\nset key outside bottom center horizontal\nplot " + plot + "\n");
  figure.draw(path);
}

void write_population(const PopulationOptions& options, const PopulationReader& reader) {
  std::vector<PopulationGroup> groups;
  for (const PopulationCondition& condition : reader.conditions())
    for (PopulationGroup& group : groups_of(condition, reader.counting()))
      groups.push_back(std::move(group));
  const std::string text = "By TRE below " + number_text(reader.counting().success_mm) +
                           " mm:\n\n" + population_markdown(groups, false) +
                           "\nBy mRPD below the same, which is the one to read with one view:\n\n" +
                           population_markdown(groups, true) +
                           "\nKinds of patients: success, % (TRE / mRPD), capture range of all "
                           "starts, mm (TRE / mRPD):\n\n" +
                           kinds_markdown(groups);
  std::filesystem::create_directories(options.output);
  write_text_file(options.output / "population.csv", population_table(groups).to_text());
  write_text_file(options.output / "patients.csv", patients_table(groups).to_text());
  write_text_file(options.output / "intervals.csv", intervals_table(groups).to_text());
  draw_population_success(groups, reader.counting(), options.output / "success");
  draw_capture_ranges(groups, reader.counting(), options.output / "capture-range");
  write_text_file(options.output / "population.md", text);
  std::cout << text << "results: " << options.output.string() << '\n';
}

}  // namespace

void PopulationOptions::describe(Fields& field) {
  field("condition",
        conditions,
        "NAME=FOLDER: finished registration runs of one condition, of any number of patients, "
        "searched with all below the folder. NAME is VARIANT-VIEWS-PRESET for the figures. May be "
        "repeated")
      .required()
      .one_at_a_time();
  field("seed", seed, "Seed of the bootstrap");
  field("output", output, "Folder for tables and figures").as("-o,--output");
}

CLI::App* bind_population(CLI::App& app, PopulationOptions& options) {
  CLI::App* command = app.add_subcommand(
      "population",
      "Success and capture range of many patients, with intervals over patients (bootstrap and "
      "Student's), for all, for those of odd and of even numbers, and for every kind. A case "
      "named PATIENT-pN is a true pose of that patient");
  cli::bind_options(*command, options);
  return command;
}

void run_population(const PopulationOptions& options, const Communicator& world) {
  all_or_none(world, [&] {
    if (!world.is_root()) return;
    require_gnuplot();
    PopulationReader reader(options.seed);
    for (const std::string& condition : options.conditions) reader.read(condition);
    write_population(options, reader);
  });
}

}  // namespace af::evaluation
