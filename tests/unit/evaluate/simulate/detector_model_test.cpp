// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/detector_model.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "evaluate/simulate/parallel_rows.h"

namespace af {
namespace {

constexpr RegionOfInterest kRoi{60, 50, 80, 100};

/// A disc that lets 5 % to 40 % through, in an open beam.
Image2d disc_primary() {
  Image2d image(200, 200);
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column) {
      const double radius = std::hypot(column - 100.0, row - 95.0);
      image.at(column, row) =
          radius < 85.0 ? static_cast<float>(0.05 + 0.35 * radius / 85.0) : 1.0f;
    }
  return image;
}

double mean_in(const Image2d& image, const RegionOfInterest& roi) {
  const Image2d part = crop(image, roi);
  return std::accumulate(part.pixels.begin(), part.pixels.end(), 0.0) /
         static_cast<double>(part.pixels.size());
}

DetectorOptions nothing_but_levels() {
  DetectorOptions options;
  options.scatter_to_primary_ratio = 0.0;
  options.photons_per_pixel = 0.0;
  options.blur_sigma_px = 0.0;
  return options;
}

TEST(ScatterImage, HasTheStatedRatioWithinTheRegion) {
  const Image2d primary = disc_primary();
  DetectorOptions options;
  for (const double ratio : {0.1, 0.5, 2.0}) {
    options.scatter_to_primary_ratio = ratio;
    const Image2d scatter = scatter_image(primary, kRoi, 0.4, options);
    // Pixels are floats: relative rounding 2^-24 each.
    EXPECT_NEAR(mean_in(scatter, kRoi) / mean_in(primary, kRoi), ratio, 1e-6 * ratio);
  }
}

TEST(ScatterImage, OfTheOpenBeamVeilsTheObjectFromItsEdgesInwards) {
  const Image2d primary = disc_primary();
  DetectorOptions options;
  options.scatter_sigma_mm = 12.0;  // 30 px on a disc of 85 px radius
  const auto edge_over_middle = [&](ScatterSource source) {
    options.scatter_source = source;
    const Image2d scatter = scatter_image(primary, kRoi, 0.4, options);
    // The stated ratio holds for either source; pixels are floats.
    EXPECT_NEAR(mean_in(scatter, kRoi) / mean_in(primary, kRoi), 0.3, 1e-6);
    return scatter.at(100, 14) / scatter.at(100, 95);
  };
  const float of_object = edge_over_middle(ScatterSource::Object);
  const float with_open_beam = edge_over_middle(ScatterSource::ObjectAndOpenBeam);
  // At the disc's edge half of the kernel sees the open beam, which is at least 2.5 times as bright
  // as anything in the disc; in the middle it sees none (2.8 sigma).
  EXPECT_LT(of_object, 1.5f);
  EXPECT_GT(with_open_beam, 2.5f);
}

TEST(WithHeelRamp, GrowsLinearlyFromTheFirstToTheLastRow) {
  Image2d flat(5, 101);
  std::fill(flat.pixels.begin(), flat.pixels.end(), 0.8f);
  const Image2d ramped = with_heel_ramp(flat, 0.25);
  constexpr float kTolerance = 1e-6f;  // products of floats of about 1
  EXPECT_NEAR(ramped.at(2, 100), 0.8f, kTolerance);
  EXPECT_NEAR(ramped.at(2, 100) / ramped.at(2, 0), 1.25f / 0.75f, 4.0f * kTolerance);
  EXPECT_NEAR(ramped.at(2, 50), 0.5f * (ramped.at(2, 0) + ramped.at(2, 100)), kTolerance);
  for (int row = 0; row < 101; ++row) EXPECT_EQ(ramped.at(0, row), ramped.at(4, row));
  EXPECT_EQ(with_heel_ramp(flat, 0.0).pixels, flat.pixels);
}

TEST(ScatterImage, IsBroad) {
  const Image2d primary = disc_primary();
  const Image2d scatter = scatter_image(primary, kRoi, 0.4, DetectorOptions{});
  // sigma is 100 px. A Gaussian blur of a source s has slopes of at most mean(|s|) / (sigma sqrt(2
  // pi)) * 2, so neighbours differ by less than 1 % of the largest value.
  const float largest = *std::max_element(scatter.pixels.begin(), scatter.pixels.end());
  for (int row = 0; row < scatter.height; ++row)
    for (int column = 1; column < scatter.width; ++column)
      ASSERT_LT(std::abs(scatter.at(column, row) - scatter.at(column - 1, row)), 0.01f * largest);
}

TEST(ScatterImage, OpenBeamScattersNothing) {
  Image2d open(64, 64);
  std::fill(open.pixels.begin(), open.pixels.end(), 1.0f);
  const Image2d scatter = scatter_image(open, {10, 10, 20, 20}, 0.4, DetectorOptions{});
  EXPECT_THAT(scatter.pixels, ::testing::Each(0.0f));
}

TEST(PhotonNoise, HasPoissonMeanAndVariance) {
  constexpr double kPhotons = 5000.0;
  constexpr float kSignal = 0.02f;  // 100 photons
  Image2d signal(300, 300);
  std::fill(signal.pixels.begin(), signal.pixels.end(), kSignal);
  const Image2d noisy = with_photon_noise(signal, kPhotons, 3, 4, 2);
  const double expected = static_cast<double>(kSignal) * kPhotons;
  double sum = 0.0;
  double sum_of_squares = 0.0;
  for (const float value : noisy.pixels) {
    const double deviation = static_cast<double>(value) * kPhotons - expected;
    sum += deviation;
    sum_of_squares += deviation * deviation;
  }
  const auto n = static_cast<double>(noisy.pixels.size());
  // Five standard errors.
  EXPECT_NEAR(sum / n, 0.0, 5.0 * std::sqrt(expected / n));
  EXPECT_NEAR(
      sum_of_squares / n, expected, 5.0 * std::sqrt((expected + 2.0 * expected * expected) / n));
}

TEST(PhotonNoise, DependsOnSeedAndKeyButNotOnThreads) {
  const Image2d signal = disc_primary();
  const auto at = [&](std::uint64_t seed, std::uint64_t key, int threads) {
    return with_photon_noise(signal, 1000.0, seed, key, threads).pixels;
  };
  EXPECT_EQ(at(1, 2, 1), at(1, 2, 3));
  EXPECT_NE(at(1, 2, 1), at(2, 2, 1));
  EXPECT_NE(at(1, 2, 1), at(1, 3, 1));
}

TEST(Detect, WithEveryEffectOffOnlyScales) {
  const Image2d primary = disc_primary();
  DetectorOptions options = nothing_but_levels();
  options.bits = 0;
  const Image2d levels = detect(primary, kRoi, 0.4, options, 1, 2, 1);
  for (std::size_t i = 0; i < primary.pixels.size(); ++i)
    ASSERT_EQ(levels.pixels[i], primary.pixels[i] * 4000.0f);
}

TEST(Detect, QuantisesToWholeLevelsOfTheStatedBits) {
  DetectorOptions options = nothing_but_levels();
  options.open_beam_level = 8000.0;  // saturates 12 bits
  const Image2d levels = detect(disc_primary(), kRoi, 0.4, options, 1, 2, 1);
  for (const float level : levels.pixels) {
    ASSERT_EQ(level, std::round(level));
    ASSERT_GE(level, 0.0f);
    ASSERT_LE(level, 4095.0f);
  }
  EXPECT_EQ(levels.at(0, 0), 4095.0f);
}

TEST(Detect, BlurKeepsTheMeanOfAnImageThatIsFlatAtItsEdges) {
  DetectorOptions options = nothing_but_levels();
  options.bits = 0;
  options.blur_sigma_px = 2.0;
  const Image2d primary = disc_primary();
  const Image2d blurred = detect(primary, kRoi, 0.4, options, 1, 2, 1);
  const RegionOfInterest all{0, 0, 200, 200};
  // The kernel sums to 1 and the disc stays 10 px from the edge, beyond its 8 px; float rounding.
  EXPECT_NEAR(mean_in(blurred, all) / 4000.0, mean_in(primary, all), 1e-6);
  EXPECT_NE(blurred.at(100, 12), primary.at(100, 12) * 4000.0f);
}

TEST(DetectorOptions, ReportsEveryBrokenConstraint) {
  EXPECT_TRUE(problems(DetectorOptions{}).empty());
  DetectorOptions bad;
  bad.scatter_to_primary_ratio = -0.1;
  bad.photons_per_pixel = std::nan("");
  bad.blur_sigma_px = 51.0;
  bad.bits = 7;
  bad.open_beam_level = 0.0;
  EXPECT_THAT(problems(bad),
              ::testing::ElementsAre(::testing::HasSubstr("scatter_to_primary = -0.1"),
                                     ::testing::HasSubstr("photons_per_pixel = nan"),
                                     ::testing::HasSubstr("blur_sigma_px = 51"),
                                     ::testing::HasSubstr("bits = 7"),
                                     ::testing::HasSubstr("open_beam_level = 0")));
}

TEST(ForEachRow, VisitsEveryRowOnceOnAnyNumberOfThreads) {
  for (const int threads : {0, 1, 3, 50}) {
    std::vector<int> visits(37, 0);
    for_each_row(37, threads, [&](int row) { ++visits[static_cast<std::size_t>(row)]; });
    EXPECT_THAT(visits, ::testing::Each(1)) << threads << " threads";
  }
}

TEST(ForEachRow, PassesOnAnExceptionOfAnyThread) {
  EXPECT_THROW(for_each_row(100,
                            4,
                            [](int row) {
                              if (row == 63) throw std::runtime_error("row 63");
                            }),
               std::runtime_error);
}

TEST(ForEachRow, ReportsCompletion) {
  double last = -1.0;
  for_each_row(
      10,
      2,
      [](int) {},
      [&](double done, double total) {
        EXPECT_EQ(total, 10.0);
        EXPECT_GE(done, last);
        last = done;
      });
  EXPECT_EQ(last, 10.0);
}

}  // namespace
}  // namespace af
