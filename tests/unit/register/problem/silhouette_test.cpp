// SPDX-License-Identifier: Apache-2.0
#include "register/problem/silhouette.h"

#include <numeric>

#include <gtest/gtest.h>

#include "register/method/presets.h"
#include "register/verdict/pose_examiner.h"
#include "register/verdict/registration.h"
#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

int used_pixels(const std::vector<std::uint8_t>& used) {
  return std::accumulate(used.begin(), used.end(), 0);
}

/// 20 x 10 pixels, of which one has a value.
Image2d one_pixel(int column, int row) {
  Image2d image(20, 10);
  image.at(column, row) = 1.0f;
  return image;
}

TEST(Silhouette, IsGrownAndLeavesOutCuts) {
  EXPECT_EQ(used_pixels(silhouette(one_pixel(8, 5), 0.0, {})), 1);
  // Gauss's circle problem: 13 lattice points lie within 2 of the origin, 29 within 3.
  EXPECT_EQ(used_pixels(silhouette(one_pixel(8, 5), 2.0, {})), 13);
  EXPECT_EQ(used_pixels(silhouette(one_pixel(8, 5), 3.0, {})), 29);
  const std::vector<Eigen::Vector2d> cut = {{11.0, 5.0}};
  // Discs of radius 2 about points 3 apart share (9, 5), (10, 5), (9, 4) .. no more than these.
  const int left = used_pixels(silhouette(one_pixel(8, 5), 2.0, cut));
  EXPECT_LT(left, 13);
  EXPECT_GT(left, 6);
}

TEST(Silhouette, IsCutAtTheImagesEdges) {
  // A quarter of the disc: (0,0), (1,0), (0,1), (1,1), (2,0), (0,2).
  EXPECT_EQ(used_pixels(silhouette(one_pixel(0, 0), 2.0, {})), 6);
  const std::vector<Eigen::Vector2d> far = {{1e12, 5.0}, {-1e12, std::nan("")}};
  EXPECT_EQ(used_pixels(silhouette(one_pixel(8, 5), 2.0, far)), 13);
}

TEST(Silhouette, LeavesOutWhatIsNextToNothing) {
  Image2d drr = one_pixel(8, 5);
  drr.at(2, 2) = 0.019f;
  EXPECT_EQ(used_pixels(silhouette(drr, 0.0, {})), 1);
  drr.at(2, 2) = 0.021f;
  EXPECT_EQ(used_pixels(silhouette(drr, 0.0, {})), 2);
  EXPECT_EQ(used_pixels(silhouette(Image2d(20, 10), 3.0, {})), 0);
}

TEST(Silhouette, RegionHoldsAllUsedPixels) {
  const std::vector<std::uint8_t> used = silhouette(one_pixel(8, 5), 2.0, {});
  const RegionOfInterest region = region_of(used, 20, 10, 1);
  EXPECT_EQ(region.column, 5);
  EXPECT_EQ(region.row, 2);
  EXPECT_EQ(region.width, 7);
  EXPECT_EQ(region.height, 7);
  EXPECT_EQ(region_of(std::vector<std::uint8_t>(200, 0), 20, 10, 1).pixel_count(), 0u);
  const RegionOfInterest whole = region_of(std::vector<std::uint8_t>(200, 1), 20, 10, 3);
  EXPECT_EQ(whole.pixel_count(), 200u);
}

/// X-rays of bones in a corner, overlaid by a second body that moves by itself. It has bright edges
/// everywhere but on the bones.
test::SmallCase bones_among_others() {
  test::SmallCase small = test::small_case(test::bones_in_a_corner());
  for (RegistrationView& view : small.problem->views) {
    const Image2d bones = view.xray;
    for (int row = 0; row < bones.height; ++row)
      for (int column = 0; column < bones.width; ++column) {
        const bool is_bar = column % 8 < 2 && bones.at(column, row) == 0.0f;
        view.xray.at(column, row) += 0.02f * static_cast<float>(row) + (is_bar ? 1.0f : 0.0f);
      }
  }
  return small;
}

std::vector<SilhouetteView> silhouette_views(const RegistrationProblem& problem, double margin_px) {
  std::vector<SilhouetteView> views;
  for (const RegistrationView& view : problem.views) {
    SimilarityReference reference;
    reference.xray = crop(view.xray, view.view.roi);
    SimilarityOptions gc;
    gc.name = "gc";
    views.push_back({{view.view, view.renderer, make_similarity(gc, reference), std::nullopt},
                     reference,
                     gc,
                     view.renderer,
                     margin_px});
  }
  return views;
}

TEST(SilhouetteObjective, ComparesOnlyWhatIsNearTheBody) {
  const test::SmallCase small = bones_among_others();
  const auto views = silhouette_views(*small.problem, 0.0);
  auto narrow = silhouette_objective(views, {}, small.gold_room_from_ct, nullptr);
  ASSERT_TRUE(narrow.has_value());
  const double near = narrow->evaluate(small.gold_room_from_ct).similarity;
  std::vector<ObjectiveView> whole_views;
  for (const SilhouetteView& view : views) whole_views.push_back(view.whole);
  MultiViewObjective whole(whole_views);
  // Two views, each at most 1; the ramp is all that differs on the bones.
  EXPECT_GT(near, 1.9);
  EXPECT_LT(whole.evaluate(small.gold_room_from_ct).similarity, 1.0);
  for (std::size_t i = 0; i < views.size(); ++i)
    EXPECT_LT(narrow->views()[i].view.pixel_count(), views[i].whole.view.pixel_count());
}

TEST(SilhouetteObjective, IsNoneWhereTooLittleIsSeen) {
  const test::SmallCase small = bones_among_others();
  const auto views = silhouette_views(*small.problem, 1.0);
  RigidTransform beside = small.gold_room_from_ct;
  beside.pretranslate(Eigen::Vector3d(0.0, 0.0, 300.0));
  EXPECT_FALSE(silhouette_objective(views, {}, beside, nullptr).has_value());
}

TEST(SilhouetteStage, FindsBonesThatTheWholeRegionLoses) {
  const test::SmallCase small = bones_among_others();
  RegistrationOptions options = preset_options("paper");
  StageOptions stage;
  stage.similarity.name = "gc";
  stage.optimizer = "gauss-newton";
  stage.silhouette_mm = 5.0;
  options.chains = {{"bone", {stage, stage, stage}}};
  EXPECT_EQ(options.silhouette_mm(), 5.0);
  const RigidTransform start = pose_from_parameters(
      small.problem->frame(), PoseParameters::from_deg_and_mm({4.0, 1.0, -1.5, 0.0, 1.0, 4.0}));
  const auto distance_mm = [&](const RigidTransform& pose) {
    return (pose.translation() - small.gold_room_from_ct.translation()).norm();
  };
  const RegistrationResult found = Registration(small.problem, options).search(start);
  // The background's edges within the margin bias the end: half a pixel of 2 mm in the room.
  EXPECT_LT(distance_mm(found.room_from_ct), 1.0);
  EXPECT_TRUE(std::isfinite(found.similarity));
  for (StageOptions& whole : options.chains.front().stages) whole.silhouette_mm = 0.0;
  const RegistrationResult lost = Registration(small.problem, options).search(start);
  EXPECT_GT(distance_mm(lost.room_from_ct), distance_mm(found.room_from_ct));
}

TEST(SilhouetteStage, EndsWhereTheBodyIsNotSeen) {
  const test::SmallCase small = bones_among_others();
  RegistrationOptions options = preset_options("paper");
  StageOptions stage;
  stage.similarity.name = "gc";
  stage.optimizer = "gauss-newton";
  stage.silhouette_mm = 5.0;
  // 3 x 3 pixels a view are fewer than an objective needs.
  stage.pixel_step = 12;
  options.chains = {{"bone", {stage}}};
  Registration registration(small.problem, options);
  const RegistrationResult result = registration.search(small.gold_room_from_ct);
  EXPECT_EQ(result.stop_reason, StopReason::CtOutsideRoi);
  EXPECT_FALSE(registration.similarity_at(small.gold_room_from_ct).is_admissible);
  const auto values = PoseExaminer(small.problem, 5.0).view_values(small.gold_room_from_ct);
  for (const ViewValue& value : values) EXPECT_TRUE(value.in_silhouette);
}

}  // namespace
}  // namespace af::registration
