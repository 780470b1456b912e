// SPDX-License-Identifier: Apache-2.0
#include "evaluate/outputs/result_figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string_view>

#include "base/hash_random.h"
#include "base/joined.h"
#include "evaluate/statistics/statistics.h"
#include "figures/gnuplot_figure.h"
#include "files/output_file.h"
#include "text/csv_table.h"

namespace af::evaluation {
namespace {

constexpr int kWidthPx = 640;
constexpr int kHeightPx = 420;

std::string color_of(std::size_t group) {
  constexpr std::array<std::string_view, 6> kColors = {palette::kBlue,
                                                       palette::kVermilion,
                                                       palette::kGreen,
                                                       palette::kPurple,
                                                       palette::kSkyBlue,
                                                       palette::kOrange};
  return "rgb '" + std::string(kColors[group % kColors.size()]) + "'";
}

std::string quiet() {
  return "rgb '" + std::string(palette::kQuiet) + "'";
}

std::string label_at(const std::string& text, const std::string& position, const char* side) {
  return "set label " + gnuplot_quoted(text) + " at " + position + " " + side + " textcolor " +
         quiet() + " font ',11'";
}

std::vector<double> finite_of(const std::vector<double>& values) {
  std::vector<double> result;
  std::copy_if(values.begin(), values.end(), std::back_inserter(result), [](double value) {
    return std::isfinite(value);
  });
  return result;
}

/// Of a plot command's parts, one a line.
std::string plots(const std::vector<std::string>& parts) {
  return joined(parts, ", \\\n  ");
}

std::vector<double> box_row(double x, std::vector<double> values) {
  const SampleSummary summary = summarize(std::move(values));
  return {x,
          summary.lower_quartile,
          summary.percentile_5,
          summary.percentile_95,
          summary.upper_quartile,
          summary.median};
}

/// The numbers of a figure, as CSV beside it.
void write_figure_table(const std::filesystem::path& path_without_extension,
                        const CsvTable& table) {
  write_text_file(path_without_extension.string() + ".csv", table.to_text());
}

/// The bar that a TRE falls into, 0.25 mm wide; the last is for all beyond and for NaN.
constexpr double kBarWidthMm = 0.25;
constexpr std::size_t kBars = 20;

std::size_t bar_of(double tre_mm) {
  const double position = tre_mm / kBarWidthMm;
  return position < static_cast<double>(kBars) ? static_cast<std::size_t>(position) : kBars;
}

/// The start of a figure of several panels under one title.
std::string multiplot(const std::string& title, int rows, int columns) {
  return "unset title\nset multiplot layout " + std::to_string(rows) + "," +
         std::to_string(columns) + " title " + gnuplot_quoted(title) + " textcolor rgb '" +
         std::string(palette::kInk) + "'";
}

}  // namespace

void draw_psnr_boxes(const std::vector<PsnrGroup>& groups,
                     PaperLevels levels,
                     const std::filesystem::path& path_without_extension) {
  GnuplotFigure figure("DRR quality: field against ray casting",
                       std::max(460, 240 + 170 * static_cast<int>(groups.size())),
                       kHeightPx);
  std::vector<std::vector<double>> boxes;
  CsvTable table({"group", "psnr_db"});
  std::string tics;
  double lowest = 35.0;
  double highest = 45.0;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const auto x = static_cast<double>(g + 1);
    tics += (g == 0 ? "" : ", ") + gnuplot_quoted(groups[g].label) + " " + std::to_string(g + 1);
    const std::vector<double> values = finite_of(groups[g].psnr_db);
    std::vector<std::vector<double>> dots;
    for (std::size_t i = 0; i < values.size(); ++i) {
      HashRandom jitter(g, i);
      dots.push_back({x + jitter.uniform(-0.13, 0.13), values[i]});
      table.add_row({groups[g].label, number_text(values[i])});
      lowest = std::min(lowest, values[i] - 1.0);
      highest = std::max(highest, values[i] + 1.0);
    }
    figure.add_data("dots" + std::to_string(g), dots);
    if (!values.empty()) boxes.push_back(box_row(x, values));
  }
  figure.add_data("boxes", boxes);
  const std::string right_edge = number_text(static_cast<double>(groups.size()) + 0.6);
  figure.add("unset key\nset ylabel 'PSNR (dB)'\nset xtics (" + tics + ")\nset xrange [0.4:" +
             right_edge + "]\nset yrange [" + number_text(std::floor(lowest)) + ":" +
             number_text(std::ceil(highest)) + "]\nset rmargin 15\nset boxwidth 0.42");
  const std::vector<std::pair<int, const char*>> lines =
      levels == PaperLevels::Shown
          ? std::vector<std::pair<int, const char*>>{{43, "43: paper's medians"},
                                                     {40, "40: almost all above"},
                                                     {36, "36: very few below"}}
          : std::vector<std::pair<int, const char*>>{{40, "40"}, {36, "36"}};
  for (const auto& [level, text] : lines) {
    const std::string y = std::to_string(level);
    std::string line = "set arrow from graph 0, first " + y;
    line.append(" to graph 1, first ").append(y).append(" nohead dt 2 lw 1 lc ").append(quiet());
    figure.add(line);
    figure.add(label_at(text, "graph 1.01, first " + y, "left"));
  }
  std::vector<std::string> parts;
  for (std::size_t g = 0; g < groups.size(); ++g)
    parts.push_back("$dots" + std::to_string(g) + " using 1:2 with points pt 7 ps 0.35 lc rgb '" +
                    std::string(palette::kSkyBlue) + "'");
  parts.push_back("$boxes using 1:2:3:4:5 with candlesticks whiskerbars 0.5 lw 2 lc " +
                  color_of(0));
  parts.push_back("$boxes using 1:6:6:6:6 with candlesticks lw 4 lc " + color_of(1));
  figure.add("set style fill empty\nplot " + plots(parts));
  figure.draw(path_without_extension);
  write_figure_table(path_without_extension, table);
}

void draw_success_rates(const std::vector<OutcomeGroup>& groups,
                        int intervals,
                        double width_mm,
                        const std::filesystem::path& path_without_extension,
                        double success_tre_mm) {
  GnuplotFigure figure("Success against initial error", kWidthPx, kHeightPx);
  std::vector<std::string> parts;
  CsvTable table(
      {"group", "low_mm", "high_mm", "starts", "successes", "rate", "wilson_low", "wilson_high"});
  for (std::size_t g = 0; g < groups.size(); ++g) {
    std::vector<std::vector<double>> rows;
    const double shift_mm =
        width_mm * 0.12 * (static_cast<double>(g) - (static_cast<double>(groups.size()) - 1) / 2);
    for (const IntervalSuccess& interval :
         success_per_interval(groups[g].outcomes, intervals, width_mm, success_tre_mm)) {
      if (interval.trials == 0) continue;
      table.add_row({groups[g].label,
                     number_text(interval.low_mm),
                     number_text(interval.high_mm),
                     std::to_string(interval.trials),
                     std::to_string(interval.successes),
                     number_text(interval.rate()),
                     number_text(interval.wilson.low),
                     number_text(interval.wilson.high)});
      rows.push_back({(interval.low_mm + interval.high_mm) / 2 + shift_mm,
                      100 * interval.rate(),
                      100 * interval.wilson.low,
                      100 * interval.wilson.high});
    }
    const std::string name = "rates" + std::to_string(g);
    figure.add_data(name, rows);
    parts.push_back("$" + name + " using 1:2 with lines lw 1.5 dt 3 lc " + color_of(g) +
                    " notitle");
    parts.push_back("$" + name + " using 1:2:3:4 with yerrorbars lw 2 pt " +
                    std::to_string(g == 0 ? 7 : 5) + " ps 0.8 lc " + color_of(g) + " title " +
                    gnuplot_quoted(groups[g].label));
  }
  figure.add("set xlabel 'initial TRE (mm)'\nset ylabel 'success (% of starts)'\nset xrange [0:" +
             number_text(intervals * width_mm) + "]\nset xtics " + number_text(width_mm) +
             "\nset yrange [0:102]\nset ytics 20\nset key bottom left reverse Left samplen 1.5\n"
             "set arrow from graph 0, first 95 to graph 1, first 95 nohead dt 2 lw 1 lc " +
             quiet());
  figure.add(label_at("95", "graph 0.995, first 95", "right offset 0,-0.6"));
  figure.add("plot " + plots(parts));
  figure.draw(path_without_extension);
  write_figure_table(path_without_extension, table);
}

void draw_tre_histogram(const std::vector<OutcomeGroup>& groups,
                        const std::filesystem::path& path_without_extension,
                        double success_tre_mm) {
  GnuplotFigure figure("Error after registration", kWidthPx, kHeightPx);
  std::vector<std::string> parts;
  const auto group_count = static_cast<double>(groups.size());
  const double bar_mm = 0.84 * kBarWidthMm / group_count;
  CsvTable table({"group", "low_mm", "high_mm", "starts", "share"});
  for (std::size_t g = 0; g < groups.size(); ++g) {
    std::array<double, kBars + 1> counts{};
    for (const TreOutcome& outcome : groups[g].outcomes) counts[bar_of(outcome.tre_mm)] += 1.0;
    std::vector<std::vector<double>> rows;
    for (std::size_t bar = 0; bar <= kBars; ++bar) {
      // The bar for all TREs beyond stands half a millimetre apart.
      const double center_mm =
          (static_cast<double>(bar) + 0.5) * kBarWidthMm + (bar == kBars ? 0.25 : 0.0);
      const auto total = static_cast<double>(groups[g].outcomes.size());
      const double share = total > 0 ? counts[bar] / total : 0.0;
      rows.push_back(
          {center_mm + bar_mm * (static_cast<double>(g) - (group_count - 1) / 2), 100 * share});
      const double low_mm = static_cast<double>(bar) * kBarWidthMm;
      table.add_row({groups[g].label,
                     number_text(low_mm),
                     bar == kBars ? "inf" : number_text(low_mm + kBarWidthMm),
                     number_text(counts[bar]),
                     number_text(share)});
    }
    const std::string name = "bars" + std::to_string(g);
    figure.add_data(name, rows);
    parts.push_back("$" + name + " using 1:2 with boxes fs solid 0.9 noborder lc " + color_of(g) +
                    " title " + gnuplot_quoted(groups[g].label));
  }
  const double end_mm = static_cast<double>(kBars) * kBarWidthMm;
  figure.add("set boxwidth " + number_text(bar_mm) +
             "\nset xlabel 'TRE (mm)'\nset ylabel 'share of starts (%)'\nset xrange [0:" +
             number_text(end_mm + 0.7) + "]\nset yrange [0:*]\nset xtics 0, 0.5, " +
             number_text(end_mm) + "\nset xtics add ('> " + number_text(end_mm) + "' " +
             number_text(end_mm + 0.375) + ", '' " + number_text(end_mm) +
             ")\nset key top right samplen 1.5\nset arrow from first " +
             number_text(success_tre_mm) + ", graph 0 to first " + number_text(success_tre_mm) +
             ", graph 1 nohead dt 2 lw 1.5 lc " + quiet());
  figure.add(label_at("success: below " + number_text(success_tre_mm) + " mm",
                      "first " + number_text(success_tre_mm) + ", graph 0.97",
                      "right offset -0.7,0"));
  figure.add("plot " + plots(parts));
  figure.draw(path_without_extension);
  write_figure_table(path_without_extension, table);
}

void draw_tre_scatter(const std::vector<OutcomeGroup>& groups,
                      double largest_initial_mm,
                      const std::filesystem::path& path_without_extension,
                      double success_tre_mm) {
  std::size_t most = 0;
  for (const OutcomeGroup& group : groups) most = std::max(most, group.outcomes.size());
  // More dots would tell nothing more, and make a page of many megabytes.
  constexpr std::size_t kMostDots = 4000;
  const std::size_t stride = std::max<std::size_t>(1, (most + kMostDots - 1) / kMostDots);
  GnuplotFigure figure(
      "Error before and after registration" +
          (stride == 1 ? std::string() : ", one start in " + std::to_string(stride)),
      kWidthPx,
      kHeightPx);
  std::vector<std::string> parts;
  CsvTable table({"group", "initial_tre_mm", "tre_mm"});
  // Differences below 0.05 mm do not matter; the axis ends there.
  constexpr double kLowestMm = 0.05;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    std::vector<std::vector<double>> rows;
    for (std::size_t i = 0; i < groups[g].outcomes.size(); i += stride) {
      const TreOutcome& outcome = groups[g].outcomes[i];
      table.add_row(
          {groups[g].label, number_text(outcome.initial_tre_mm), number_text(outcome.tre_mm)});
      if (std::isfinite(outcome.tre_mm))
        rows.push_back({outcome.initial_tre_mm, std::max(kLowestMm, outcome.tre_mm)});
    }
    const std::string name = "starts" + std::to_string(g);
    figure.add_data(name, rows);
    parts.push_back("$" + name + " using 1:2 with points pt " + std::to_string(g == 0 ? 7 : 9) +
                    " ps " + (g == 0 ? "0.4" : "0.6") + " lc " + color_of(g) + " title " +
                    gnuplot_quoted(groups[g].label));
  }
  parts.push_back("x > " + number_text(kLowestMm) + " ? x : 1/0 with lines lw 1 dt 3 lc " +
                  quiet() + " notitle");
  figure.add(
      "set xlabel 'initial TRE (mm)'\nset ylabel 'final TRE (mm)'\nset logscale y\n"
      "set xrange [0:" +
      number_text(largest_initial_mm) + "]\nset yrange [" + number_text(kLowestMm) +
      ":*]\nset ytics (0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)\nset key top left "
      "reverse Left samplen 1\nset samples 400\nset arrow from graph 0, first " +
      number_text(success_tre_mm) + " to graph 1, first " + number_text(success_tre_mm) +
      " nohead dt 2 lw 1.5 lc " + quiet());
  figure.add(label_at(
      "success below", "graph 0.99, first " + number_text(success_tre_mm), "right offset 0,-0.6"));
  figure.add(label_at(
      "no change", "graph 0.985, first " + number_text(largest_initial_mm * 1.25), "right"));
  figure.add("plot " + plots(parts));
  figure.draw(path_without_extension);
  write_figure_table(path_without_extension, table);
}

void draw_curve_panels(const std::vector<CurvePanel>& panels,
                       const std::string& title,
                       const std::string& y_label,
                       const std::filesystem::path& path_without_extension) {
  GnuplotFigure figure(title, 900, 560);
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -lowest;
  for (const CurvePanel& panel : panels)
    for (const PanelCurve& curve : panel.curves)
      for (const double value : finite_of(curve.y)) {
        lowest = std::min(lowest, value);
        highest = std::max(highest, value);
      }
  const double margin = 0.05 * (highest - lowest);
  const int rows = (static_cast<int>(panels.size()) + 2) / 3;
  figure.add(multiplot(title, rows, 3) + "\nset yrange [" + number_text(lowest - margin) + ":" +
             number_text(highest + 3 * margin) +
             "]\nset arrow from 0, graph 0 to 0, graph 1 nohead " + "dt 2 lw 1 lc " + quiet() +
             "\nset key at screen 0.99, screen 0.99 right top horizontal samplen 1.5");
  for (std::size_t p = 0; p < panels.size(); ++p) {
    std::vector<std::string> parts;
    for (std::size_t c = 0; c < panels[p].curves.size(); ++c) {
      const PanelCurve& curve = panels[p].curves[c];
      std::vector<std::vector<double>> points;
      for (std::size_t i = 0; i < curve.x.size(); ++i) points.push_back({curve.x[i], curve.y[i]});
      const std::string name = "curve" + std::to_string(p) + "_" + std::to_string(c);
      figure.add_data(name, points);
      figure.add_data(name + "_peak", {{curve.peak_x, curve.peak_y}});
      const std::string key = p == 0 ? "title " + gnuplot_quoted(curve.label) : "notitle";
      std::string line = "$" + name;
      line.append(" using 1:2 with lines lw 2 lc ").append(color_of(c)).append(" ").append(key);
      std::string peak = "$" + name + "_peak using 1:2 with points pt ";
      peak.append(c == 0 ? "7" : "4").append(" ps 0.9 lc ").append(color_of(c)).append(" notitle");
      parts.push_back(std::move(line));
      parts.push_back(std::move(peak));
    }
    figure.add("set xlabel " + gnuplot_quoted(panels[p].x_label) + "\nset ylabel " +
               gnuplot_quoted(p % 3 == 0 ? y_label : "") + "\nplot " + plots(parts));
  }
  figure.add("unset multiplot");
  figure.draw(path_without_extension);
}

void draw_sweep_panels(const std::vector<SweepPanel>& panels,
                       const std::string& title,
                       const std::string& y_label,
                       const std::filesystem::path& path_without_extension) {
  GnuplotFigure figure(title, 760, 600);
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -lowest;
  for (const SweepPanel& panel : panels)
    for (const SweepPoint& point : panel.points) {
      lowest = std::min(lowest, point.low);
      highest = std::max(highest, point.high);
    }
  const int rows = (static_cast<int>(panels.size()) + 1) / 2;
  figure.add(multiplot(title, rows, 2) + "\nunset key\nset ylabel " + gnuplot_quoted(y_label) +
             "\nset yrange [" + number_text(std::floor(lowest)) + ":" +
             number_text(std::ceil(highest)) + "]");
  for (std::size_t p = 0; p < panels.size(); ++p) {
    std::vector<std::vector<double>> all;
    std::vector<std::vector<double>> base;
    std::string tics;
    for (const SweepPoint& point : panels[p].points) {
      all.push_back({point.x, point.middle, point.low, point.high});
      if (point.is_base) base.push_back(all.back());
      tics += (tics.empty() ? "" : ", ") + gnuplot_quoted(number_text(point.x)) + " " +
              number_text(point.x);
    }
    if (all.empty()) continue;
    const std::string name = "sweep" + std::to_string(p);
    figure.add_data(name, all);
    figure.add_data(name + "_base", base.empty() ? all : base);
    const double low_x = all.front()[0];
    const double high_x = all.back()[0];
    const double room = panels[p].is_logarithmic ? 1.25 : 0.1 * (high_x - low_x) + 1e-3 * high_x;
    figure.add(
        std::string(panels[p].is_logarithmic ? "set logscale x" : "unset logscale x") +
        "\nset xrange [" + number_text(panels[p].is_logarithmic ? low_x / room : low_x - room) +
        ":" + number_text(panels[p].is_logarithmic ? high_x * room : high_x + room) +
        "]\nset xtics (" + tics + ")\nset xlabel " + gnuplot_quoted(panels[p].x_label) + "\nplot " +
        plots({"$" + name + " using 1:2 with lines lw 1.5 dt 3 lc " + color_of(0),
               "$" + name + " using 1:2:3:4 with yerrorbars pt 7 ps 0.8 lw 2 lc " + color_of(0),
               "$" + name + "_base using 1:2:3:4 with yerrorbars pt 7 ps 0.9 lw 2 lc " +
                   color_of(base.empty() ? 0 : 1)}));
  }
  figure.add("unset multiplot");
  figure.draw(path_without_extension);
}

}  // namespace af::evaluation
