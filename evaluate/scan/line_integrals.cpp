// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/line_integrals.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Dense>

#include "base/error.h"

namespace af {

namespace {

constexpr const char* kGiveFlat =
    "state flat (an image without the object) or flat_level (the counts of the open beam)";

constexpr int kTerms = 10;  // terms of a cubic polynomial of two variables
using Terms = Eigen::Matrix<double, kTerms, 1>;

Terms cubic_terms(double x, double y) {
  Terms terms;
  terms << 1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y;
  return terms;
}

/// Lines across the rotation axis. Each is a column of an image whose axis runs along columns.
struct LinesAcross {
  const Image2d& image;
  bool are_columns;

  [[nodiscard]] int count() const { return are_columns ? image.width : image.height; }
  [[nodiscard]] int length() const { return are_columns ? image.height : image.width; }
  [[nodiscard]] std::size_t pixel(int line, int at) const {
    const int column = are_columns ? line : at;
    const int row = are_columns ? at : line;
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width) +
           static_cast<std::size_t>(column);
  }
};

float percentile(std::vector<float> values, double share) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

double median(std::vector<double> values) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Pixels that are not dark, or not connected with the ends of the lines through dark ones.
std::vector<unsigned char> lit_pixels(const Image2d& mean, bool lines_are_columns) {
  constexpr float kDarkShare = 0.25F;
  const float dark = kDarkShare * percentile(mean.pixels, 0.99);
  const LinesAcross lines{mean, lines_are_columns};
  std::vector<unsigned char> is_lit(mean.pixels.size(), 1);
  std::vector<std::pair<int, int>> front;
  const auto visit = [&](int line, int at) {
    if (line < 0 || line >= lines.count() || at < 0 || at >= lines.length()) return;
    const std::size_t pixel = lines.pixel(line, at);
    if (is_lit[pixel] == 0 || mean.pixels[pixel] >= dark) return;
    is_lit[pixel] = 0;
    front.emplace_back(line, at);
  };
  for (int line = 0; line < lines.count(); ++line)
    for (const int at : {0, lines.length() - 1}) visit(line, at);
  while (!front.empty()) {
    const auto [line, at] = front.back();
    front.pop_back();
    visit(line - 1, at);
    visit(line + 1, at);
    visit(line, at - 1);
    visit(line, at + 1);
  }
  // The aperture's edge is a penumbra, so the neighbours of dark pixels are excluded too.
  constexpr int kPenumbraPx = 3;
  for (int round = 0; round < kPenumbraPx; ++round) {
    const std::vector<unsigned char> before = is_lit;
    for (int line = 0; line < lines.count(); ++line)
      for (int at = 0; at < lines.length(); ++at) {
        const auto is_dark = [&](int l, int a) {
          return l >= 0 && l < lines.count() && a >= 0 && a < lines.length() &&
                 before[lines.pixel(l, a)] == 0;
        };
        if (is_dark(line - 1, at) || is_dark(line + 1, at) || is_dark(line, at - 1) ||
            is_dark(line, at + 1))
          is_lit[lines.pixel(line, at)] = 0;
      }
  }
  return is_lit;
}

/// The model of the logarithm of the air level.
class AirModel {
 public:
  explicit AirModel(const LinesAcross& lines)
      : lines_(lines), stripes_(static_cast<std::size_t>(lines.count()), 0.0) {}

  [[nodiscard]] double at(int line, int position) const {
    return terms(line, position).dot(polynomial_) + stripes_[static_cast<std::size_t>(line)];
  }

  /// Fits by least squares over the chosen pixels, then takes one factor per line from what the
  /// polynomial leaves, where a line has enough pixels.
  void fit(const std::vector<double>& log_mean, const std::vector<unsigned char>& is_chosen) {
    Eigen::Matrix<double, kTerms, kTerms> normal =
        1e-9 * Eigen::Matrix<double, kTerms, kTerms>::Identity();
    Terms right = Terms::Zero();
    for_each(is_chosen, [&](int line, int position, std::size_t pixel) {
      const Terms row = terms(line, position);
      normal += row * row.transpose();
      right += row * (log_mean[pixel] - stripes_[static_cast<std::size_t>(line)]);
    });
    polynomial_ = normal.ldlt().solve(right);
    constexpr std::size_t kFewestPerLine = 8;
    std::vector<std::vector<double>> rests(static_cast<std::size_t>(lines_.count()));
    for_each(is_chosen, [&](int line, int position, std::size_t pixel) {
      rests[static_cast<std::size_t>(line)].push_back(log_mean[pixel] -
                                                      terms(line, position).dot(polynomial_));
    });
    for (std::size_t line = 0; line < rests.size(); ++line)
      stripes_[line] = rests[line].size() < kFewestPerLine ? 0.0 : median(rests[line]);
  }

 private:
  [[nodiscard]] Terms terms(int line, int position) const {
    return cubic_terms(2.0 * line / (lines_.count() - 1) - 1.0,
                       2.0 * position / (lines_.length() - 1) - 1.0);
  }
  template <typename Visit>
  void for_each(const std::vector<unsigned char>& is_chosen, Visit&& visit) const {
    for (int line = 0; line < lines_.count(); ++line)
      for (int position = 0; position < lines_.length(); ++position)
        if (const std::size_t pixel = lines_.pixel(line, position); is_chosen[pixel] != 0)
          visit(line, position, pixel);
  }

  LinesAcross lines_;
  Terms polynomial_ = Terms::Zero();
  std::vector<double> stripes_;
};

/// The outermost lit pixels of each line.
std::vector<unsigned char> line_ends(const LinesAcross& lines,
                                     const std::vector<unsigned char>& is_lit) {
  constexpr double kEndShare = 0.05;
  const int wanted = std::max(4, static_cast<int>(kEndShare * lines.length()));
  std::vector<unsigned char> is_end(is_lit.size(), 0);
  for (int line = 0; line < lines.count(); ++line)
    for (const bool from_start : {true, false})
      for (int at = 0, found = 0; at < lines.length() && found < wanted; ++at) {
        const std::size_t pixel = lines.pixel(line, from_start ? at : lines.length() - 1 - at);
        if (is_lit[pixel] == 0) continue;
        is_end[pixel] = 1;
        ++found;
      }
  return is_end;
}

/// Pixels whose logarithm lies within 3 robust standard deviations of the model. The deviation is
/// that of the pixels chosen so far.
std::vector<unsigned char> agreeing_pixels(const AirModel& model,
                                           const LinesAcross& lines,
                                           const std::vector<double>& log_mean,
                                           const std::vector<unsigned char>& candidates,
                                           const std::vector<unsigned char>& chosen) {
  std::vector<double> rest(log_mean.size(), 0.0);
  std::vector<double> scatter;
  for (int line = 0; line < lines.count(); ++line)
    for (int at = 0; at < lines.length(); ++at) {
      const std::size_t pixel = lines.pixel(line, at);
      if (candidates[pixel] == 0) continue;
      rest[pixel] = std::abs(log_mean[pixel] - model.at(line, at));
      if (chosen[pixel] != 0) scatter.push_back(rest[pixel]);
    }
  constexpr double kDeviationPerMedian = 1.4826;
  constexpr double kLeastDeviation = 1e-4;  // for images without noise
  const double limit =
      3.0 * std::max(kLeastDeviation, kDeviationPerMedian * median(std::move(scatter)));
  std::vector<unsigned char> agreeing(log_mean.size(), 0);
  for (std::size_t pixel = 0; pixel < rest.size(); ++pixel)
    agreeing[pixel] = candidates[pixel] != 0 && rest[pixel] <= limit ? 1 : 0;
  return agreeing;
}

/// Lit pixels that vary over time as little as air does: they see noise, not the object passing.
std::vector<unsigned char> steady_pixels(const PixelStatistics& statistics,
                                         const std::vector<unsigned char>& is_lit,
                                         const std::vector<unsigned char>& ends) {
  std::vector<float> variation(is_lit.size(), 0.0F);
  std::vector<float> of_ends;
  for (std::size_t i = 0; i < is_lit.size(); ++i) {
    if (is_lit[i] == 0) continue;
    variation[i] = statistics.deviation.pixels[i] / std::max(statistics.mean.pixels[i], 1e-6F);
    if (ends[i] != 0) of_ends.push_back(variation[i]);
  }
  if (of_ends.empty()) return std::vector<unsigned char>(is_lit.size(), 0);
  constexpr float kMostVariation = 2.0F;
  constexpr float kLeastVariation = 1e-3F;
  const float limit = kMostVariation * std::max(kLeastVariation, percentile(of_ends, 0.5));
  std::vector<unsigned char> is_steady = is_lit;
  for (std::size_t i = 0; i < is_lit.size(); ++i)
    if (variation[i] > limit) is_steady[i] = 0;
  return is_steady;
}

/// What lies beside one end of a line in all views need not be air: the object may reach beyond the
/// detector there, or a holder may stand in the beam. The beam itself is not that lopsided.
void refuse_shadow_at_one_side(const LinesAcross& lines,
                               const std::vector<double>& log_mean,
                               const std::vector<unsigned char>& ends) {
  std::vector<float> differences;
  for (int line = 0; line < lines.count(); ++line) {
    std::vector<double> first;
    std::vector<double> last;
    for (int at = 0; at < lines.length(); ++at)
      if (const std::size_t pixel = lines.pixel(line, at); ends[pixel] != 0)
        (2 * at < lines.length() ? first : last).push_back(log_mean[pixel]);
    if (!first.empty() && !last.empty())
      differences.push_back(
          static_cast<float>(std::abs(median(std::move(first)) - median(std::move(last)))));
  }
  if (differences.empty()) return;
  constexpr double kLeastShare = 0.55;
  constexpr double kOfLines = 0.8;
  const double share = std::exp(-static_cast<double>(percentile(std::move(differences), kOfLines)));
  if (share < kLeastShare)
    throw InputError("air around the object",
                     "at one end of the lines across the rotation axis, counts are " +
                         std::to_string(share) + " times those at the other",
                     "must be seen at both ends, but the object or a holder shadows one in all "
                     "views; " +
                         std::string(kGiveFlat));
}

/// Whether the pixels taken for air have the same share of the flat: half of them within 2 %. What
/// an object transmits at its thinnest changes from place to place.
bool is_even_in_air(const AirLevel& level, const std::vector<double>& ratios) {
  std::vector<float> in_air;
  for (std::size_t i = 0; i < ratios.size(); ++i)
    if (level.is_air[i] != 0) in_air.push_back(static_cast<float>(ratios[i]));
  if (in_air.empty()) return false;
  constexpr float kEven = 0.02F;
  const float low = percentile(in_air, 0.25);
  const float high = percentile(std::move(in_air), 0.75);
  return high - low < kEven * high;
}

std::size_t count_of(const std::vector<unsigned char>& flags) {
  return static_cast<std::size_t>(std::accumulate(flags.begin(), flags.end(), std::size_t{0}));
}

}  // namespace

PixelStatistics pixel_statistics(const std::vector<const Image2d*>& images) {
  check(!images.empty(), "statistics of no images");
  const Image2d& first = *images.front();
  PixelStatistics statistics{Image2d(first.width, first.height),
                             Image2d(first.width, first.height)};
  const auto count = static_cast<double>(images.size());
  for (std::size_t i = 0; i < first.pixels.size(); ++i) {
    double sum = 0.0;
    double squares = 0.0;
    for (const Image2d* const image : images) {
      const auto value = static_cast<double>(image->pixels[i]);
      sum += value;
      squares += value * value;
    }
    const double mean = sum / count;
    statistics.mean.pixels[i] = static_cast<float>(mean);
    statistics.deviation.pixels[i] =
        static_cast<float>(std::sqrt(std::max(0.0, squares / count - mean * mean)));
  }
  return statistics;
}

AirLevel estimated_air_level(const PixelStatistics& statistics, AxisAlong axis_along) {
  const Image2d& mean = statistics.mean;
  const bool lines_are_columns = axis_along == AxisAlong::Columns;
  const LinesAcross lines{mean, lines_are_columns};
  AirLevel level{Image2d(mean.width, mean.height), lit_pixels(mean, lines_are_columns), {}};
  std::vector<double> log_mean(mean.pixels.size(), 0.0);
  for (std::size_t i = 0; i < log_mean.size(); ++i)
    log_mean[i] = std::log(std::max(1e-3, static_cast<double>(mean.pixels[i])));
  const std::vector<unsigned char> ends = line_ends(lines, level.is_lit);
  refuse_shadow_at_one_side(lines, log_mean, ends);
  const std::vector<unsigned char> candidates = steady_pixels(statistics, level.is_lit, ends);
  std::vector<unsigned char> chosen = ends;
  for (std::size_t i = 0; i < chosen.size(); ++i) chosen[i] = chosen[i] & candidates[i];
  const auto require_pixels = [&] {
    if (const std::size_t found = count_of(chosen); found < std::size_t{20} * kTerms)
      throw InputError("air around the object",
                       std::to_string(found) + " pixels",
                       "must be seen by at least 200 pixels at the ends of the lines across the "
                       "rotation axis; " +
                           std::string(kGiveFlat));
  };
  require_pixels();
  AirModel model(lines);
  constexpr int kRounds = 12;
  for (int round = 0; round < kRounds; ++round) {
    model.fit(log_mean, chosen);
    chosen = agreeing_pixels(model, lines, log_mean, candidates, chosen);
    require_pixels();
  }
  for (int line = 0; line < lines.count(); ++line)
    for (int at = 0; at < lines.length(); ++at)
      level.air.pixels[lines.pixel(line, at)] = static_cast<float>(std::exp(model.at(line, at)));
  level.is_air = std::move(chosen);
  return level;
}

AirLevel air_level_of_flat(const Image2d& flat, const PixelStatistics& statistics) {
  AirLevel level{flat, std::vector<unsigned char>(flat.pixels.size(), 1), {}};
  level.is_air.assign(flat.pixels.size(), 0);
  constexpr float kLeastShare = 0.01F;
  constexpr double kSameAsFlat = 0.05;
  const float least = kLeastShare * percentile(flat.pixels, 0.99);
  std::vector<double> ratios(flat.pixels.size(), 0.0);
  for (std::size_t i = 0; i < flat.pixels.size(); ++i) {
    if (!(flat.pixels[i] > least)) {
      level.is_lit[i] = 0;
      level.air.pixels[i] = std::max(least, 1e-6F);
      continue;
    }
    ratios[i] = static_cast<double>(statistics.mean.pixels[i] / flat.pixels[i]);
  }
  // The tube may have given somewhat less, or more, than for the flat. The brightest ratios are
  // those of air.
  constexpr double kSameExposure = 0.1;
  std::vector<float> lit;
  for (std::size_t i = 0; i < ratios.size(); ++i)
    if (level.is_lit[i] != 0) lit.push_back(static_cast<float>(ratios[i]));
  if (lit.empty()) throw InputError("flat", "all dark", "must show the open beam");
  const auto open = static_cast<double>(percentile(std::move(lit), 0.98));
  level.brightest_share = open;
  for (std::size_t i = 0; i < ratios.size(); ++i)
    if (level.is_lit[i] != 0 && std::abs(ratios[i] - open) <= kSameAsFlat * open)
      level.is_air[i] = 1;
  if (std::abs(open - 1.0) > kSameExposure && !is_even_in_air(level, ratios))
    std::fill(level.is_air.begin(), level.is_air.end(), 0);
  return level;
}

double beam_of(const Image2d& counts, const AirLevel& level) {
  double air = 0.0;
  double seen = 0.0;
  for (std::size_t i = 0; i < counts.pixels.size(); ++i)
    if (level.is_air[i] != 0) {
      seen += static_cast<double>(counts.pixels[i]);
      air += static_cast<double>(level.air.pixels[i]);
    }
  return air > 0.0 ? seen / air : 1.0;
}

double least_count_of(const AirLevel& level) {
  constexpr double kFewestCounts = 50.0;
  constexpr double kLeastTransmission = 1e-5;
  std::vector<float> lit;
  for (std::size_t i = 0; i < level.is_lit.size(); ++i)
    if (level.is_lit[i] != 0) lit.push_back(level.air.pixels[i]);
  check(!lit.empty(), "an air level without lit pixels");
  const auto air = static_cast<double>(percentile(std::move(lit), 0.5));
  return air < kFewestCounts ? kLeastTransmission * air : 0.5;
}

Image2d line_integrals_of(const Image2d& counts,
                          const AirLevel& level,
                          AxisAlong axis_along,
                          double least_count) {
  const double beam = beam_of(counts, level);
  Image2d result(counts.width, counts.height);
  for (std::size_t i = 0; i < counts.pixels.size(); ++i) {
    const double count = std::max(least_count, static_cast<double>(counts.pixels[i]));
    result.pixels[i] =
        static_cast<float>(-std::log(count / (beam * static_cast<double>(level.air.pixels[i]))));
  }
  const LinesAcross lines{counts, axis_along == AxisAlong::Columns};
  std::vector<int> lit;
  for (int line = 0; line < lines.count(); ++line) {
    lit.clear();
    for (int at = 0; at < lines.length(); ++at)
      if (level.is_lit[lines.pixel(line, at)] != 0) lit.push_back(at);
    for (int at = 0; at < lines.length(); ++at) {
      if (level.is_lit[lines.pixel(line, at)] != 0) continue;
      if (lit.empty()) {
        result.pixels[lines.pixel(line, at)] = 0.0F;
        continue;
      }
      auto after = std::lower_bound(lit.begin(), lit.end(), at);
      if (after == lit.end() || (after != lit.begin() && at - *(after - 1) < *after - at)) --after;
      result.pixels[lines.pixel(line, at)] = result.pixels[lines.pixel(line, *after)];
    }
  }
  return result;
}

}  // namespace af
