// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/mutual_information.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/joined.h"
#include "unit/register/similarity/noise_image.h"

namespace af::registration {
namespace {

/// MI sums some 1e4 terms n log n below 1e6, each with a relative error of 1e-16, and divides by
/// some 1e3 pixels.
constexpr double kRoundingNats = 1e-10;

Image2d image_of(int width, int height, const std::vector<float>& values) {
  Image2d image(width, height);
  image.pixels = values;
  return image;
}

/// width x height pixels that take each of the levels 0 ... levels - 1 equally often, in rows.
Image2d rows_of_levels(int levels, int width) {
  Image2d image(width, levels);
  for (int row = 0; row < levels; ++row)
    for (int column = 0; column < width; ++column) image.at(column, row) = static_cast<float>(row);
  return image;
}

double mutual_information(const SimilarityReference& reference,
                          const std::vector<float>& drr,
                          int bins = 64) {
  const MutualInformation measure(reference, bins);
  const auto workspace = measure.make_workspace();
  return measure.evaluate(drr, *workspace);
}

/// The definition by probabilities, an independent way to the same number.
double mutual_information_by_definition(const Image2d& xray,
                                        const ValueRange& xray_range,
                                        const std::vector<float>& drr,
                                        const ValueRange& drr_range,
                                        int bins) {
  const auto bin_of = [&](float value, const ValueRange& range) {
    const double position =
        (static_cast<double>(value) - range.low) / (range.high - range.low) * bins;
    return static_cast<std::size_t>(std::clamp(static_cast<int>(position), 0, bins - 1));
  };
  const auto n = static_cast<std::size_t>(bins);
  std::vector<double> joint(n * n, 0.0);
  std::vector<double> x(n, 0.0);
  std::vector<double> d(n, 0.0);
  const double share = 1.0 / static_cast<double>(drr.size());
  for (std::size_t i = 0; i < drr.size(); ++i) {
    const std::size_t row = bin_of(xray.pixels[i], xray_range);
    const std::size_t column = bin_of(drr[i], drr_range);
    joint[row * n + column] += share;
    x[row] += share;
    d[column] += share;
  }
  double sum = 0.0;
  for (std::size_t row = 0; row < n; ++row)
    for (std::size_t column = 0; column < n; ++column)
      if (const double p = joint[row * n + column]; p > 0.0)
        sum += p * std::log(p / (x[row] * d[column]));
  return sum;
}

TEST(MutualInformation, OfAnImageWithItselfIsItsEntropy) {
  // 16 equally frequent levels: log 16 nats.
  const Image2d image = rows_of_levels(16, 20);
  const SimilarityReference reference{image, {}, {0.0, 15.0}};
  EXPECT_NEAR(mutual_information(reference, image.pixels), std::log(16.0), kRoundingNats);
}

TEST(MutualInformation, OfIndependentImagesIsZero) {
  // X-ray varies by row, DRR by column: every pair of levels occurs exactly once.
  const Image2d xray = rows_of_levels(16, 16);
  std::vector<float> drr(256);
  for (std::size_t i = 0; i < drr.size(); ++i) drr[i] = static_cast<float>(i % 16);
  const SimilarityReference reference{xray, {}, {0.0, 15.0}};
  EXPECT_NEAR(mutual_information(reference, drr), 0.0, kRoundingNats);
}

TEST(MutualInformation, OfAConstantDrrIsZero) {
  const Image2d xray = test::noise_image(31, 17, 1);
  const SimilarityReference reference{xray, {}, {0.0, 4.0}};
  EXPECT_NEAR(mutual_information(reference, std::vector<float>(xray.pixels.size(), 2.0f)),
              0.0,
              kRoundingNats);
}

TEST(MutualInformation, OfAKnownTwoByTwoTableIsItsClosedForm) {
  // Counts 3 1 / 1 3 of 8: MI = 2 * 3/8 log(3/8 / (1/4)) + 2 * 1/8 log(1/8 / (1/4)).
  const Image2d xray = image_of(8, 1, {0, 0, 0, 0, 1, 1, 1, 1});
  const std::vector<float> drr = {0, 0, 0, 1, 0, 1, 1, 1};
  const SimilarityReference reference{xray, {}, {0.0, 1.0}};
  const double expected = 0.75 * std::log(1.5) + 0.25 * std::log(0.5);
  EXPECT_NEAR(mutual_information(reference, drr, 2), expected, kRoundingNats);
}

TEST(MutualInformation, EqualsTheDefinitionOnNoise) {
  const Image2d xray = test::noise_image(61, 47, 2);
  const Image2d other = test::noise_image(61, 47, 3);
  std::vector<float> drr(xray.pixels.size());
  for (std::size_t i = 0; i < drr.size(); ++i) drr[i] = 0.7f * xray.pixels[i] + other.pixels[i];
  const auto [low, high] = std::minmax_element(xray.pixels.begin(), xray.pixels.end());
  // The range is narrower than the DRR's values. What lies beyond counts in the outer bins.
  const ValueRange drr_range{1.0, 6.0};
  for (const int bins : {2, 13, 64, 256}) {
    const double expected = mutual_information_by_definition(
        xray, {static_cast<double>(*low), static_cast<double>(*high)}, drr, drr_range, bins);
    EXPECT_NEAR(mutual_information({xray, {}, drr_range}, drr, bins), expected, kRoundingNats)
        << bins << " bins";
  }
}

TEST(MutualInformation, DoesNotChangeWhenDrrLevelsAreRenamed) {
  // A permutation of the DRR's bins permutes the histogram's columns.
  const Image2d xray = rows_of_levels(8, 32);
  std::vector<float> drr(256);
  std::vector<float> renamed(256);
  HashRandom random(4);
  for (std::size_t i = 0; i < drr.size(); ++i) {
    const auto level = (static_cast<unsigned>(xray.pixels[i]) + random.below(3)) % 8;
    drr[i] = static_cast<float>(level);
    renamed[i] = static_cast<float>((level * 5 + 3) % 8);
  }
  const SimilarityReference reference{xray, {}, {0.0, 7.0}};
  EXPECT_NEAR(mutual_information(reference, drr, 8),
              mutual_information(reference, renamed, 8),
              kRoundingNats);
}

TEST(MutualInformation, IsSymmetricInItsTwoImages) {
  const Image2d a = rows_of_levels(8, 32);
  Image2d b = a;
  HashRandom random(5);
  for (float& pixel : b.pixels)
    pixel = static_cast<float>((static_cast<unsigned>(pixel) + random.below(3)) % 8);
  const ValueRange range{0.0, 7.0};
  EXPECT_NEAR(mutual_information({a, {}, range}, b.pixels, 8),
              mutual_information({b, {}, range}, a.pixels, 8),
              kRoundingNats);
}

TEST(MutualInformation, IgnoresPixelsOutsideTheMask) {
  const Image2d xray = test::noise_image(20, 10, 6);
  std::vector<float> drr = test::noise_image(20, 10, 7).pixels;
  std::vector<float> masked_drr = drr;
  SimilarityReference reference{xray, std::vector<std::uint8_t>(200, 1), {0.0, 4.0}};
  for (std::size_t i = 100; i < 200; ++i) reference.used[i] = 0;
  SimilarityReference changed = reference;
  for (std::size_t i = 100; i < 200; ++i) {
    changed.xray.pixels[i] = std::numeric_limits<float>::quiet_NaN();
    masked_drr[i] = 1000.0f;
  }
  const double expected = mutual_information(reference, drr);
  EXPECT_EQ(mutual_information(changed, masked_drr), expected);
  // The same as the upper half alone.
  const SimilarityReference half{crop(xray, {0, 0, 20, 5}), {}, {0.0, 4.0}};
  drr.resize(100);
  EXPECT_EQ(mutual_information(half, drr), expected);
}

TEST(MutualInformation, StaysDefinedForADrrThatIsNotFinite) {
  const Image2d xray = test::noise_image(16, 16, 9);
  std::vector<float> drr = xray.pixels;
  const SimilarityReference reference{xray, {}, {0.0, 4.0}};
  const double infinity = std::numeric_limits<double>::infinity();
  drr[0] = std::numeric_limits<float>::quiet_NaN();
  drr[1] = static_cast<float>(infinity);
  drr[2] = static_cast<float>(-infinity);
  const double with_bad_values = mutual_information(reference, drr);
  // NaN and values below the range count in the first bin, values above it in the last.
  drr[0] = drr[2] = 0.0f;
  drr[1] = 4.0f;
  EXPECT_EQ(with_bad_values, mutual_information(reference, drr));
}

TEST(MutualInformation, RefusesAnEmptyMaskAConstantXrayAndAnEmptyDrrRange) {
  const Image2d xray = test::noise_image(4, 4, 8);
  EXPECT_THROW(MutualInformation({xray, std::vector<std::uint8_t>(16, 0), {0.0, 1.0}}, 64),
               InputError);
  EXPECT_THROW(MutualInformation({xray, std::vector<std::uint8_t>(15, 1), {0.0, 1.0}}, 64),
               InputError);
  EXPECT_THROW(MutualInformation({Image2d(4, 4), {}, {0.0, 1.0}}, 64), InputError);
  EXPECT_THROW(MutualInformation({xray, {}, {1.0, 1.0}}, 64), InputError);
  EXPECT_THROW(MutualInformation({Image2d(), {}, {0.0, 1.0}}, 64), InputError);
  Image2d with_nan = xray;
  with_nan.pixels[3] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(MutualInformation({with_nan, {}, {0.0, 1.0}}, 64), InputError);
}

TEST(SimilarityOptions, AnUnknownMeasureIsRefusedWithTheKnownOnes) {
  SimilarityOptions options;
  options.name = "psnr";
  options.bins = 1;
  const std::vector<std::string> found = problems(options);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0], "similarity = 'psnr': must be one of " + joined(similarity_names()));
  EXPECT_EQ(found[1], "bins = 1: must be between 2 and 256");
  EXPECT_THROW(make_similarity(options, {}), InputError);
}

}  // namespace
}  // namespace af::registration
