// SPDX-License-Identifier: Apache-2.0
#include "evaluate/image_quality/drr_comparison.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"

namespace af::evaluation {
namespace {

/// A renderer whose pixels a function of (pose, pixel index) gives.
class FormulaRenderer final : public DrrRenderer {
 public:
  using Formula = std::function<float(const RigidTransform&, std::size_t)>;
  explicit FormulaRenderer(Formula formula, std::int64_t rays_outside = 0)
      : formula_(std::move(formula)), rays_outside_(rays_outside) {}

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& /*view*/,
                      RenderWorkspace& /*workspace*/,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& /*gradients*/) const override {
    for (std::size_t i = 0; i < total_attenuation.size(); ++i)
      total_attenuation[i] = formula_(room_from_ct, i);
    return {rays_outside_};
  }
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override {
    return std::make_unique<RenderWorkspace>();
  }
  [[nodiscard]] const char* name() const override { return "formula"; }

 private:
  Formula formula_;
  std::int64_t rays_outside_;
};

View small_view() {
  View view;
  view.camera.name = "A";
  view.roi = {0, 0, 10, 10};
  return view;
}

TEST(RandomPose, FillsTheMotionBoxUniformly) {
  const MotionRange range{0.2, 50.0};
  constexpr int kDraws = 10000;
  Eigen::Vector3d rotation_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d translation_mean = Eigen::Vector3d::Zero();
  double largest_share = 0.0;
  for (std::uint64_t i = 0; i < kDraws; ++i) {
    const PoseParameters pose = random_pose_in_range(range, 11, i);
    ASSERT_TRUE(range.contains(pose));
    rotation_mean += pose.rotation_rad / 0.2 / kDraws;
    translation_mean += pose.translation_mm / 50.0 / kDraws;
    largest_share = std::max(largest_share, pose.translation_mm.cwiseAbs().maxCoeff() / 50.0);
  }
  constexpr double kFiveStandardErrors = 5 * 0.0058;  // 1 / sqrt(3 n)
  EXPECT_LT(rotation_mean.cwiseAbs().maxCoeff(), kFiveStandardErrors);
  EXPECT_LT(translation_mean.cwiseAbs().maxCoeff(), kFiveStandardErrors);
  EXPECT_GT(largest_share, 0.999);
}

TEST(RandomPose, DependsOnSeedIndexAndAttemptAlone) {
  const MotionRange range;
  const auto pose = random_pose_in_range(range, 1, 2, 3).deg_and_mm();
  EXPECT_EQ(random_pose_in_range(range, 1, 2, 3).deg_and_mm(), pose);
  EXPECT_NE(random_pose_in_range(range, 2, 2, 3).deg_and_mm(), pose);
  EXPECT_NE(random_pose_in_range(range, 1, 3, 3).deg_and_mm(), pose);
  EXPECT_NE(random_pose_in_range(range, 1, 2, 4).deg_and_mm(), pose);
}

TEST(DrrComparer, ReportsHandComputedDifferences) {
  // Half of the pixels are foreground at 10; the tested DRR is 0.1 high on these and 5 off in the
  // background, which does not count: PSNR = 20 log10(10 / 0.1) = 40 dB.
  const FormulaRenderer reference(
      [](const RigidTransform&, std::size_t i) { return i < 50 ? 10.0f : 0.0f; });
  const FormulaRenderer tested(
      [](const RigidTransform&, std::size_t i) { return i < 50 ? 10.1f : 5.0f; });
  DrrComparer comparer(tested, reference, small_view());
  const DrrComparison result = comparer.at_pose(PoseFrame{}, PoseParameters{});
  constexpr double kFloatRounding = 1e-5;  // 10.1f is 4e-7 off, relative to 0.1 that is 4e-6
  EXPECT_NEAR(result.psnr_db, 40.0, 20 * kFloatRounding);
  EXPECT_NEAR(result.mean_difference, 0.1, kFloatRounding);
  EXPECT_NEAR(result.largest_difference, 0.1, kFloatRounding);
  EXPECT_EQ(result.reference_maximum, 10.0);
  EXPECT_EQ(result.foreground_fraction, 0.5);
}

TEST(DrrComparer, DrawsAPoseAgainWhenItHasTooLittleForeground) {
  // Poses with positive tx show nothing.
  const auto formula = [](const RigidTransform& pose, std::size_t i) {
    return pose.translation().x() > 0.0 ? 0.0f : static_cast<float>(i + 1);
  };
  const FormulaRenderer renderer(formula);
  DrrComparer comparer(renderer, renderer, small_view());
  int redrawn = 0;
  for (std::uint64_t i = 0; i < 50; ++i) {
    const DrrComparison result = comparer.at_random_pose(PoseFrame{}, MotionRange{}, 1, i);
    EXPECT_LE(result.parameters.translation_mm.x(), 0.0);
    EXPECT_TRUE(std::isinf(result.psnr_db));
    redrawn += result.redrawn;
  }
  // Every draw fails with probability 1/2: 50 expected, standard deviation 10.
  EXPECT_GT(redrawn, 10);
  EXPECT_LT(redrawn, 100);
}

TEST(DrrComparer, RefusesAViewThatNeverShowsAnything) {
  const FormulaRenderer nothing([](const RigidTransform&, std::size_t) { return 0.0f; });
  DrrComparer comparer(nothing, nothing, small_view());
  EXPECT_THROW(comparer.at_random_pose(PoseFrame{}, MotionRange{}, 1, 0), NumericError);
}

TEST(DrrComparer, ReportsRaysOutsideAndComparesNothing) {
  const auto ones = [](const RigidTransform&, std::size_t) { return 1.0f; };
  const FormulaRenderer reference(ones);
  const FormulaRenderer field(ones, 3);
  DrrComparer comparer(field, reference, small_view());
  const DrrComparison result = comparer.at_pose(PoseFrame{}, PoseParameters{});
  EXPECT_EQ(result.rays_outside, 3);
  EXPECT_TRUE(std::isnan(result.psnr_db));
  EXPECT_THROW(comparer.at_random_pose(PoseFrame{}, MotionRange{}, 1, 0), NumericError);
}

}  // namespace
}  // namespace af::evaluation
