// SPDX-License-Identifier: Apache-2.0
#include "register/method/prepared_stage.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "register/problem/target_region.h"
#include "unit/register/method/registration_cases.h"
#include "xray/gaussian_blur.h"

namespace af::registration {
namespace {

Image2d ramp(int width, int height) {
  Image2d image(width, height);
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column)
      image.at(column, row) = static_cast<float>(column + 100 * row);
  return image;
}

TEST(StageView, OfTheFinestGridIsTheView) {
  const View view{test::small_camera(false), {6, 7, 36, 30}};
  const View stage = stage_view(view, {});
  EXPECT_EQ(stage.roi.column, 6);
  EXPECT_EQ(stage.roi.row, 7);
  EXPECT_EQ(stage.roi.width, 36);
  EXPECT_EQ(stage.roi.height, 30);
  const Image2d xray = ramp(48, 48);
  EXPECT_EQ(stage_reference(xray, {}, view, {}).xray.pixels, crop(xray, view.roi).pixels);
}

TEST(StageView, PixelsPerMmAreThoseOfProjectedLengths) {
  CameraGeometry camera = test::small_camera(false);
  camera.pixel_spacing_mm = {3.0, 5.0};
  const Eigen::Vector3d point(7.0, 20.0, -5.0);
  const auto moved_px = [&](const Eigen::Vector3d& direction) {
    return (camera.project(point + direction) - camera.project(point)).norm();
  };
  const double columns = moved_px(camera.column_direction);
  const double rows = moved_px(camera.row_direction);
  // For spacings a and b this is 2 / (a + b), the harmonic mean of 1 / a and 1 / b.
  EXPECT_NEAR(camera.pixels_per_mm(point), 2.0 / (1.0 / columns + 1.0 / rows), 1e-9);
}

TEST(StageView, ScalesTheRegionAboutItsCentreAndStaysOnTheDetector) {
  const View view{test::small_camera(false), {16, 10, 16, 16}};
  const View twice = stage_view(view, {1, 2.0, 0.0});
  EXPECT_EQ(twice.roi.column, 8);
  EXPECT_EQ(twice.roi.row, 2);
  EXPECT_EQ(twice.roi.width, 32);
  const View huge = stage_view(view, {1, 4.0, 0.0});
  EXPECT_EQ(huge.roi.column, 0);
  EXPECT_EQ(huge.roi.width, 48);
}

TEST(StageView, OfARegionNarrowerThanItsPixelsAtTheEdgeStaysOnTheDetector) {
  const View view{test::small_camera(false), {47, 47, 1, 1}};
  const StageGrid grid{4, 1.0, 0.0};
  EXPECT_EQ(stage_view(view, grid).roi.width, 1);
  EXPECT_EQ(stage_reference(ramp(48, 48), {}, view, grid).xray.pixels.size(), 1u);
  EXPECT_THROW((void)stage_view(view, {49, 1.0, 0.0}), InputError);
}

TEST(StageView, PixelsLieOnTheMeansThatTheReferenceTakes) {
  // A ramp's block mean is its value at the block's centre: where the coarse camera looks.
  const View view{test::small_camera(false), {7, 9, 20, 24}};
  for (const int step : {2, 3, 4}) {
    const StageGrid grid{step, 1.3, 0.0};
    const View stage = stage_view(view, grid);
    const SimilarityReference reference = stage_reference(ramp(48, 48), {}, view, grid);
    ASSERT_EQ(reference.xray.width, stage.roi.width) << step;
    ASSERT_EQ(reference.xray.height, stage.roi.height) << step;
    for (const int column : {0, stage.roi.width - 1})
      for (const int row : {0, stage.roi.height - 1}) {
        const Eigen::Vector2d pixel = view.camera.project(
            stage.camera.detector_point(stage.roi.column + column, stage.roi.row + row));
        EXPECT_NEAR(static_cast<double>(reference.xray.at(column, row)),
                    pixel.x() + 100.0 * pixel.y(),
                    1e-3)  // single precision at 5000
            << step;
      }
  }
}

TEST(StageView, BlursByWhatTheMeansHaveNotBlurredYet) {
  Image2d point(49, 49);
  point.at(24, 24) = 1.0f;
  const View view{test::small_camera(false), {0, 0, 48, 48}};
  const StageGrid grid{3, 1.0, 4.0};
  const Image2d image = stage_reference(point, {}, view, grid).xray;
  double sum = 0.0;
  double mean = 0.0;
  double square = 0.0;
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column) {
      const double weight = static_cast<double>(image.at(column, row));
      const double x = 3.0 * column + 1.0;
      sum += weight;
      mean += weight * x;
      square += weight * x * x;
    }
  const double variance = square / sum - std::pow(mean / sum, 2);
  // The stage asks for 4 px; the kernel is cut at 4 sigma on a coarse grid.
  EXPECT_NEAR(std::sqrt(variance), 4.0, 0.1);
}

TEST(StageView, AStagePixelIsUsedWhenItsWholeBlockIs) {
  const View view{test::small_camera(false), {0, 0, 48, 48}};
  Image2d mask(48, 48);
  std::fill(mask.pixels.begin(), mask.pixels.end(), 255.0f);
  mask.at(5, 2) = 0.0f;
  const SimilarityReference reference = stage_reference(ramp(48, 48), mask, view, {4, 1.0, 0.0});
  ASSERT_EQ(reference.used.size(), 144U);
  for (std::size_t i = 0; i < reference.used.size(); ++i)
    EXPECT_EQ(reference.used[i], i == 1 ? 0 : 1) << i;
}

/// Masked, with markers, and regions that follow the middle of the phantom.
test::SmallCase following_case() {
  test::SmallCase small = test::small_case();
  small.problem->target_box_ct = CtBox{{-20, -20, -20}, {20, 20, 20}};
  for (RegistrationView& view : small.problem->views) {
    view.view.roi = {12, 13, 24, 22};
    view.target_region = view.view.roi;
    view.drr_range = ValueRange{0.0, 5.0};
    view.mask = Image2d(48, 48);
    std::fill(view.mask.pixels.begin(), view.mask.pixels.end(), 1.0f);
    view.mask.at(20, 20) = 0.0f;
    view.mask_without_markers = view.mask;
    view.mask_without_markers.at(25, 15) = 0.0f;
  }
  return small;
}

PreparedStage stage_of(const RegistrationProblem& problem, const std::string& text) {
  return std::move(
      prepared_stages(problem, problem.views, chain_from_text("x", text).stages, nullptr).front());
}

/// Moves what the views see by about 9 pixels to the right and up, and to the left and up.
RigidTransform far_pose() {
  return pose_from_parameters({}, {.translation_mm = {18, -18, 16}});
}

TEST(PreparedStage, SeesWhatAStudyWithItsRegionThereWouldShow) {
  const test::SmallCase small = following_case();
  for (const char* text : {"ncc gauss-newton", "ncc gauss-newton pixels=3 sigma=4"}) {
    PreparedStage stage = stage_of(*small.problem, text);
    EXPECT_FALSE(stage.would_move(*small.problem, small.problem->nominal_room_from_ct));
    for (const RigidTransform& pose : {small.problem->nominal_room_from_ct, far_pose()}) {
      RegistrationProblem there = *small.problem;
      for (RegistrationView& view : there.views) {
        view.view.roi = region_at(*small.problem, view, pose, stage.options.pixel_step);
        view.target_region.reset();
      }
      const ObjectiveValue value = stage.value_at(*small.problem, pose);
      ASSERT_TRUE(value.is_admissible) << text;
      EXPECT_EQ(value.similarity, stage_of(there, text).value_at(there, pose).similarity) << text;
      EXPECT_EQ(stage.regions[0], there.views[0].view.roi) << text;
      EXPECT_EQ(stage.objective.views()[1].view.pixel_count(),
                stage_of(there, text).objective.views()[1].view.pixel_count());
    }
    EXPECT_NE(stage.regions[0], small.problem->views[0].view.roi);
  }
}

TEST(PreparedStage, IsTheSameAgainWhereverItHasBeen) {
  const test::SmallCase small = following_case();
  const char* const text = "gc gauss-newton pixels=2 roi=1.5";
  PreparedStage stage = stage_of(*small.problem, text);
  const RigidTransform edge = pose_from_parameters({}, {.translation_mm = {45, 0, 0}});
  for (const RigidTransform& pose : {far_pose(), small.gold_room_from_ct, edge, far_pose()})
    EXPECT_EQ(stage.value_at(*small.problem, pose).similarity,
              stage_of(*small.problem, text).value_at(*small.problem, pose).similarity);
}

TEST(PreparedStage, StaysWhereTheXrayShowsNothingToCompare) {
  const test::SmallCase small = following_case();
  PreparedStage stage = stage_of(*small.problem, "ncc gauss-newton");
  const auto before = stage.regions;
  std::fill(
      small.problem->views[0].xray.pixels.begin(), small.problem->views[0].xray.pixels.end(), 1.0f);
  EXPECT_FALSE(stage.place_at(*small.problem, far_pose()));
  EXPECT_FALSE(stage.value_at(*small.problem, far_pose()).is_admissible);
  EXPECT_EQ(stage.regions, before);
}

}  // namespace
}  // namespace af::registration
