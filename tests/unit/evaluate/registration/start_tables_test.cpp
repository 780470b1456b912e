// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/start_tables.h"

#include <cmath>

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
                      "start_index,m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23\n"
                      "0,1,0,0,10,0,1,0,0,0,0,1,0\n"
                      "2,1,0,0,30,0,1,0,0,0,0,1,0\n");
    frames_.case_name = "skull-01";
  }

 private:
  test::ScratchFolder folder_;

 protected:
  std::filesystem::path film_ = folder_ / "film.csv";
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
}

TEST_F(FilmWithAGap, IsRefusedAsStarts) {
  std::vector<std::string> notes;
  EXPECT_THAT(message_of<InputError>([&] { read_starts(film_, frames_, notes); }),
              HasSubstr("must be 1"));
}

/// A table of one case's poses, with more columns than it needs.
class TableOfPoses : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& rows) {
    test::write_input(
        folder_ / "t.csv",
        "case,start_index,seconds,m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23\n" + rows);
    return folder_ / "t.csv";
  }
  [[nodiscard]] PoseTableFrames frames() const {
    PoseTableFrames frames;
    frames.case_name = "skull-01";
    frames.cases = {"skull-01", "skull-02"};
    return frames;
  }
  const std::string pose_ = ",1,0,0,0,0,1,0,0,0,0,1,0\n";
  test::ScratchFolder folder_;
};

TEST_F(TableOfPoses, StartsOfACaseThatTheStudyLacksAreRefused) {
  std::vector<std::string> notes;
  const std::string rows = "skull-01,0,1" + pose_ + "skull-02,0,1" + pose_;
  EXPECT_EQ(read_starts(write(rows), frames(), notes).size(), 1U);
  for (const char* name : {"typo", "Skull-01", "skull-01 ", ""})
    EXPECT_THAT(message_of<InputError>(
                    [&] { read_starts(write(rows + name + ",1,1" + pose_), frames(), notes); }),
                testing::AllOf(HasSubstr("t.csv:4: case = '" + std::string(name) + "'"),
                               HasSubstr("skull-01, skull-02")));
}

TEST_F(TableOfPoses, FilesOfAFolderNameTheirCaseWhereThereAreSeveral) {
  for (const char* name : {"skull-01-0.toml", "1.toml"})
    test::write_input(folder_ / name, "room_from_ct = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n");
  PoseTableFrames table = frames();
  EXPECT_EQ(read_found_poses(folder_.path(), table).room_from_ct.size(), 2U);
  table.is_only_case = false;
  EXPECT_THAT(message_of<InputError>([&] { read_found_poses(folder_.path(), table); }),
              HasSubstr("1.toml: does not say of which case"));
}

TEST_F(TableOfPoses, SecondsAreNotNegative) {
  for (const char* missing : {"", "nan", "inf"})
    EXPECT_TRUE(
        std::isnan(read_found_poses(write(std::string("skull-01,0,") + missing + pose_), frames())
                       .seconds.at(0)));
  for (const char* negative : {"-1", "-1e-9"})
    EXPECT_THAT(message_of<InputError>([&] {
                  read_found_poses(write(std::string("skull-01,0,") + negative + pose_), frames());
                }),
                HasSubstr("t.csv:2: seconds = " + std::string(negative) + ":"));
}

}  // namespace
}  // namespace af::evaluation
