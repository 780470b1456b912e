// SPDX-License-Identifier: Apache-2.0
#include "register/search/pose_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/vector_width.h"
#include "geometry/tre.h"
#include "register/search/searched_view.h"
#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

using ::testing::HasSubstr;

/// X-rays of the small case at another pose.
test::SmallCase small_case_at(const PoseParameters& parameters) {
  test::SmallCase small = test::small_case(test::bones_in_a_corner());
  small.gold_room_from_ct = pose_from_parameters(small.problem->frame(), parameters);
  for (RegistrationView& view : small.problem->views)
    view.xray = render_image(
        *view.renderer, small.gold_room_from_ct, View::whole_detector(view.view.camera));
  return small;
}

double distance_mm(const test::SmallCase& small, const RigidTransform& pose) {
  return mean_tre_mm(pose, small.gold_room_from_ct, small.problem->scaling_points_ct);
}

TEST(PoseSearch, FindsAPoseAnywhereInItsRange) {
  HashRandom random(3);
  const MotionRange range(20.0 * kRadPerDeg, 20.0);
  PoseSearchOptions options;
  options.translation_mm = {20.0, 20.0, 20.0};
  for (int i = 0; i < 8; ++i) {
    const test::SmallCase small = small_case_at(random_pose(range, random));
    const PoseSearch search(*small.problem, options);
    const std::vector<PoseMode> modes = search.modes();
    ASSERT_FALSE(modes.empty());
    // Half a step of rotations about each axis moves points of this CT, 30 mm from its middle, by
    // up to 5 mm. Half a step of the lattice adds 2 mm along each axis.
    EXPECT_LT(distance_mm(small, modes.front().room_from_ct), 8.0) << i;
    EXPECT_GT(modes.front().likeness, 0.5) << i;
  }
}

TEST(PoseSearch, FindsAPatientWhoLiesTheOtherWayRound) {
  test::SmallCase small = small_case_at({});
  const RigidTransform turned = RigidTransform(
      Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ()).toRotationMatrix());
  small.gold_room_from_ct =
      pose_from_parameters(small.problem->frame(),
                           PoseParameters::from_deg_and_mm({4, -6, 3, 5, -8, 6})) *
      turned;
  for (RegistrationView& view : small.problem->views)
    view.xray = render_image(
        *view.renderer, small.gold_room_from_ct, View::whole_detector(view.view.camera));
  PoseSearchOptions options;
  options.translation_mm = {20.0, 20.0, 20.0};
  for (const char* orientations : {"flips", "any"}) {
    options.orientations = orientations;
    EXPECT_LT(distance_mm(small, PoseSearch(*small.problem, options).modes().front().room_from_ct),
              10.0)
        << orientations;
  }
  options.orientations = "field";
  EXPECT_GT(distance_mm(small, PoseSearch(*small.problem, options).modes().front().room_from_ct),
            20.0);
}

TEST(PoseSearch, OneViewFindsWhatItShows) {
  test::SmallCase small = small_case_at(PoseParameters::from_deg_and_mm({-12, 7, 15, 14, -9, -11}));
  small.problem->views.resize(1);
  PoseSearchOptions options;
  options.translation_mm = {20.0, 20.0, 20.0};
  const RigidTransform found = PoseSearch(*small.problem, options).modes().front().room_from_ct;
  // AP looks along y.
  const Eigen::Vector3d apart =
      (found * Eigen::Vector3d(10, 5, 10)) - (small.gold_room_from_ct * Eigen::Vector3d(10, 5, 10));
  EXPECT_LT(std::hypot(apart.x(), apart.z()), 8.0);
}

TEST(PoseSearch, FindsAPoseFarAlongABeamThroughASmallRegionAndAMask) {
  // The region lies off the coarse grid, and the sizes of what a view shows change over the range.
  test::SmallCase small = small_case_at(PoseParameters::from_deg_and_mm({5, -4, 6, 6, 28, -7}));
  for (RegistrationView& view : small.problem->views) view.view.roi = {9, 11, 27, 25};
  RegistrationView& masked = small.problem->views[0];
  masked.mask = Image2d(48, 48);
  for (int row = 0; row < 48; ++row)
    for (int column = 0; column < 48; ++column)
      masked.mask.at(column, row) = column < 14 && row < 14 ? 0.0f : 1.0f;
  PoseSearchOptions options;
  options.translation_mm = {15.0, 130.0, 15.0};
  const PoseSearch search(*small.problem, options);
  EXPECT_LT(distance_mm(small, search.modes().front().room_from_ct), 10.0);
}

TEST(PoseSearch, OneViewKnowsWhichWayAlongTheBeamByTheSizeOfWhatItShows) {
  for (const double along_mm : {-150.0, 150.0}) {
    test::SmallCase small =
        small_case_at(PoseParameters::from_deg_and_mm({0, 0, 0, 4, along_mm, -3}));
    small.problem->views.resize(1);
    PoseSearchOptions options;
    options.rotation_deg = {0.0, 0.0, 0.0};
    options.translation_mm = {10.0, 200.0, 10.0};
    const RigidTransform found = PoseSearch(*small.problem, options).modes().front().room_from_ct;
    const double apart_mm = found.translation().y() - small.gold_room_from_ct.translation().y();
    EXPECT_LT(std::abs(apart_mm), 75.0) << along_mm;
  }
}

TEST(PoseSearch, FindsABodyAmongOthersWithinItsSilhouette) {
  // Beside the body lie two others, which its CT does not show.
  test::SmallCase small = small_case_at(PoseParameters::from_deg_and_mm({-8, 6, 11, 9, -7, 12}));
  const std::vector<RegistrationView>& views = small.problem->views;
  for (std::size_t view = 0; view < views.size(); ++view) {
    Image2d& xray = small.problem->views[view].xray;
    for (int row = 0; row < xray.height; ++row)
      for (int column = 0; column < xray.width; ++column) {
        if (column < 9) xray.at(column, row) += 2.0f;
        if (row > 40) xray.at(column, row) += 1.5f;
      }
  }
  PoseSearchOptions options;
  options.translation_mm = {20.0, 20.0, 20.0};
  for (const char* orientations : {"field", "any"}) {
    options.orientations = orientations;
    const PoseSearch search(*small.problem, options, 4.0);
    EXPECT_LT(distance_mm(small, search.modes().front().room_from_ct), 8.0) << orientations;
    const PoseSearch whole(*small.problem, options);
    EXPECT_LT(whole.modes().front().likeness, search.modes().front().likeness - 0.1)
        << "what lies around the body counts";
  }
}

TEST(PoseSearch, AirAroundABoneDoesNotCoarsenItsPixels) {
  const auto small_case_of = [](const CtVolume& ct) {
    test::SmallCase small = test::small_case(ct);
    small.problem->attenuating_points_ct =
        ct_lattice_points(AttenuationVolume(ct, AttenuationModel{}).grid_without_border());
    return small;
  };
  // So few that they are larger than the least.
  constexpr int kAcross = 16;
  const test::SmallCase cropped = small_case_of(test::bones_in_a_corner());
  const test::SmallCase padded = small_case_of(test::in_air(test::bones_in_a_corner(), 20));
  const double pixel_mm = pixel_mm_of(*cropped.problem, kAcross, 4.0);
  EXPECT_GT(pixel_mm, pixel_mm_of(*cropped.problem, 64, 4.0));
  // Doubles hold these grids, multiples of 1.5 mm, exactly.
  EXPECT_EQ(pixel_mm_of(*padded.problem, kAcross, 4.0), pixel_mm);
  padded.problem->attenuating_points_ct.clear();
  EXPECT_GT(pixel_mm_of(*padded.problem, kAcross, 4.0), 2.0 * pixel_mm);
}

TEST(PoseSearch, ModesOfASmallTargetDifferByTheirRotation) {
  const test::SmallCase small = small_case_at({});
  const RigidTransform here = RigidTransform::Identity();
  RigidTransform turned = here;
  turned.rotate(Eigen::AngleAxisd(31.0 * kRadPerDeg, Eigen::Vector3d::UnitY()));
  small.problem->target_points_ct = {{-2, 0, 0}, {2, 0, 0}};
  EXPECT_TRUE(are_apart(*small.problem, here, turned, 20.0));
  turned = here;
  turned.rotate(Eigen::AngleAxisd(29.0 * kRadPerDeg, Eigen::Vector3d::UnitY()));
  EXPECT_FALSE(are_apart(*small.problem, here, turned, 20.0));
  turned.pretranslate(Eigen::Vector3d(0, 20, 0));
  EXPECT_TRUE(are_apart(*small.problem, here, turned, 20.0));
}

TEST(PoseSearch, IsTheSameOnEveryVectorWidthAndNumberOfThreads) {
  const test::SmallCase small =
      small_case_at(PoseParameters::from_deg_and_mm({9, 8, -14, -10, 12, 3}));
  PoseSearchOptions options;
  options.translation_mm = {20.0, 20.0, 20.0};
  for (const double silhouette_mm : {0.0, 4.0}) {
    options.orientations = silhouette_mm > 0.0 ? "any" : "field";
    const std::vector<PoseMode> expected =
        PoseSearch(*small.problem, options, silhouette_mm).modes();
    for (const VectorWidth width : supported_vector_widths()) {
      force_vector_width(width);
      const PoseSearch search(
          *small.problem, options, silhouette_mm, std::make_shared<ThreadPool>(3));
      const std::vector<PoseMode> modes = search.modes();
      ASSERT_EQ(modes.size(), expected.size());
      for (std::size_t i = 0; i < modes.size(); ++i) {
        EXPECT_EQ(modes[i].room_from_ct.matrix(), expected[i].room_from_ct.matrix());
        EXPECT_EQ(modes[i].likeness, expected[i].likeness);
      }
    }
    force_vector_width(std::nullopt);
  }
}

TEST(PoseSearch, ModesAreApartAndInOrder) {
  const test::SmallCase small = small_case_at({});
  PoseSearchOptions options;
  options.translation_mm = {20.0, 20.0, 20.0};
  options.modes = 4;
  const std::vector<PoseMode> modes = PoseSearch(*small.problem, options).modes();
  ASSERT_EQ(modes.size(), 4u);
  for (std::size_t i = 0; i < modes.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) {
      EXPECT_LE(modes[i].likeness, modes[k].likeness);
      EXPECT_TRUE(are_apart(*small.problem, modes[i].room_from_ct, modes[k].room_from_ct, 20.0));
    }
}

/// Where a search says that its range ends, and which options it names: "tx: --search-...".
std::string end_text(const PoseSearch& search, const RigidTransform& pose) {
  const ParameterSet ends = search.ends_at(pose);
  return parameter_names(ends) + ": " + search.options_beyond(ends);
}

TEST(PoseSearch, KnowsWhereItsRangeEnds) {
  // The patient lies 3 mm, less than a coarse pixel, beyond it, and is turned as in an outer cell.
  const test::SmallCase beyond =
      small_case_at(PoseParameters::from_deg_and_mm({0, 0, 17, -23, 4, -3}));
  PoseSearchOptions options;
  options.rotation_deg = {0.0, 0.0, 20.0};
  options.translation_mm = {20.0, 20.0, 20.0};
  const PoseSearch search(*beyond.problem, options);
  EXPECT_EQ(end_text(search, search.modes().front().room_from_ct),
            "rz, tx: --search-rotation-deg 0,0,40 --search-translation-mm 40,20,20");
}

TEST(PoseSearch, NamesAnEndWhereMoreIsPossible) {
  const test::SmallCase small = small_case_at({});
  const auto end_at = [&](const PoseSearchOptions& options, const std::array<double, 6>& values) {
    return end_text(
        PoseSearch(*small.problem, options),
        pose_from_parameters(small.problem->frame(), PoseParameters::from_deg_and_mm(values)));
  };
  PoseSearchOptions options;
  EXPECT_EQ(end_at(options, {5, -5, 5, 36, -36, 0}), ": ");
  EXPECT_EQ(end_at(options, {15, -5, -15, 40, 0, -40}),
            "rx, rz, tx, tz: --search-rotation-deg 40,20,40 --search-translation-mm 80,40,80");
  // Half turned, with 15 degrees about x after that.
  options.orientations = "flips";
  EXPECT_EQ(end_at(options, {-165, 5, 0, 0, 0, 0}), "rx: --search-rotation-deg 40,20,20");
  options.orientations = "any";
  EXPECT_EQ(end_at(options, {120, 5, 0, 0, 40, 0}), "ty: --search-translation-mm 40,80,40");
  // No rotation about z is left, and twice the range has more rotations than all need.
  options.orientations = "field";
  options.rotation_deg = {85.0, 85.0, 180.0};
  EXPECT_EQ(end_at(options, {0, 81, 176, 0, 0, 0}), "ry: --search-orientations any");
  // A range of one or two steps has nothing between its ends.
  options.rotation_deg = {5.0, 10.0, 0.0};
  options.translation_mm = {1.0, 0.0, 40.0};
  EXPECT_EQ(end_at(options, {0, 5, 0, 1, 0, 0}), ": ");
  // AP looks along y.
  small.problem->views.resize(1);
  EXPECT_EQ(end_at({}, {0, 0, 0, 40, 40, 0}), "tx: --search-translation-mm 80,40,40");
}

TEST(PoseSearch, NamesNoOptionsForWhatAFieldDoesNotHold) {
  const test::SmallCase small = small_case_at({});
  small.problem->views[0].reach =
      MotionLimit{small.problem->frame(), MotionRange(10.0 * kRadPerDeg, 20.0)};
  const auto end_at = [&](const PoseSearchOptions& options, double tx_mm) {
    return end_text(PoseSearch(*small.problem, options),
                    pose_from_parameters(small.problem->frame(),
                                         PoseParameters::from_deg_and_mm({0, 0, 0, tx_mm, 0, 0})));
  };
  PoseSearchOptions options;
  EXPECT_EQ(end_at(options, 20.0), "tx: ");
  options.translation_mm = {10.0, 10.0, 10.0};
  EXPECT_EQ(end_at(options, 10.0), "tx: --search-translation-mm 20,10,10");
  options.translation_mm = {11.0, 10.0, 10.0};
  EXPECT_EQ(end_at(options, 11.0), "tx: ");
}

std::string refusal(const RegistrationProblem& problem, const PoseSearchOptions& options) {
  try {
    const PoseSearch search(problem, options);
  } catch (const InputError& error) {
    return error.what();
  }
  return "none";
}

TEST(PoseSearch, RefusesPosesThatAFieldDoesNotHold) {
  const test::SmallCase small = small_case_at({});
  small.problem->views[0].reach =
      MotionLimit{small.problem->frame(), MotionRange(10.0 * kRadPerDeg, 20.0)};
  PoseSearchOptions options;
  EXPECT_EQ(refusal(*small.problem, options), "none");
  options.orientations = "flips";
  EXPECT_THAT(refusal(*small.problem, options), HasSubstr("--renderer raycast"));
  options.orientations = "field";
  options.rotation_deg = {12.0, 5.0, 5.0};
  EXPECT_THAT(refusal(*small.problem, options), HasSubstr("+-10 degrees, +-20 mm"));
  // A field whose nominal pose lies 30 mm aside holds less of the first field's range.
  PoseFrame aside = small.problem->frame();
  aside.center_room_mm.x() += 30.0;
  small.problem->views[1].reach = MotionLimit{aside, MotionRange(10.0 * kRadPerDeg, 20.0)};
  EXPECT_EQ(PoseSearch(*small.problem, {}).range().low.translation_mm.x(), 10.0);
  aside.rotation = rotation_from_angles({0.1, 0.0, 0.0});
  small.problem->views[1].reach = MotionLimit{aside, MotionRange(10.0 * kRadPerDeg, 20.0)};
  EXPECT_THAT(refusal(*small.problem, {}), HasSubstr("nominal poses differ"));
}

TEST(PoseSearch, RefusesAnXrayThatShowsNothing) {
  const test::SmallCase small = small_case_at({});
  std::ranges::fill(small.problem->views[1].xray.pixels, 1.0f);
  EXPECT_THAT(refusal(*small.problem, {}), HasSubstr("view 'LAT'"));
}

TEST(PoseSearch, RefusesTranslationsThatCannotBe) {
  const test::SmallCase small = small_case_at({});
  PoseSearchOptions options;
  options.translation_mm = {0.0, 700.0, 0.0};
  EXPECT_THAT(refusal(*small.problem, options), HasSubstr("must not bring the CT to the source"));
  options.translation_mm = {900.0, 900.0, 900.0};
  EXPECT_THAT(refusal(*small.problem, options), HasSubstr("four million translations"));
  options = {};
  options.rotation_deg = {180.0, 180.0, 180.0};
  EXPECT_THAT(refusal(*small.problem, options), HasSubstr("any needs fewer"));
}

TEST(PoseSearchOptions, NamesEverythingThatIsWrong) {
  PoseSearchOptions options;
  options.rotation_deg = {10.0, -1.0, 181.0};
  options.translation_mm = {10.0, 10.0, 1001.0};
  options.orientations = "upright";
  EXPECT_EQ(problems(options).size(), 4u);
  options = {};
  options.orientations = "any";
  options.rotation_deg = {10.0, 10.0, 10.0};
  EXPECT_EQ(problems(options).size(), 1u);
  EXPECT_EQ(problems_without_search(options, "x").size(), 2u);
  EXPECT_EQ(problems_without_search({}, "x").size(), 0u);
}

}  // namespace
}  // namespace af::registration
