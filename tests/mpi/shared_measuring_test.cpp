// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/shared_measuring.h"

#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "gold_standard/target_box.h"
#include "support/start_frame.h"

namespace af::evaluation {
namespace {

using MakeStarts = std::function<StratifiedStarts(StartMeasures& measures)>;

/// Some draws are refused.
bool is_left(const RigidTransform& pose) {
  return parameters_from_pose(test::example_start_frame().pose_frame(), pose).translation_mm.x() <
         1.0;
}

void expect_same(const StratifiedStarts& a, const StratifiedStarts& b) {
  EXPECT_EQ(a.draws, b.draws);
  EXPECT_EQ(a.inadmissible_draws, b.inadmissible_draws);
  EXPECT_EQ(a.draws_beyond, b.draws_beyond);
  EXPECT_EQ(a.inadmissible_per_interval, b.inadmissible_per_interval);
  ASSERT_EQ(a.starts.size(), b.starts.size());
  for (std::size_t i = 0; i < a.starts.size(); ++i) {
    EXPECT_EQ(a.starts[i].initial_tre_mm, b.starts[i].initial_tre_mm);
    EXPECT_EQ(a.starts[i].interval, b.starts[i].interval);
    EXPECT_EQ(a.starts[i].draw_index, b.starts[i].draw_index);
    EXPECT_EQ(a.starts[i].rank_in_interval, b.starts[i].rank_in_interval);
    EXPECT_EQ(a.starts[i].parameters.deg_and_mm(), b.starts[i].parameters.deg_and_mm());
    EXPECT_EQ(a.starts[i].room_from_ct.matrix(), b.starts[i].room_from_ct.matrix());
  }
}

class SharedMeasures : public testing::Test {
 protected:
  const Communicator world_ = Communicator::world();
  const StartFrame frame_ = test::example_start_frame();
  const std::vector<Eigen::Vector3d> points_ = target_points(frame_.target_box_ct, 20.0);
  const StartOptions options_{3, 2.0, 7, 1};

  /// The same starts as rank 0 makes alone, and none on the other ranks.
  void expect_as_alone(const MakeStarts& make) const {
    SharedStartMeasures shared(world_, frame_, options_, points_, is_left);
    const StratifiedStarts together = starts_measured_together(world_, shared, make);
    StartMeasures alone(frame_, options_, points_, is_left);
    if (world_.is_root()) {
      expect_same(together, make(alone));
    } else {
      EXPECT_EQ(together.starts.size(), 0u);
    }
  }
};

TEST_F(SharedMeasures, DrawTheSameStartsOnAnyNumberOfRanks) {
  expect_as_alone(stratified_starts);
  expect_as_alone(uniform_starts);
}

TEST_F(SharedMeasures, MeasureTheSameAtGivenPoses) {
  StartMeasures alone(frame_, options_, points_, is_left);
  std::vector<RigidTransform> poses;
  for (const PerturbedStart& start : uniform_starts(alone).starts)
    poses.push_back(start.room_from_ct);
  expect_as_alone([&](StartMeasures& measures) { return starts_at(measures, poses); });
  expect_as_alone([&](StartMeasures& measures) { return starts_at(measures, {}); });
}

TEST_F(SharedMeasures, ThrowTheErrorOfOneRankEverywhere) {
  const int failing = world_.size() - 1;
  SharedStartMeasures shared(world_, frame_, options_, points_, [&](const RigidTransform&) {
    if (world_.rank() == failing) throw FileError("field.h5", "is gone");
    return true;
  });
  try {
    starts_measured_together(world_, shared, stratified_starts);
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("field.h5: is gone"));
  }
}

TEST_F(SharedMeasures, ThrowWhatRankZeroRefuses) {
  SharedStartMeasures shared(
      world_, frame_, options_, points_, [](const RigidTransform&) { return false; });
  EXPECT_THROW(starts_measured_together(world_, shared, uniform_starts), Error);
}

}  // namespace
}  // namespace af::evaluation
