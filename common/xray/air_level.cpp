// SPDX-License-Identifier: Apache-2.0
#include "xray/air_level.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "xray/quantile.h"
#include "xray/xray_borders.h"

namespace af {

namespace {

constexpr double kBinWidth = 0.02;  ///< in log intensity
constexpr int kPeakHalfBins = 5;    ///< a peak reaches 10 % to both sides
constexpr double kLeastPeakShare = 0.03;
constexpr double kEdgeBandShare = 0.05;  ///< share of the shorter side
constexpr double kEdgeAirShare = 0.9;    ///< percentile within the band

/// Half a step of the values. It stands for a pixel that counted nothing.
double half_step(const std::vector<float>& values, double air_level) {
  float smallest_positive = 0.0f;
  bool integers = true;
  for (const float value : values) {
    integers = integers && value == std::nearbyint(value);
    if (value > 0.0f && (smallest_positive == 0.0f || value < smallest_positive))
      smallest_positive = value;
  }
  // In corrected values the smallest positive one may be next to nothing. Half a count of 16 bits
  // is the least that a detector tells apart.
  constexpr double kHalfCount = 1.0 / 131072.0;
  return integers ? 0.5
                  : std::max(0.5 * static_cast<double>(smallest_positive), kHalfCount * air_level);
}

std::vector<float> used_values(const Image2d& image, const Image2d& mask) {
  std::vector<float> values;
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    if (mask.pixels[i] != 0.0f) values.push_back(image.pixels[i]);
  return values;
}

}  // namespace

std::optional<AirLevel> open_beam_peak(const std::vector<float>& intensities) {
  constexpr int kBins = 400;  // down to exp(-8) of the brightest
  constexpr double kBrightest = 0.9999;
  if (intensities.empty()) return std::nullopt;
  const auto top = static_cast<double>(nearest_rank(intensities, kBrightest));
  if (!(top > 0.0)) return std::nullopt;
  std::array<double, kBins> counts{};
  for (const float value : intensities) {
    if (!(value > 0.0f)) continue;
    const double below = std::log(top / static_cast<double>(value)) / kBinWidth;
    if (below < kBins) counts[static_cast<std::size_t>(std::max(0.0, below))] += 1.0;
  }
  const auto mass = [&](int middle) {
    double sum = 0.0;
    for (int bin = std::max(0, middle - kPeakHalfBins);
         bin <= std::min(kBins - 1, middle + kPeakHalfBins);
         ++bin)
      sum += counts[static_cast<std::size_t>(bin)];
    return sum;
  };
  const double least = kLeastPeakShare * static_cast<double>(intensities.size());
  for (int bin = 0; bin < kBins; ++bin) {
    if (mass(bin) < least) continue;
    // Climb to the top of this peak.
    while (bin + 1 < kBins && mass(bin + 1) > mass(bin)) ++bin;
    std::vector<float> peak;
    const double middle = top * std::exp(-kBinWidth * (bin + 0.5));
    const double reach = kBinWidth * (kPeakHalfBins + 0.5);
    for (const float value : intensities)
      if (value > 0.0f && std::abs(std::log(static_cast<double>(value) / middle)) <= reach)
        peak.push_back(value);
    if (peak.empty()) return std::nullopt;
    const double share = static_cast<double>(peak.size()) / static_cast<double>(intensities.size());
    return AirLevel{static_cast<double>(nearest_rank(peak, 0.5)), share};
  }
  return std::nullopt;
}

AirLevel air_beside_edge(const Image2d& intensity, const Image2d& mask) {
  const int width_px = std::max(
      2,
      static_cast<int>(std::lround(kEdgeBandShare * std::min(intensity.width, intensity.height))));
  const std::vector<float> band = values_along_edge(intensity, mask, width_px);
  AirLevel air;
  if (band.empty()) return air;
  air.level = static_cast<double>(nearest_rank(band, kEdgeAirShare));
  const auto near = std::count_if(band.begin(), band.end(), [&](float value) {
    return std::abs(static_cast<double>(value) - air.level) <= 0.1 * air.level;
  });
  air.share = static_cast<double>(near) / static_cast<double>(band.size());
  return air;
}

Background background_of(const Image2d& image, const Image2d& mask) {
  constexpr double kLow = 0.01;
  constexpr double kHigh = 0.99;
  constexpr double kBright = 0.75;
  constexpr double kDark = 0.25;
  std::vector<float> in_field;
  if (!mask.pixels.empty()) in_field = used_values(image, mask);
  const std::vector<float>& values = mask.pixels.empty() ? image.pixels : in_field;
  const int width_px = std::max(2, std::min(image.width, image.height) / 32);
  const std::vector<float> edge = values_along_edge(image, mask, width_px);
  if (values.empty() || edge.empty()) return Background::Undecided;
  const auto low = static_cast<double>(nearest_rank(values, kLow));
  const auto high = static_cast<double>(nearest_rank(values, kHigh));
  const auto middle = static_cast<double>(nearest_rank(edge, 0.5));
  if (middle > low + kBright * (high - low)) return Background::Bright;
  if (middle < low + kDark * (high - low)) return Background::Dark;
  return Background::Undecided;
}

double bright_detail(const Image2d& image, const Image2d& mask) {
  struct Pixel {
    float level;  // level of the surroundings: the pixel's own noise must not choose its quarter
    float detail;
  };
  if (image.width < 3 || image.height < 3) return 0.0;
  const auto [least, most] = std::ranges::minmax(image.pixels);
  std::vector<Pixel> pixels;
  for (int row = 1; row + 1 < image.height; ++row)
    for (int column = 1; column + 1 < image.width; ++column) {
      const float own = image.at(column, row);
      if (own == least || own == most) continue;
      if (!mask.pixels.empty() && mask.at(column, row) == 0.0f) continue;
      const float across = image.at(column - 1, row) + image.at(column + 1, row);
      const float along = image.at(column, row - 1) + image.at(column, row + 1);
      pixels.push_back({(across + along + own) / 5.0f,
                        std::min(std::abs(across - 2.0f * own), std::abs(along - 2.0f * own))});
    }
  const auto quarter = static_cast<std::ptrdiff_t>(pixels.size() / 4);
  if (quarter == 0) return 0.0;
  const auto mean_detail = [&](const auto& darker) {
    std::nth_element(pixels.begin(), pixels.begin() + quarter, pixels.end(), darker);
    double sum = 0.0;
    for (auto pixel = pixels.begin(); pixel != pixels.begin() + quarter; ++pixel)
      sum += static_cast<double>(pixel->detail);
    return sum / static_cast<double>(quarter);
  };
  // Detail settles ties: which of several equal pixels comes first must not depend on the library.
  const double dark = mean_detail([](const Pixel& a, const Pixel& b) {
    return a.level < b.level || (a.level == b.level && a.detail < b.detail);
  });
  const double bright = mean_detail([](const Pixel& a, const Pixel& b) {
    return a.level > b.level || (a.level == b.level && a.detail < b.detail);
  });
  return dark > 0.0 && bright > 0.0 ? std::log2(bright / dark) : 0.0;
}

Image2d flat_corrected(const Image2d& image, const Image2d& flat, const Image2d& dark) {
  Image2d corrected(image.width, image.height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const float offset = dark.pixels.empty() ? 0.0f : dark.pixels[i];
    const float beam = flat.pixels[i] - offset;
    corrected.pixels[i] = beam > 0.0f ? (image.pixels[i] - offset) / beam : 0.0f;
  }
  return corrected;
}

void take_negative_log(Image2d& image, double air_level) {
  const auto attenuation = [&](double intensity) {
    return static_cast<float>(-std::log(intensity / air_level));
  };
  const bool has_dark_pixels = !std::ranges::all_of(image.pixels, [](float v) { return v > 0.0f; });
  const float of_dark = has_dark_pixels ? attenuation(half_step(image.pixels, air_level)) : 0.0f;
  // Detectors count in grey levels, of which there are fewer than pixels.
  constexpr int kLevels = 65536;
  std::vector<float> of_level(kLevels, std::numeric_limits<float>::quiet_NaN());
  for (float& pixel : image.pixels) {
    if (!(pixel > 0.0f)) {
      pixel = of_dark;
      continue;
    }
    const int level = pixel < static_cast<float>(kLevels) ? static_cast<int>(pixel) : 0;
    if (static_cast<float>(level) != pixel) {
      pixel = attenuation(static_cast<double>(pixel));
      continue;
    }
    float& known = of_level[static_cast<std::size_t>(level)];
    if (std::isnan(known)) known = attenuation(static_cast<double>(pixel));
    pixel = known;
  }
}

}  // namespace af
