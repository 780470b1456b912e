// SPDX-License-Identifier: Apache-2.0
// What all measures must do, and what each ignores.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "base/vector_width.h"
#include "register/similarity/pixel_sums.h"
#include "register/similarity/similarity_measure.h"

namespace af::registration {
namespace {

constexpr int kWidth = 37;
constexpr int kHeight = 29;

/// A smooth scene of blobs, moved by (dx, dy) pixels.
Image2d blobs(double dx = 0.0, double dy = 0.0) {
  Image2d image(kWidth, kHeight);
  HashRandom random(5);
  for (int blob = 0; blob < 14; ++blob) {
    const double x = random.uniform(0.0, kWidth) + dx;
    const double y = random.uniform(0.0, kHeight) + dy;
    const double width = random.uniform(2.0, 5.0);
    const double height = random.uniform(0.3, 1.5);
    for (int row = 0; row < kHeight; ++row)
      for (int column = 0; column < kWidth; ++column)
        image.at(column, row) += static_cast<float>(
            height *
            std::exp(-0.5 * (std::pow(column - x, 2) + std::pow(row - y, 2)) / (width * width)));
  }
  return image;
}

std::vector<float> mapped(const Image2d& image, float gain, float offset) {
  std::vector<float> values = image.pixels;
  for (float& value : values) value = gain * value + offset;
  return values;
}

SimilarityReference reference_of(const Image2d& xray) {
  const auto [low, high] = std::minmax_element(xray.pixels.begin(), xray.pixels.end());
  return {xray, {}, {static_cast<double>(*low) - 0.5, static_cast<double>(*high) + 0.5}};
}

SimilarityOptions options_of(const std::string& name, bool smooth = false) {
  SimilarityOptions options;
  options.name = name;
  options.bins = 24;
  options.has_smooth_histogram = smooth;
  return options;
}

double similarity(const std::string& name,
                  const SimilarityReference& reference,
                  const std::vector<float>& drr) {
  const auto measure = make_similarity(options_of(name), reference);
  return measure->evaluate(drr, *measure->make_workspace());
}

class EveryMeasure : public testing::TestWithParam<std::string> {};

TEST_P(EveryMeasure, PrefersTheSameImageToAMovedOne) {
  const SimilarityReference reference = reference_of(blobs());
  double before = similarity(GetParam(), reference, blobs().pixels);
  for (const double move : {1.0, 3.0}) {
    const double moved = similarity(GetParam(), reference, blobs(move, -move).pixels);
    EXPECT_LT(moved, before) << move;
    before = moved;
  }
}

TEST_P(EveryMeasure, IgnoresPixelsOutsideTheMask) {
  SimilarityReference reference = reference_of(blobs());
  reference.used.assign(reference.xray.pixels.size(), 1);
  for (std::size_t i = 0; i < reference.used.size(); ++i)
    if (i % kWidth >= 25) reference.used[i] = 0;
  Image2d drr = blobs(0.7, 0.4);
  const double expected = similarity(GetParam(), reference, drr.pixels);
  for (std::size_t i = 0; i < reference.used.size(); ++i)
    if (reference.used[i] == 0) {
      reference.xray.pixels[i] = std::numeric_limits<float>::quiet_NaN();
      drr.pixels[i] = 9.0f;
    }
  EXPECT_EQ(similarity(GetParam(), reference, drr.pixels), expected);
}

TEST_P(EveryMeasure, GivesTheSameBitsOnEveryVectorWidth) {
  const SimilarityReference reference = reference_of(blobs());
  const std::vector<float> drr = blobs(0.7, 0.4).pixels;
  const double expected = similarity(GetParam(), reference, drr);
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    EXPECT_EQ(similarity(GetParam(), reference, drr), expected) << to_string(width);
  }
  force_vector_width(std::nullopt);
}

/// The measure as the interface `Measure`; nullptr when it does not implement that.
template <typename Measure>
std::shared_ptr<const Measure> made_as(const SimilarityOptions& options,
                                       const SimilarityReference& reference) {
  return std::dynamic_pointer_cast<const Measure>(
      std::shared_ptr<const SimilarityMeasure>(make_similarity(options, reference)));
}

/// Images by which a DRR might change with six parameters.
std::vector<float> planes_of_six() {
  std::vector<float> planes;
  HashRandom random(12);
  for (int k = 0; k < 6; ++k) {
    const Image2d plane = blobs(random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0));
    planes.insert(planes.end(), plane.pixels.begin(), plane.pixels.end());
  }
  return planes;
}

TEST(SimilarityMeasures, NormalEquationsHaveTheSameBitsOnEveryVectorWidth) {
  const std::vector<float> drr = blobs(0.7, 0.4).pixels;
  const std::vector<float> planes = planes_of_six();
  int measures = 0;
  for (const std::string& name : similarity_names()) {
    const auto measure = made_as<LeastSquaresMeasure>(options_of(name), reference_of(blobs()));
    if (!measure) continue;
    ++measures;
    const auto workspace = measure->make_workspace();
    const NormalEquations expected = measure->normal_equations(drr, planes, *workspace);
    for (const VectorWidth width : supported_vector_widths()) {
      force_vector_width(width);
      const NormalEquations found = measure->normal_equations(drr, planes, *workspace);
      EXPECT_EQ(found.value, expected.value) << name << ' ' << to_string(width);
      EXPECT_EQ(found.gradient, expected.gradient) << name << ' ' << to_string(width);
      EXPECT_EQ(found.matrix, expected.matrix) << name << ' ' << to_string(width);
      EXPECT_EQ(found.reweighting, expected.reweighting) << name << ' ' << to_string(width);
    }
    force_vector_width(std::nullopt);
  }
  EXPECT_GT(measures, 1);
}

TEST_P(EveryMeasure, HasTheDerivativeOfItsValueByEveryPixel) {
  const auto measure =
      made_as<DifferentiableMeasure>(options_of(GetParam(), true), reference_of(blobs()));
  ASSERT_EQ(measure != nullptr, known_measure(GetParam()).is_differentiable);
  if (!measure) return;
  const auto workspace = measure->make_workspace();
  std::vector<float> drr = mapped(blobs(0.7, 0.4), 0.8f, 0.1f);
  std::vector<float> derivative(drr.size());
  // Sums over some 1e3 pixels in single precision.
  constexpr double kRounding = 1e-5;
  EXPECT_NEAR(measure->evaluate_with_derivative(drr, derivative, *workspace),
              measure->evaluate(drr, *workspace),
              kRounding);
  // Random directions change many pixels at once, so that single-precision rounding stays small
  // beside the difference.
  HashRandom random(11);
  for (int trial = 0; trial < 5; ++trial) {
    std::vector<float> direction(drr.size());
    double expected = 0.0;
    double scale = 0.0;
    for (std::size_t i = 0; i < drr.size(); ++i) {
      direction[i] = static_cast<float>(random.normal());
      expected += static_cast<double>(direction[i]) * static_cast<double>(derivative[i]);
      scale += std::abs(static_cast<double>(derivative[i]));
    }
    const float step = 2e-3f;
    std::vector<float> up = drr;
    std::vector<float> down = drr;
    for (std::size_t i = 0; i < drr.size(); ++i) {
      up[i] += step * direction[i];
      down[i] -= step * direction[i];
    }
    const double difference =
        (measure->evaluate(up, *workspace) - measure->evaluate(down, *workspace)) /
        (2.0 * static_cast<double>(step));
    // Two errors remain: third derivatives over the step, and the robust gain's few steps, which do
    // not quite converge.
    constexpr double kShare = 0.01;
    EXPECT_NEAR(expected, difference, kShare * scale + 1e-3 * std::abs(difference));
  }
}

TEST_P(EveryMeasure, NormalEquationsAgreeWithValueAndDerivative) {
  const auto measure = made_as<LeastSquaresMeasure>(options_of(GetParam()), reference_of(blobs()));
  ASSERT_EQ(measure != nullptr, known_measure(GetParam()).is_least_squares);
  if (!measure) return;
  const auto workspace = measure->make_workspace();
  const std::vector<float> drr = mapped(blobs(0.7, 0.4), 0.8f, 0.1f);
  const std::vector<float> planes = planes_of_six();
  const NormalEquations equations = measure->normal_equations(drr, planes, *workspace);
  constexpr double kRounding = 1e-5;
  EXPECT_NEAR(equations.value, measure->evaluate(drr, *workspace), kRounding);
  for (int k = 0; k < 6; ++k) {
    const float step = 2e-3f;
    std::vector<float> up = drr;
    std::vector<float> down = drr;
    for (std::size_t i = 0; i < drr.size(); ++i) {
      const float change = step * planes[static_cast<std::size_t>(k) * drr.size() + i];
      up[i] += change;
      down[i] -= change;
    }
    const double slope = (measure->evaluate(up, *workspace) - measure->evaluate(down, *workspace)) /
                         (2.0 * static_cast<double>(step));
    // As above: differences and the robust gain.
    constexpr double kShare = 0.01;
    EXPECT_NEAR(equations.gradient[k], slope, kShare * equations.gradient.cwiseAbs().maxCoeff());
  }
  const PoseMatrix& matrix = equations.matrix;
  EXPECT_LT((matrix - matrix.transpose()).norm(), 1e-9 * matrix.norm());
  const PoseVector diagonal = matrix.diagonal();
  EXPECT_GT(diagonal.minCoeff(), 0.0);
}

INSTANTIATE_TEST_SUITE_P(All,
                         EveryMeasure,
                         testing::ValuesIn(similarity_names()),
                         [](const auto& chosen) { return chosen.param; });

/// Gains of single-precision images round each pixel by 6e-8 of its value.
constexpr double kSimilarityRounding = 1e-5;

TEST(SimilarityMeasures, GainAndOffsetDoNotCountWhereTheyAreEliminated) {
  const SimilarityReference reference = reference_of(blobs());
  const Image2d moved = blobs(0.7, 0.4);
  for (const char* name : {"ncc", "tncc", "gc", "gd", "rg", "pi", "entropy", "go"})
    EXPECT_NEAR(
        similarity(name, reference, mapped(moved, 1.7f, 0.4f)),
        similarity(name, reference, moved.pixels),
        // A few pixels on a border of a histogram's bin or at a median may change sides.
        std::string(name) == "entropy" || std::string(name) == "go" ? 0.02 : kSimilarityRounding)
        << name;
}

TEST(SimilarityMeasures, ScaledXraysReachTheBestValue) {
  const SimilarityReference reference = reference_of(blobs());
  const std::vector<float> scaled = mapped(blobs(), 1.7f, 0.4f);
  for (const char* name : {"ncc", "tncc", "gc", "gd", "rg", "pi"})
    EXPECT_NEAR(similarity(name, reference, scaled), 1.0, kSimilarityRounding) << name;
  EXPECT_NEAR(similarity("entropy", reference, scaled), 0.0, kSimilarityRounding);
}

TEST(SimilarityMeasures, NothingToCompareIsWorthNothing) {
  const SimilarityReference reference = reference_of(blobs());
  const std::vector<float> flat(reference.xray.pixels.size(), 0.7f);
  for (const char* name : {"mi", "ncc", "tncc", "gc", "rg", "go"})
    EXPECT_NEAR(similarity(name, reference, flat), 0.0, kSimilarityRounding) << name;
  EXPECT_NEAR(similarity("nmi", reference, flat), 1.0, kSimilarityRounding);
}

/// Along planes with zero slope, which change the DRR linearly, the difference of both matrices is
/// made of the second derivatives of the value, with the gain eliminated.
TEST(RobustGradient, CurvesLessThanItsNormalEquationsByTheReweighting) {
  Image2d xray = blobs();
  HashRandom random(8);
  for (float& pixel : xray.pixels) pixel += static_cast<float>(random.uniform(-0.1, 0.1));
  const auto measure = made_as<LeastSquaresMeasure>(options_of("rg"), reference_of(xray));
  const auto workspace = measure->make_workspace();
  const std::vector<float> drr = blobs().pixels;
  const std::size_t pixels = drr.size();
  std::vector<float> planes;
  for (int k = 0; k < 6; ++k) {
    const Image2d plane = blobs(random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0));
    planes.insert(planes.end(), plane.pixels.begin(), plane.pixels.end());
  }
  const PoseVector slopes = measure->normal_equations(drr, planes, *workspace).gradient;
  for (std::size_t k = 1; k < 6; ++k) {
    const auto share = static_cast<float>(slopes[static_cast<int>(k)] / slopes[0]);
    for (std::size_t i = 0; i < pixels; ++i) planes[k * pixels + i] -= share * planes[i];
  }
  const NormalEquations equations = measure->normal_equations(drr, planes, *workspace);
  const auto slopes_at = [&](std::size_t k, float step) {
    std::vector<float> moved = drr;
    for (std::size_t i = 0; i < pixels; ++i) moved[i] += step * planes[k * pixels + i];
    return measure->normal_equations(moved, planes, *workspace).gradient;
  };
  constexpr float kStep = 2e-3f;
  for (std::size_t k = 1; k < 6; ++k) {
    const auto column = static_cast<int>(k);
    const PoseVector fall =
        (slopes_at(k, -kStep) - slopes_at(k, kStep)) / (2.0 * static_cast<double>(kStep));
    const PoseVector plain = equations.matrix.col(column);
    const PoseVector expected = plain - equations.reweighting.col(column);
    // The gain's few steps do not quite converge, as above.
    EXPECT_LT((fall - expected).tail<5>().norm(), 0.01 * plain.tail<5>().norm()) << k;
    EXPECT_GT((fall - plain).tail<5>().norm(), 0.1 * plain.tail<5>().norm()) << k;
  }
}

/// Outputs come uninitialised, or with an earlier DRR's values.
TEST(Sobel, WritesEveryPixelWithABorderOfZeros) {
  Image2d ramp(kWidth, kHeight);
  for (int row = 0; row < kHeight; ++row)
    for (int column = 0; column < kWidth; ++column)
      ramp.at(column, row) = static_cast<float>(3 * column - 2 * row);
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    std::vector<float> along_columns(ramp.pixels.size(), 1e9f);
    std::vector<float> along_rows = along_columns;
    pixel_sum_kernels().sobel(
        ramp.pixels.data(), kWidth, kHeight, along_columns.data(), along_rows.data());
    std::size_t i = 0;
    for (int row = 0; row < kHeight; ++row)
      for (int column = 0; column < kWidth; ++column, ++i) {
        const bool is_inside = row > 0 && column > 0 && row + 1 < kHeight && column + 1 < kWidth;
        // The weights' sum over a step of two pixels, divided by 8.
        EXPECT_EQ(along_columns[i], is_inside ? 3.0f : 0.0f) << column << ", " << row;
        EXPECT_EQ(along_rows[i], is_inside ? -2.0f : 0.0f) << column << ", " << row;
      }
  }
  force_vector_width(std::nullopt);
}

/// Gradients of a ramp are constant but for rounding, which must not be taken for structure.
TEST(GradientCorrelation, OfARampIsNothingByBothWays) {
  const auto measure = made_as<LeastSquaresMeasure>(options_of("gc"), reference_of(blobs()));
  const auto workspace = measure->make_workspace();
  Image2d ramp(kWidth, kHeight);
  for (int row = 0; row < kHeight; ++row)
    for (int column = 0; column < kWidth; ++column)
      ramp.at(column, row) =
          0.1f * static_cast<float>(column) + 0.07f * static_cast<float>(row) + 3.3f;
  std::vector<float> planes;
  for (int k = 0; k < 6; ++k) {
    const Image2d plane = blobs(0.5 * k, 0.3 * k);
    planes.insert(planes.end(), plane.pixels.begin(), plane.pixels.end());
  }
  EXPECT_EQ(measure->evaluate(ramp.pixels, *workspace), 0.0);
  const NormalEquations equations = measure->normal_equations(ramp.pixels, planes, *workspace);
  EXPECT_EQ(equations.value, 0.0);
  EXPECT_EQ(equations.gradient.norm(), 0.0);
}

TEST(SimilarityReference, OfAnEmptyDrrIsRefusedByName) {
  SimilarityReference reference = reference_of(blobs());
  reference.drr_range = {0.0, 0.0};
  EXPECT_EQ(problems(reference),
            std::vector<std::string>{"the region of interest of the DRR at the nominal pose is "
                                     "empty (0 to 0): the CT must project into it"});
}

TEST(NormalizedMutualInformation, IsTwoForAnImageWithItself) {
  // The same bins for both: the DRR's range is the X-ray's.
  SimilarityReference reference = reference_of(blobs());
  reference.drr_range.low += 0.5;
  reference.drr_range.high -= 0.5;
  EXPECT_NEAR(similarity("nmi", reference, blobs().pixels), 2.0, 1e-9);
}

TEST(SumOfSquaredDifferences, OfAShiftedImageIsMinusTheSquaredShift) {
  const SimilarityReference reference = reference_of(blobs());
  EXPECT_NEAR(
      similarity("ssd", reference, mapped(blobs(), 1.0f, 0.25f)), -0.0625, kSimilarityRounding);
}

TEST(GradientCorrelation, HardlyNoticesASlowRamp) {
  // Heel effect: a ramp over the whole width changes each derivative by a constant, which centring
  // takes out again.
  const SimilarityReference plain = reference_of(blobs());
  Image2d ramped = blobs();
  for (int row = 0; row < kHeight; ++row)
    for (int column = 0; column < kWidth; ++column)
      ramped.at(column, row) += 0.05f * static_cast<float>(column);
  const std::vector<float> drr = blobs(0.7, 0.4).pixels;
  EXPECT_NEAR(similarity("gc", reference_of(ramped), drr),
              similarity("gc", plain, drr),
              kSimilarityRounding);
}

TEST(TiledCorrelation, IgnoresAnOffsetAndAGainOfItsOwnInEveryTile) {
  const SimilarityReference reference = reference_of(blobs());
  Image2d drr = blobs(0.7, 0.4);
  const double expected = similarity("tncc", reference, drr.pixels);
  for (int row = 0; row < kHeight; ++row)
    for (int column = 0; column < kWidth; ++column) {
      const int tile = column * 4 / kWidth;  // tiles begin at floor(i width / 4)
      const int in_tile = column >= (tile + 1) * kWidth / 4 ? tile + 1 : tile;
      drr.at(column, row) = (1.0f + 0.3f * static_cast<float>(in_tile)) * drr.at(column, row) +
                            0.2f * static_cast<float>(in_tile);
    }
  EXPECT_NEAR(similarity("tncc", reference, drr.pixels), expected, kSimilarityRounding);
}

TEST(RobustGradient, OccludersCostABoundedPrice) {
  Image2d occluded = blobs();
  for (int row = 0; row < kHeight; ++row)
    for (int column = 12; column < 15; ++column) occluded.at(column, row) += 8.0f;
  const SimilarityReference reference = reference_of(occluded);
  const double rg_loss = similarity("rg", reference_of(blobs()), blobs().pixels) -
                         similarity("rg", reference, blobs().pixels);
  const double gc_loss = similarity("gc", reference_of(blobs()), blobs().pixels) -
                         similarity("gc", reference, blobs().pixels);
  EXPECT_LT(rg_loss, 0.6 * gc_loss);
  // It is still best where it was.
  EXPECT_GT(similarity("rg", reference, blobs().pixels),
            similarity("rg", reference, blobs(0.5, 0.0).pixels));
}

}  // namespace
}  // namespace af::registration
