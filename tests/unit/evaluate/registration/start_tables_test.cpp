// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/start_tables.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "support/io_checks.h"

namespace af::evaluation {
namespace {

using test::message_of;
using testing::HasSubstr;

/// A film of three frames whose second was not tracked; frame f is moved by 10 f mm along x.
class FilmWithAGap : public testing::Test {
 protected:
  FilmWithAGap() {
    test::write_input(film_,
                      "1,0,0,10,0,1,0,0,0,0,1,0,0,0,0,1\n"
                      "NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN\n"
                      "1,0,0,30,0,1,0,0,0,0,1,0,0,0,0,1\n");
    frames_.case_name = "skull-01";
    frames_.context.ct_grid = [] {
      CtGrid grid;
      grid.size = {20, 30, 40};
      return grid;
    };
  }

 private:
  test::ScratchFolder folder_;

 protected:
  std::filesystem::path film_ = folder_ / "film.tra";
  PoseTableFrames frames_;
};

TEST_F(FilmWithAGap, LeavesTheStartOfThatFrameWithoutAPose) {
  const FoundPoses found = read_found_poses(film_, frames_);
  ASSERT_EQ(found.room_from_ct.size(), 2U);
  EXPECT_TRUE(found.room_from_ct.contains(0));
  ASSERT_TRUE(found.room_from_ct.contains(2));
  const Eigen::Vector3d way =
      found.room_from_ct.at(2).translation() - found.room_from_ct.at(0).translation();
  EXPECT_LT((way - Eigen::Vector3d(20, 0, 0)).norm(), 1e-12);
  EXPECT_THAT(found.problems, testing::ElementsAre(HasSubstr("1 of 3 frames")));
}

TEST_F(FilmWithAGap, IsRefusedAsStarts) {
  std::vector<std::string> notes;
  EXPECT_THAT(message_of<InputError>([&] { read_starts(film_, frames_, notes); }),
              HasSubstr("frame 2"));
}

}  // namespace
}  // namespace af::evaluation
