// SPDX-License-Identifier: Apache-2.0
#include "evaluate/starts/perturbed_starts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "geometry/target_box.h"
#include "geometry/tre.h"
#include "support/start_frame.h"

namespace af::evaluation {
namespace {

bool anything(const RigidTransform&) {
  return true;
}

StratifiedStarts draw(const StartFrame& frame, const StartOptions& options) {
  const auto points = target_points(frame.target_box_ct);
  StartMeasures measures(frame, options, points, anything);
  return stratified_starts(measures);
}

TEST(PerturbedStarts, FillEveryIntervalWithExactlyTheStatedCount) {
  const StartFrame frame = test::example_start_frame();
  StartOptions options;
  options.starts_per_interval = 7;
  const StratifiedStarts result = draw(frame, options);
  ASSERT_EQ(result.starts.size(), 56u);
  std::map<int, int> per_interval;
  std::set<std::uint64_t> draws;
  for (const PerturbedStart& start : result.starts) {
    EXPECT_GE(start.initial_tre_mm, 2.0 * start.interval);
    EXPECT_LT(start.initial_tre_mm, 2.0 * (start.interval + 1));
    // The stored TRE is that of the stored pose.
    EXPECT_EQ(start.initial_tre_mm,
              mean_tre_mm(
                  start.room_from_ct, frame.gold_room_from_ct, target_points(frame.target_box_ct)));
    EXPECT_LT(start.draw_index, result.draws);
    ++per_interval[start.interval];
    draws.insert(start.draw_index);
  }
  for (int interval = 0; interval < 8; ++interval) EXPECT_EQ(per_interval[interval], 7);
  EXPECT_EQ(draws.size(), 56u) << "a draw was used twice";
}

TEST(PerturbedStarts, AreTheContractsFormulaRelativeToGold) {
  const StartFrame frame = test::example_start_frame();
  StartOptions options;
  options.starts_per_interval = 1;
  const Eigen::Vector3d gold_center = frame.gold_room_from_ct * frame.center_ct_mm;
  const Eigen::Vector3d point(3, -4, 5);
  for (const PerturbedStart& start : draw(frame, options).starts) {
    // x_room = r_g + t + Rz Ry Rx R_g (x - c_roi)
    const Eigen::Vector3d expected = gold_center + start.parameters.translation_mm +
                                     rotation_from_angles(start.parameters.rotation_rad) *
                                         frame.gold_room_from_ct.linear() *
                                         (point - frame.center_ct_mm);
    constexpr double kStartRoundingMm = 1e-10;
    EXPECT_LT((start.room_from_ct * point - expected).norm(), kStartRoundingMm);
  }
}

TEST(PerturbedStarts, ADrawDependsOnSeedCaseAndIndexAlone) {
  StartFrame frame = test::example_start_frame();
  const auto at = [&](std::uint64_t seed, std::uint64_t index) {
    return draw_perturbation(frame, 24.0, seed, index).deg_and_mm();
  };
  const auto fifth = at(1, 5);
  std::ignore = at(1, 4);
  EXPECT_EQ(at(1, 5), fifth);
  EXPECT_NE(at(2, 5), fifth);
  EXPECT_NE(at(1, 6), fifth);
  frame.case_name = "skull-02";
  EXPECT_NE(at(1, 5), fifth);
}

TEST(PerturbedStarts, DrawsPointEverywhereAlike) {
  // Each of the six scaled components of a uniform direction has mean 0 and mean square 1/6.
  const StartFrame frame = test::example_start_frame();
  const double radius_mm = rms_radius_mm(frame.target_box_ct, frame.center_ct_mm);
  constexpr int kDraws = 20000;
  Eigen::Matrix<double, 6, 1> mean = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 1> mean_square = mean;
  double mean_magnitude = 0.0;
  for (std::uint64_t i = 0; i < kDraws; ++i) {
    const PoseParameters draw = draw_perturbation(frame, 24.0, 3, i);
    Eigen::Matrix<double, 6, 1> scaled;
    scaled << draw.rotation_rad * radius_mm, draw.translation_mm;
    mean_magnitude += scaled.norm() / kDraws;
    EXPECT_LT(scaled.norm(), 24.0 * (1 + 1e-12));
    scaled.normalize();
    mean += scaled / kDraws;
    mean_square += scaled.cwiseProduct(scaled) / kDraws;
  }
  // Five standard errors: of a component sqrt(1/6/n) = 0.0029, of its square 0.0013 (variance
  // 3/48 - 1/36), of the magnitude 24 / sqrt(12 n) = 0.049.
  EXPECT_LT(mean.cwiseAbs().maxCoeff(), 5 * 0.0029);
  EXPECT_LT((mean_square.array() - 1.0 / 6).abs().maxCoeff(), 5 * 0.0014);
  EXPECT_NEAR(mean_magnitude, 12.0, 5 * 0.049);
}

TEST(PerturbedStarts, ASmallerStudyIsTheLowRankedPartOfTheSameDraws) {
  // Ranks within every interval are 0 ... n - 1, each once.
  StartOptions options;
  options.starts_per_interval = 12;
  std::map<int, std::set<int>> ranks;
  for (const PerturbedStart& start : draw(test::example_start_frame(), options).starts)
    ranks[start.interval].insert(start.rank_in_interval);
  for (const auto& [interval, found] : ranks) {
    EXPECT_EQ(found.size(), 12u) << interval;
    EXPECT_EQ(*found.rbegin(), 11) << interval;
  }
}

TEST(PerturbedStarts, CountDrawsThatThePredicateRefuses) {
  const StartFrame frame = test::example_start_frame();
  StartOptions options;
  options.starts_per_interval = 5;
  const auto limited = [&](const RigidTransform& pose) {
    return parameters_from_pose(frame.pose_frame(), pose).rotation_rad.cwiseAbs().maxCoeff() <
           6.0 * kRadPerDeg;
  };
  const auto points = target_points(frame.target_box_ct);
  StartMeasures measures(frame, options, points, limited);
  const StratifiedStarts result = stratified_starts(measures);
  // The same draws, one by one.
  std::uint64_t refused = 0;
  std::uint64_t beyond = 0;
  for (std::uint64_t index = 0; index < result.draws; ++index) {
    const RigidTransform pose =
        pose_from_parameters(frame.pose_frame(), measures.stratified_draw(index));
    const bool is_beyond = mean_tre_mm(pose, frame.gold_room_from_ct, points) >= 16.0;
    if (is_beyond)
      ++beyond;
    else if (!limited(pose))
      ++refused;
  }
  EXPECT_EQ(result.draws_beyond, beyond);
  EXPECT_EQ(result.starts.size(), 40u);
  EXPECT_EQ(result.inadmissible_draws, refused);
  EXPECT_GT(refused, 0u);
  ASSERT_EQ(result.inadmissible_per_interval.size(), 8u);
  EXPECT_EQ(std::accumulate(result.inadmissible_per_interval.begin(),
                            result.inadmissible_per_interval.end(),
                            std::uint64_t{0}),
            refused);
  // 6 degrees are 3 mm at the box's RMS radius: close starts are never refused.
  EXPECT_EQ(result.inadmissible_per_interval[0], 0u);
  EXPECT_GT(result.inadmissible_per_interval[7], 0u);
  for (const PerturbedStart& start : result.starts) EXPECT_TRUE(limited(start.room_from_ct));
  // Every draw counts in its interval, except those beyond the last.
  ASSERT_EQ(result.draws_per_interval.size(), 8u);
  EXPECT_EQ(
      std::accumulate(
          result.draws_per_interval.begin(), result.draws_per_interval.end(), std::uint64_t{0}),
      result.draws - beyond);
  for (std::size_t k = 0; k < 8; ++k)
    EXPECT_GE(result.draws_per_interval[k], result.inadmissible_per_interval[k] + 5) << k;
}

TEST(RotationShare, OfHandComputedStarts) {
  PoseParameters parameters;
  EXPECT_TRUE(std::isnan(rotation_share(parameters, 50.0)));
  parameters.translation_mm = {0, 3, 4};
  EXPECT_EQ(rotation_share(parameters, 50.0), 0.0);
  parameters.rotation_rad = {0.1, 0, 0};  // 5 mm at a radius of 50 mm
  EXPECT_DOUBLE_EQ(rotation_share(parameters, 50.0), 0.5);
  parameters.translation_mm.setZero();
  EXPECT_EQ(rotation_share(parameters, 50.0), 1.0);
}

TEST(RotationShare, IsOneHalfWhereNothingIsRefused) {
  // Three of six components of a uniform direction: Beta(3/2, 3/2), mean 1/2, variance 1/16.
  StartOptions options;
  options.starts_per_interval = 400;
  const StratifiedStarts result = draw(test::example_start_frame(), options);
  ASSERT_EQ(result.rotation_share_per_interval.size(), 8u);
  double mean = 0.0;
  for (const double share : result.rotation_share_per_interval) mean += share / 8.0;
  // A pure rotation moves the box by 0.7 to 0.8 of its magnitude, so draws with much rotation fall
  // into nearer intervals. Where draws go on, this leaves the same share in each interval. The last
  // intervals get theirs, too, since draws reach 1.5 times the end.
  EXPECT_NEAR(mean, 0.5, 5 * 0.25 / std::sqrt(3200.0) + 0.01);
}

TEST(RotationShare, FallsWhereTheRangeRefusesRotations) {
  const StartFrame frame = test::example_start_frame();
  StartOptions options;
  options.starts_per_interval = 40;
  const auto limited = [&](const RigidTransform& pose) {
    return parameters_from_pose(frame.pose_frame(), pose).rotation_rad.cwiseAbs().maxCoeff() <
           3.0 * kRadPerDeg;
  };
  const auto points = target_points(frame.target_box_ct, 20.0);
  StartMeasures measures(frame, options, points, limited);
  const StratifiedStarts result = stratified_starts(measures);
  EXPECT_LT(result.rotation_share_per_interval[7], 0.2);
  EXPECT_GT(result.rotation_share_per_interval[0], 0.4);
  EXPECT_GT(2 * result.inadmissible_per_interval[7], result.draws_per_interval[7]);
}

/// A field's box of 10 deg and 30 mm about a nominal pose that lies beside gold.
StartLimit limit_beside(const StartFrame& frame) {
  PoseParameters offset;
  offset.rotation_rad = Eigen::Vector3d(2, -3, 1) * kRadPerDeg;
  offset.translation_mm = {4, -6, 5};
  return {PoseFrame::about(pose_from_parameters(frame.pose_frame(), offset),
                           frame.center_ct_mm + Eigen::Vector3d(10, 0, -5)),
          {10.0 * kRadPerDeg, 30.0}};
}

TEST(PerturbedStarts, WithinRangeLieInsideByDesign) {
  const StartFrame frame = test::example_start_frame();
  const StartLimit limit = limit_beside(frame);
  StartOptions options;
  options.starts_per_interval = 20;
  const auto points = target_points(frame.target_box_ct, 20.0);
  std::uint64_t outside = 0;
  const auto contains = [&](const RigidTransform& pose) {
    const bool is_inside = limit.range.contains(parameters_from_pose(limit.frame, pose));
    outside += is_inside ? 0 : 1;
    return is_inside;
  };
  StartMeasures measures(frame, options, points, contains, limit);
  const StratifiedStarts result = starts_within_range(measures);
  EXPECT_EQ(outside, 0u) << "a start was drawn outside the range";
  ASSERT_EQ(result.starts.size(), 160u);
  std::map<int, int> per_interval;
  for (const PerturbedStart& start : result.starts) {
    ++per_interval[start.interval];
    EXPECT_NEAR(start.initial_tre_mm,
                mean_tre_mm(start.room_from_ct, frame.gold_room_from_ct, points),
                1e-9);
    EXPECT_EQ(start.interval, static_cast<int>(start.initial_tre_mm / 2.0));
    constexpr double kSumRoundingMm = 1e-9;
    EXPECT_LT(
        mean_tre_mm(
            start.room_from_ct, pose_from_parameters(frame.pose_frame(), start.parameters), points),
        kSumRoundingMm);
  }
  for (int interval = 0; interval < 8; ++interval) EXPECT_EQ(per_interval[interval], 20);
  EXPECT_EQ(result.draws, 160u + result.inadmissible_draws);
  // Near gold nothing is scaled down. Far from it rotations are, but no further than the range
  // demands.
  EXPECT_NEAR(result.rotation_share_per_interval[0], 0.5, 5 * 0.25 / std::sqrt(20.0));
  EXPECT_GT(result.rotation_share_per_interval[7], 0.1);
  EXPECT_LT(result.rotation_share_per_interval[7], 0.5);
  // The same seed gives the same starts, another seed gives others.
  EXPECT_EQ(starts_within_range(measures).starts[77].parameters.deg_and_mm(),
            result.starts[77].parameters.deg_and_mm());
  options.seed = 2;
  StartMeasures others(frame, options, points, contains, limit);
  EXPECT_NE(starts_within_range(others).starts[77].parameters.deg_and_mm(),
            result.starts[77].parameters.deg_and_mm());
}

TEST(PerturbedStarts, WithinRangeSayWhatIsImpossible) {
  const StartFrame frame = test::example_start_frame();
  const auto points = target_points(frame.target_box_ct, 30.0);
  const auto refusal = [&](const StartOptions& options, std::optional<StartLimit> limit) {
    StartMeasures measures(frame, options, points, anything, std::move(limit));
    try {
      starts_within_range(measures);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refusal({}, std::nullopt), testing::HasSubstr("needs fields"));
  StartLimit far = limit_beside(frame);
  far.range = {far.range.max_rotation_rad(), 1.0};
  EXPECT_THAT(refusal({}, far), testing::HasSubstr("gold pose itself"));
  // No pose of the box is 200 mm from gold.
  EXPECT_THAT(refusal({100, 2.0, 1, 1}, limit_beside(frame)),
              testing::HasSubstr("none of 1000 directions"));
}

TEST(PerturbedStarts, UniformInTreHaveThatDistribution) {
  const StartFrame frame = test::example_start_frame();
  StartOptions options;
  options.starts_per_interval = 50;
  // A coarse grid: 400 starts, several scalings each.
  const auto points = target_points(frame.target_box_ct, 20.0);
  const auto admissible = [&](const RigidTransform& pose) {
    return parameters_from_pose(frame.pose_frame(), pose).translation_mm.x() < 5.0;
  };
  StartMeasures measures(frame, options, points, admissible);
  const StratifiedStarts result = uniform_starts(measures);
  ASSERT_EQ(result.starts.size(), 400u);
  EXPECT_EQ(result.draws, 400u + result.inadmissible_draws);
  EXPECT_GT(result.inadmissible_draws, 0u);
  double sum = 0.0;
  for (const PerturbedStart& start : result.starts) {
    EXPECT_TRUE(admissible(start.room_from_ct));
    EXPECT_NEAR(start.initial_tre_mm,
                mean_tre_mm(start.room_from_ct, frame.gold_room_from_ct, points),
                1e-12);
    EXPECT_EQ(start.interval, static_cast<int>(start.initial_tre_mm / 2.0));
    sum += start.initial_tre_mm;
  }
  // Uniform on 0 to 16 mm whatever was refused: mean 8, five standard errors of 16 / sqrt(12 n).
  EXPECT_NEAR(sum / 400, 8.0, 5 * 16 / std::sqrt(12.0 * 400));
  // A shorter study is the beginning of a longer one.
  options.starts_per_interval = 5;
  StartMeasures fewer(frame, options, points, admissible);
  EXPECT_EQ(uniform_starts(fewer).starts[39].parameters.deg_and_mm(),
            result.starts[39].parameters.deg_and_mm());
}

TEST(PerturbedStarts, UniformSayWhichTreHasNoAdmissibleStart) {
  const StartFrame frame = test::example_start_frame();
  const auto points = target_points(frame.target_box_ct, 30.0);
  std::uint64_t asked = 0;
  StartMeasures measures(frame, StartOptions{2, 2.0, 3, 1}, points, [&](const RigidTransform&) {
    ++asked;
    return false;
  });
  try {
    uniform_starts(measures);
    FAIL() << "found starts where none is admissible";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("starts"));
    EXPECT_THAT(error.what(), testing::HasSubstr("every one of 1000 draws"));
  }
  EXPECT_EQ(asked, UniformStart::kMostDraws) << "went on after the first";
}

TEST(PerturbedStarts, AreTheSameInManyParts) {
  // More starts than one batch draws; few points, to save time.
  const StartFrame frame = test::example_start_frame();
  const auto points = target_points(frame.target_box_ct, 60.0);
  const StartOptions options{2, 2.0, 35000, 1};
  StartMeasures measures(frame, options, points, anything);
  const StratifiedStarts result = uniform_starts(measures);
  ASSERT_EQ(result.starts.size(), 70000u);
  for (const std::uint64_t index : {65535u, 65536u, 69999u}) {
    const UniformStart expected = measures.draw_uniform({index, 1}).front();
    EXPECT_EQ(result.starts[index].parameters.deg_and_mm(), expected.parameters.deg_and_mm());
    EXPECT_EQ(result.starts[index].initial_tre_mm, expected.initial_tre_mm);
    EXPECT_EQ(result.starts[index].draw_index, index * UniformStart::kMostDraws);
  }
}

TEST(PerturbedStarts, AtGivenPosesKeepThem) {
  const StartFrame frame = test::example_start_frame();
  const auto points = target_points(frame.target_box_ct, 20.0);
  StartMeasures of_drawn(frame, StartOptions{8, 2.0, 1, 1}, points, anything);
  const SharedArray<PerturbedStart> drawn = stratified_starts(of_drawn).starts;
  std::vector<RigidTransform> poses;
  for (const PerturbedStart& start : drawn) poses.push_back(start.room_from_ct);
  StartMeasures measures(frame, StartOptions{4, 2.0, 1, 1}, points, anything);
  const StratifiedStarts result = starts_at(measures, poses);
  ASSERT_EQ(result.starts.size(), 8u);
  EXPECT_EQ(result.draws_beyond, 4u);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(result.starts[i].room_from_ct.matrix(), poses[i].matrix());
    EXPECT_EQ(result.starts[i].initial_tre_mm, drawn[i].initial_tre_mm);
    EXPECT_EQ(result.starts[i].interval, static_cast<int>(i));
  }
}

TEST(PerturbedStarts, SayWhichIntervalsStayEmpty) {
  const StartFrame frame = test::example_start_frame();
  StartOptions options;
  options.starts_per_interval = 1;
  const auto close_only = [&](const RigidTransform& pose) {
    return parameters_from_pose(frame.pose_frame(), pose).translation_mm.norm() < 0.01;
  };
  // A coarse grid: this test draws 100000 times.
  const auto points = target_points(frame.target_box_ct, 30.0);
  StartMeasures measures(frame, options, points, close_only);
  try {
    stratified_starts(measures);
    FAIL() << "filled intervals that cannot be filled";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("starts_per_interval"));
    EXPECT_THAT(error.what(), testing::HasSubstr("outside the motion range"));
  }
}

TEST(StartOptions, NamesEveryBrokenConstraint) {
  StartOptions options;
  options.intervals = 0;
  options.interval_width_mm = std::nan("");
  options.starts_per_interval = -3;
  EXPECT_THAT(problems(options),
              testing::ElementsAre(testing::StartsWith("intervals = 0"),
                                   testing::StartsWith("interval_width_mm = nan"),
                                   testing::StartsWith("starts_per_interval = -3")));
  EXPECT_THAT(problems(StartOptions{}), testing::IsEmpty());
}

}  // namespace
}  // namespace af::evaluation
