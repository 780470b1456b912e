// SPDX-License-Identifier: Apache-2.0
#include "study/pose_file.h"

#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "files/csv_table.h"
#include "support/io_checks.h"

namespace af {
namespace {

using Eigen::Vector3d;
using test::message_of;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

// Two inversions of a pose with translations up to 1000 mm.
constexpr double kToleranceMm = 1e-11;

/// Different about every axis, so that no transposed, inverted or swapped reading passes.
RigidTransform asymmetric_pose() {
  PoseFrame frame;
  frame.center_ct_mm = {10.0, -20.0, 30.0};
  return pose_from_parameters(
      frame, PoseParameters::from_deg_and_mm({11.0, -23.0, 47.0, 101.0, -202.0, 303.0}));
}

class PoseFile : public testing::Test {
 protected:
  RigidTransform read(const std::string& name, const std::string& text) {
    test::write_input(folder_ / name, text);
    return read_pose(folder_ / name);
  }
  template <typename ErrorType>
  std::string refusal(const std::string& name, const std::string& text) {
    return message_of<ErrorType>([&] { read(name, text); });
  }
  std::vector<RigidTransform> read_csv(const std::string& text, const PoseFrame& frame = {}) {
    test::write_input(folder_ / "p.csv", text);
    return read_poses(folder_ / "p.csv", {frame, {}});
  }
  std::vector<std::string> notes_of(const std::string& name, const std::string& text) {
    test::write_input(folder_ / name, text);
    return read_pose_file(folder_ / name, {PoseFrame{}, {}}).notes;
  }
  [[nodiscard]] std::string path(const std::string& name) const { return folder_ / name; }

  const RigidTransform pose_ = asymmetric_pose();

 private:
  test::ScratchFolder folder_;
};

double difference(const RigidTransform& a, const RigidTransform& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

std::string rows_text(const RigidTransform& pose, const std::string& separator) {
  std::string text;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      text += number_text(pose.matrix()(row, column)) + (column == 3 ? "\n" : separator);
  return text;
}

std::string json_text(const RigidTransform& pose) {
  std::string text = R"({"similarity": 1.5, "room_from_ct": [)";
  for (int row = 0; row < 4; ++row) {
    text += row == 0 ? "[" : ", [";
    for (int column = 0; column < 4; ++column)
      text += (column == 0 ? "" : ", ") + number_text(pose.matrix()(row, column));
    text += "]";
  }
  return text + "]}\n";
}

TEST_F(PoseFile, TomlRoundTripKeepsEveryBit) {
  EXPECT_EQ(read("p.toml", pose_to_toml(pose_)).matrix(), pose_.matrix());
}

TEST_F(PoseFile, TomlIsKnownByItsKeyWhateverTheName) {
  EXPECT_EQ(read("pose", "# a comment\n" + pose_to_toml(pose_)).matrix(), pose_.matrix());
}

TEST_F(PoseFile, ResultJsonIsRead) {
  EXPECT_EQ(read("result.json", json_text(pose_)).matrix(), pose_.matrix());
}

TEST_F(PoseFile, FilesOfOtherProgramsAreRefusedWithTheCommandThatConvertsThem) {
  test::write_input(path("p.txt"), rows_text(pose_, " "));
  EXPECT_THAT(message_of<InputError>([&] {
                read_pose(path("p.txt"), {{}, "--study s.toml --case a"});
              }),
              HasSubstr("af-convert " + path("p.txt") + " --study s.toml --case a -o poses.csv"));
  EXPECT_THAT(refusal<InputError>("p.toml", "diffdrr_parameterization = \"quaternion\"\n"),
              HasSubstr("af-convert"));
}

TEST_F(PoseFile, ItkTransformHoldsCtFromRoom) {
  const std::string text = pose_to_itk_transform(pose_);
  EXPECT_THAT(text,
              AllOf(testing::StartsWith("#Insight Transform File V1.0\n"),
                    HasSubstr("Transform: AffineTransform_double_3_3\n")));
  // By hand: the image of a room point under the stored numbers must be the ct point.
  std::istringstream numbers(text.substr(text.find("Parameters:") + 11));
  Eigen::Matrix3d linear;
  Vector3d translation;
  for (int i = 0; i < 9; ++i) numbers >> linear(i / 3, i % 3);
  for (int i = 0; i < 3; ++i) numbers >> translation[i];
  const Vector3d ct_point(1.0, 20.0, 300.0);
  EXPECT_LT((linear * (pose_ * ct_point) + translation - ct_point).norm(), kToleranceMm);
  EXPECT_LT(difference(read("p.tfm", text), pose_), kToleranceMm);
}

TEST_F(PoseFile, ItkTransformsCentreIsHonoured) {
  // x' = A (x - c) + c + t: a quarter turn about z through (10, 0, 0), then 5 mm along x.
  const RigidTransform pose = read("p.tfm",
                                   "#Insight Transform File V1.0\r\n#Transform 0\r\n"
                                   "Transform: MatrixOffsetTransformBase_double_3_3\r\n"
                                   "Parameters: 0 -1 0 1 0 0 0 0 1 5 0 0\r\n"
                                   "FixedParameters: 10 0 0\r\n");
  const RigidTransform ct_from_room = pose.inverse();
  EXPECT_LT((ct_from_room * Vector3d(10.0, 0.0, 0.0) - Vector3d(15.0, 0.0, 0.0)).norm(),
            kToleranceMm);
  EXPECT_LT((ct_from_room * Vector3d(11.0, 0.0, 7.0) - Vector3d(15.0, 1.0, 7.0)).norm(),
            kToleranceMm);
}

TEST_F(PoseFile, ItkVersorTransformIsRead) {
  // A half angle of 30 degrees about z.
  const RigidTransform pose =
      read("p.tfm",
           "#Insight Transform File V1.0\nTransform: VersorRigid3DTransform_double_3_3\n"
           "Parameters: 0 0 0.5 1 2 3\nFixedParameters: 0 0 0\n");
  RigidTransform ct_from_room = RigidTransform::Identity();
  ct_from_room.translation() = Vector3d(1.0, 2.0, 3.0);
  ct_from_room.linear() = rotation_from_angles({0.0, 0.0, 60.0 * kRadPerDeg});
  EXPECT_LT(difference(pose.inverse(), ct_from_room), kToleranceMm);
}

TEST_F(PoseFile, ItkTransformsThatAreNotOnePlainRigidOneAreRefused) {
  const std::string good = pose_to_itk_transform(pose_);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    return text.replace(text.find(from), from.size(), to);
  };
  EXPECT_THAT(refusal<InputError>(
                  "p.tfm", with("AffineTransform_double_3_3", "BSplineTransform_double_3_3")),
              HasSubstr("BSplineTransform"));
  EXPECT_THROW(read("p.tfm", with("_3_3", "_2_2")), InputError);
  EXPECT_THROW(read("p.tfm", with("Parameters: ", "Parameters: 1 ")), FileError);
  EXPECT_THROW(read("p.tfm", with("FixedParameters: 0 0 0", "FixedParameters: 0 0")), FileError);
  EXPECT_THROW(read("p.tfm", with("FixedParameters: 0 0 0\n", "")), FileError);
  EXPECT_THROW(read("p.tfm", with("FixedParameters: 0", "FixedParameters: nan")), FileError);
  EXPECT_THROW(read("p.tfm", good + good), FileError);
  EXPECT_THROW(read("p.tfm", "#Insight Transform File V1.0\n"), FileError);
  EXPECT_THAT(refusal<InputError>("p.tfm",
                                  "#Insight\nTransform: AffineTransform_double_3_3\n"
                                  "Parameters: 2 0 0 0 1 0 0 0 1 0 0 0\nFixedParameters: 0 0 0\n"),
              HasSubstr("not rigid"));
  EXPECT_THROW(read("p.tfm",
                    "#Insight\nTransform: VersorRigid3DTransform_double_3_3\n"
                    "Parameters: 0.9 0.9 0 0 0 0\nFixedParameters: 0 0 0\n"),
               InputError);
}

TEST_F(PoseFile, PosesThatAreNotRigidAreRefusedWithFile) {
  RigidTransform scaled = pose_;
  scaled.linear() *= 1.01;
  for (const auto& [name, text] : std::vector<std::pair<std::string, std::string>>{
           {"p.toml", pose_to_toml(scaled)}, {"p.json", json_text(scaled)}})
    EXPECT_THAT(refusal<InputError>(name, text),
                AllOf(HasSubstr(path(name)), HasSubstr("not rigid")));
}

TEST_F(PoseFile, MalformedFilesAreRefused) {
  EXPECT_THAT(refusal<FileError>("p.txt", ""), HasSubstr("is empty"));
  EXPECT_THAT(refusal<FileError>("p.json", "{\"room_from_ct\": [["), HasSubstr("is not JSON"));
  EXPECT_THAT(refusal<InputError>("p.json", "{}"), HasSubstr("room_from_ct"));
  EXPECT_THAT(refusal<InputError>("p.json", "{\"room_from_ct\": [1, 2]}"),
              HasSubstr("4 lists of 4"));
  EXPECT_THAT(refusal<InputError>("p.json", "{\"room_from_ct\": [[1,2,3],[],[],[]]}"),
              HasSubstr("4 lists of 4"));
  EXPECT_THAT(refusal<InputError>("p.json", "{\"room_from_ct\": [[1,2,3,\"4\"],[],[],[]]}"),
              HasSubstr("4 lists of 4"));
  EXPECT_THAT(refusal<InputError>("p.toml", "x = 1\n"), HasSubstr("room_from_ct is missing"));
  EXPECT_THAT(refusal<FileError>("p.toml", "x = \n"), HasSubstr("is not valid TOML"));
  EXPECT_THROW(read_pose(path("missing")), FileError);
}

TEST_F(PoseFile, DeeplyNestedJsonIsRefused) {
  EXPECT_THROW(read("p.json", "{\"a\": " + std::string(200'000, '[')), FileError);
  EXPECT_THROW(
      read("p.json", "{\"a\": " + std::string(200'000, '[') + std::string(200'000, ']') + "}"),
      FileError);
}

TEST_F(PoseFile, DamagedFilesAreReadOrRefused) {
  for (const std::string& good :
       {pose_to_toml(pose_), json_text(pose_), pose_to_itk_transform(pose_)}) {
    const std::size_t refused = test::refused_damaged_copies(
        good, 5, 200, [&](const std::string& text) { read("p.any", text); });
    EXPECT_GT(refused, 50U);
  }
}

TEST_F(PoseFile, CsvOfParametersIsRelativeToTheFrame) {
  const PoseFrame frame = PoseFrame::about(pose_, {1.0, 2.0, 3.0});
  const auto poses = read_csv(
      "pose_index,tz_mm,ty_mm,tx_mm,rz_deg,ry_deg,rx_deg,psnr_db\n"
      "0,0,0,0,0,0,0,43\n"
      "1,6,5,4,3,2,1,44\n",
      frame);
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_LT(difference(poses[0], pose_), kToleranceMm);
  const RigidTransform expected =
      pose_from_parameters(frame, PoseParameters::from_deg_and_mm({1, 2, 3, 4, 5, 6}));
  EXPECT_LT(difference(poses[1], expected), kToleranceMm);
}

TEST_F(PoseFile, CsvOfMatricesIsRoomFromCt) {
  std::string header;
  std::string row;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) {
      header += (header.empty() ? "m" : ",m") + std::to_string(i) + std::to_string(j);
      row += (row.empty() ? "" : ",") + number_text(pose_.matrix()(i, j));
    }
  // With the last row, and without it.
  const std::string short_header = header.substr(0, header.find(",m30"));
  std::string short_row = row;
  for (int i = 0; i < 4; ++i) short_row.resize(short_row.rfind(','));
  for (const auto& text : {header + "\n" + row + "\n", short_header + "\n" + short_row + "\n"}) {
    const auto poses = read_csv(text, PoseFrame::about(pose_, Vector3d::Zero()));
    ASSERT_EQ(poses.size(), 1U);
    EXPECT_EQ(poses[0].matrix(), pose_.matrix());
  }
}

TEST_F(PoseFile, WhatIsNotReadIsNamed) {
  const std::string header = "case,rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n";
  EXPECT_THAT(notes_of("p.csv", header + "A,1,2,3,4,5,6\n"),
              ElementsAre(HasSubstr("not read: case")));
  EXPECT_THAT(notes_of("p.json", json_text(pose_)), ElementsAre(HasSubstr("not read: similarity")));
  EXPECT_THAT(notes_of("p.toml", pose_to_toml(pose_) + "unit = \"m\"\n"),
              ElementsAre(HasSubstr("not read: unit")));
  EXPECT_THAT(
      message_of<InputError>([&] { read("p.tfm", pose_to_itk_transform(pose_) + "Unit: m\n"); }),
      HasSubstr("'Unit'"));
}

TEST_F(PoseFile, AByteOrderMarkIsNoPartOfTheText) {
  const std::string mark = "\xEF\xBB\xBF";
  EXPECT_EQ(read("p.tfm", mark + pose_to_itk_transform(pose_)).matrix(),
            read("p.tfm", pose_to_itk_transform(pose_)).matrix());
  EXPECT_EQ(read("p.toml", mark + pose_to_toml(pose_)).matrix(), pose_.matrix());
  EXPECT_EQ(read("p.json", mark + json_text(pose_)).matrix(), pose_.matrix());
}

TEST_F(PoseFile, CsvErrorsNameFileLineColumnAndValue) {
  const std::string header = "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n";
  EXPECT_THAT(message_of<FileError>([&] { read_csv(header + "1,2,3,4,5,6\n1,2,x,4,5,6\n"); }),
              AllOf(HasSubstr("p.csv:3: rz_deg"), HasSubstr("'x'")));
  EXPECT_THROW(read_csv(header + "1,2,inf,4,5,6\n"), FileError);
  EXPECT_THAT(message_of<InputError>([&] { read_csv("rx_deg,ry_deg,tx_mm,ty_mm\n1,2,3,4\n"); }),
              HasSubstr("p.csv:1: has no column rz_deg, tz_mm"));
  EXPECT_THAT(message_of<InputError>([&] { read_csv(header); }), HasSubstr("no poses"));
  EXPECT_THAT(
      message_of<InputError>([&] {
        read_csv("m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23\n2,0,0,0,0,1,0,0,0,0,1,0\n");
      }),
      AllOf(HasSubstr("p.csv:2: "), HasSubstr("not rigid")));
}

}  // namespace
}  // namespace af
