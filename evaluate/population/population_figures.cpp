// SPDX-License-Identifier: Apache-2.0
#include "evaluate/population/population_figures.h"

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <utility>

#include "base/number_text.h"
#include "figures/gnuplot_figure.h"

namespace af::evaluation {

namespace {

using Points = std::vector<std::vector<double>>;

/// Clear of the x label.
constexpr const char* kLegendBelow = "set key outside bottom center horizontal height 1\n";

constexpr std::array kPresetColors{palette::kBlue,
                                   palette::kVermilion,
                                   palette::kGreen,
                                   palette::kPurple,
                                   palette::kOrange,
                                   palette::kSkyBlue};

/// A condition of all patients, by the first renderer.
bool is_drawn(const PopulationGroup& group) {
  return group.group == "all" && group.condition.find(", ") == std::string::npos;
}

/// VARIANT-VIEWS of VARIANT-VIEWS-PRESET; a name of one word has a panel of its own.
std::string panel_of(const std::string& condition) {
  return condition.substr(0, condition.rfind('-'));
}

/// PRESET, or the one word.
std::string preset_of(const std::string& condition) {
  return condition.substr(condition.rfind('-') + 1);
}

bool has_one_view(const std::string& panel) {
  return panel.size() > 2 && panel.ends_with("-1");
}

/// With one view depth is free, so that only mRPD says something.
const PopulationSuccess& drawn_success(const PopulationGroup& group) {
  return has_one_view(panel_of(group.condition)) ? group.by_mrpd : group.by_tre;
}

/// Rows of initial error, success (%), and its interval; shifted, so that lines' bars stand side by
/// side.
Points interval_points(const PopulationSuccess& success, double shift_mm) {
  Points points;
  for (std::size_t k = 0; k < success.intervals.size(); ++k) {
    const IntervalSuccess& interval = success.intervals[k];
    if (interval.trials == 0) continue;
    points.push_back({0.5 * (interval.low_mm + interval.high_mm) + shift_mm,
                      100.0 * interval.rate(),
                      100.0 * success.interval_bootstraps[k].low,
                      100.0 * success.interval_bootstraps[k].high});
  }
  return points;
}

/// Adds the data of one panel; returns its gnuplot commands. `block` counts the data of the figure.
std::string panel_script(const std::string& panel,
                         const std::vector<const PopulationGroup*>& members,
                         GnuplotFigure& figure,
                         int& block) {
  std::string plot;
  for (std::size_t k = 0; k < members.size(); ++k) {
    const std::string name = "data" + std::to_string(block++);
    figure.add_data(
        name, interval_points(drawn_success(*members[k]), 0.25 * (static_cast<double>(k) - 1.0)));
    const std::string style =
        " lc rgb '" + std::string(kPresetColors[k % kPresetColors.size()]) + "'";
    plot.append(plot.empty() ? "plot $" : ", $")
        .append(name)
        .append(" using 1:2 with lines lw 1.5")
        .append(style)
        .append(" notitle, $")
        .append(name)
        .append(" using 1:2:3:4 with yerrorbars lw 1.5 pt 7 ps 0.6")
        .append(style)
        .append(" title ")
        .append(gnuplot_quoted(preset_of(members[k]->condition)));
  }
  const std::string title = panel + (has_one_view(panel)     ? " view, by mRPD"
                                     : panel.ends_with("-2") ? " views"
                                                             : "");
  return "set title " + gnuplot_quoted(title) + "\n" + plot + "\n";
}

/// The marks of one condition: patients of equal range in columns of three about it, which stay
/// within the interval that ended the range, however many there are.
void add_patient_marks(const PopulationSuccess& success,
                       double place,
                       std::map<std::string, Points>& marks) {
  constexpr int kRows = 3;
  constexpr double kWidestMm = 1.6;
  constexpr double kColumnMm = 0.3;
  std::map<double, int> equals;
  for (const PatientSuccess& patient : success.patients) ++equals[patient.capture.initial_tre_mm];
  std::map<double, int> drawn;
  for (const PatientSuccess& patient : success.patients) {
    const double range_mm = patient.capture.initial_tre_mm;
    const int last_column = (equals[range_mm] - 1) / kRows;
    const double column_mm = std::min(kColumnMm, kWidestMm / std::max(1, last_column));
    const int before = drawn[range_mm]++;
    const int column = before / kRows;
    PatientOutcomes named;
    named.patient = patient.patient;
    marks[half_of(named) == "odd" ? "odd" : "even"].push_back(
        {range_mm + column_mm * (column - 0.5 * last_column), -place + 0.12 * (before % kRows)});
  }
}

std::string marks_plot(const std::string& name, std::string_view color, const char* title) {
  return "$" + name + " using 1:2 with points pt 7 ps 0.7 lc rgb '" + std::string(color) +
         "' title '" + title + "', ";
}

}  // namespace

void draw_population_success(const std::vector<PopulationGroup>& groups,
                             const PopulationCounting& counting,
                             const std::filesystem::path& path) {
  std::vector<std::string> panels;
  std::map<std::string, std::vector<const PopulationGroup*>> members;
  for (const PopulationGroup& group : groups) {
    if (!is_drawn(group)) continue;
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
      number_text(counting.intervals * counting.interval_width_mm) + "]\n" + kLegendBelow;
  int block = 0;
  for (const std::string& panel : panels)
    script += panel_script(panel, members[panel], figure, block);
  figure.add(script + "unset multiplot\n");
  figure.draw(path);
}

void draw_capture_ranges(const std::vector<PopulationGroup>& groups,
                         const PopulationCounting& counting,
                         const std::filesystem::path& path) {
  std::map<std::string, Points> marks;
  Points means;
  std::string tics;
  double place = 0.0;
  for (const PopulationGroup& group : groups) {
    if (!is_drawn(group)) continue;
    place += 1.0;
    tics +=
        (tics.empty() ? "" : ", ") + gnuplot_quoted(group.condition) + " -" + number_text(place);
    const PopulationSuccess& success = drawn_success(group);
    add_patient_marks(success, place, marks);
    means.push_back({success.capture_mm.value,
                     -place - 0.2,
                     success.capture_mm.bootstrap.low,
                     success.capture_mm.bootstrap.high});
  }
  if (means.empty()) return;
  GnuplotFigure figure("Capture range of every patient (van de Kraats)",
                       900,
                       120 + 38 * static_cast<int>(means.size()));
  for (const auto& [name, points] : marks) figure.add_data(name, points);
  figure.add_data("means", means);
  std::string plot;
  if (marks.count("odd") > 0) plot += marks_plot("odd", palette::kSkyBlue, "odd patients");
  if (marks.count("even") > 0) plot += marks_plot("even", palette::kBlue, "even and real patients");
  plot += "$means using 1:2:3:4 with xerrorbars lw 1.5 pt 5 ps 0.7 lc rgb '" +
          std::string(palette::kVermilion) + "' title 'mean, 95 % over patients'";
  figure.add("set xlabel 'capture range (mm of initial TRE)'\nset ytics (" + tics +
             ")\nset yrange [" + number_text(-place - 0.6) + ":-0.4]\nset xrange [-1:" +
             number_text(counting.intervals * counting.interval_width_mm + 1.5) + "]\n" +
             kLegendBelow + "plot " + plot + "\n");
  figure.draw(path);
}

}  // namespace af::evaluation
