// SPDX-License-Identifier: Apache-2.0
#include "study/study_file.h"

#include <filesystem>
#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "files/options_toml.h"
#include "study/ct_keys.h"
#include "study/landmark_start.h"
#include "study/rig_file.h"
#include "study/study_template.h"
#include "study/target_place.h"
#include "support/io_checks.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;
using test::message_of;
using test::replaced;
using testing::AllOf;
using testing::HasSubstr;

// The line numbers below are those of this text.
const char* const kGoodStudy = R"(rig = "treatment-room"
[[case]]
name = "skull-01"
ct = "ct.nii.gz"
nominal_room_from_ct = [[1,0,0,10],[0,0,-1,20],[0,1,0,30],[0,0,0,1]]
center_ct_mm = [1.0, 2.0, 3.0]
target_box_ct_mm = [[-30,-31,-32],[30,31,32]]
fiducials_ct_mm = [[0,0,0], [50,0,0], [0,50,0], [0,0,50]]
[[case.view]]
camera = "A"
xray = "A.mha"
xray_domain = "intensity"
roi_px = [150, 160, 200, 201]
fiducials_px = [[1,2], [3,4], [5,6], [7.5,8.25]]
field = "fields/A.af.h5"
[[case.view]]
camera = "B"
xray = "/elsewhere/B.mha"
xray_domain = "attenuation"
roi_px = [0, 0, 512, 512]
fiducials_px = [[10,20], [30,40], [50,60], [70,80]]
mask = "B-mask.png"
)";

class StudyFile : public testing::Test {
 protected:
  Study read(const std::string& text) {
    test::write_input(path(), text);
    return read_study(path());
  }
  /// The refusal of the good study with one text replaced.
  std::string refusal(const std::string& from, const std::string& to) {
    return message_of<InputError>([&] { read(replaced(kGoodStudy, from, to)); });
  }
  [[nodiscard]] std::string path() const { return folder_ / "study.toml"; }
  [[nodiscard]] const test::ScratchFolder& folder() const { return folder_; }

 private:
  test::ScratchFolder folder_;
};

void expect_identical(const StudyView& a, const StudyView& b) {
  EXPECT_EQ(a.camera, b.camera);
  EXPECT_EQ(a.xray, b.xray);
  EXPECT_EQ(a.xray_domain, b.xray_domain);
  EXPECT_EQ(a.roi.column, b.roi.column);
  EXPECT_EQ(a.roi.row, b.roi.row);
  EXPECT_EQ(a.roi.width, b.roi.width);
  EXPECT_EQ(a.roi.height, b.roi.height);
  EXPECT_EQ(a.fiducials_px, b.fiducials_px);
  EXPECT_EQ(a.field, b.field);
  EXPECT_EQ(a.mask, b.mask);
}

void expect_identical(const StudyCase& a, const StudyCase& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.note, b.note);
  EXPECT_EQ(a.ct, b.ct);
  EXPECT_EQ(a.nominal_room_from_ct.matrix(), b.nominal_room_from_ct.matrix());
  EXPECT_EQ(a.center_ct_mm, b.center_ct_mm);
  EXPECT_EQ(a.target_box_ct.low_mm, b.target_box_ct.low_mm);
  EXPECT_EQ(a.target_box_ct.high_mm, b.target_box_ct.high_mm);
  EXPECT_EQ(a.fiducials_ct_mm, b.fiducials_ct_mm);
  ASSERT_EQ(a.gold_room_from_ct.has_value(), b.gold_room_from_ct.has_value());
  if (a.gold_room_from_ct) {
    EXPECT_EQ(a.gold_room_from_ct->matrix(), b.gold_room_from_ct->matrix());
  }
  ASSERT_EQ(a.views.size(), b.views.size());
  for (std::size_t i = 0; i < a.views.size(); ++i) expect_identical(a.views[i], b.views[i]);
}

TEST_F(StudyFile, EveryKeyIsReadAndPathsAreRelativeToTheFile) {
  const Study study = read(kGoodStudy);
  EXPECT_EQ(study.path, path());
  EXPECT_EQ(study.rig.cameras.size(), 2U);
  const StudyCase& study_case = study.find_case("skull-01");
  EXPECT_EQ(study_case.ct, folder() / "ct.nii.gz");
  EXPECT_EQ(study_case.nominal_room_from_ct * Vector3d(1.0, 2.0, 3.0), Vector3d(11.0, 17.0, 32.0));
  EXPECT_EQ(study_case.center_ct_mm, Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(study_case.target_box_ct.low_mm, Vector3d(-30.0, -31.0, -32.0));
  EXPECT_EQ(study_case.target_box_ct.high_mm, Vector3d(30.0, 31.0, 32.0));
  EXPECT_EQ(study_case.fiducials_ct_mm.at(2), Vector3d(0.0, 50.0, 0.0));
  EXPECT_FALSE(study_case.gold_room_from_ct.has_value());
  ASSERT_EQ(study_case.views.size(), 2U);
  const StudyView& a = study_case.views[0];
  EXPECT_EQ(a.camera, "A");
  EXPECT_EQ(a.xray, folder() / "A.mha");
  EXPECT_EQ(a.xray_domain, XrayDomain::Intensity);
  EXPECT_EQ(a.roi.column, 150);
  EXPECT_EQ(a.roi.row, 160);
  EXPECT_EQ(a.roi.width, 200);
  EXPECT_EQ(a.roi.height, 201);
  EXPECT_EQ(a.fiducials_px.at(3), Vector2d(7.5, 8.25));
  EXPECT_EQ(a.field, fs::path(folder() / "fields/A.af.h5"));
  EXPECT_EQ(a.mask, std::nullopt);
  const StudyView& b = study_case.views[1];
  EXPECT_EQ(b.xray, "/elsewhere/B.mha");
  EXPECT_EQ(b.xray_domain, XrayDomain::Attenuation);
  EXPECT_EQ(b.mask, fs::path(folder() / "B-mask.png"));
}

TEST_F(StudyFile, NoteIsFreeTextThatSurvivesWriting) {
  EXPECT_EQ(read(kGoodStudy).find_case("").note, "");
  const Study study = read(replaced(kGoodStudy, "ct = ", "note = \"two \\\"views\\\"\"\nct = "));
  EXPECT_EQ(study.find_case("").note, "two \"views\"");
  expect_identical(read(study_to_toml(study, folder().path())).find_case(""), study.find_case(""));
}

TEST_F(StudyFile, WarningsOfTheRigReachTheCaller) {
  const std::string rig = builtin_rig_text("treatment-room");
  std::vector<std::string> warnings;
  std::ofstream(folder() / "rig.toml") << rig;
  std::ofstream(path()) << replaced(kGoodStudy, "\"treatment-room\"", "\"rig.toml\"");
  read_study(path(), &warnings);
  EXPECT_TRUE(warnings.empty());
  CameraRig mirrored = read_rig("treatment-room");
  CameraGeometry& camera = mirrored.cameras.front();
  camera.detector_origin_point = camera.detector_point(0.0, camera.size_px.y() - 1.0);
  camera.row_direction = -camera.row_direction;
  std::ofstream(folder() / "rig.toml") << rig_to_toml(mirrored);
  read_study(path(), &warnings);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_THAT(warnings.front(), HasSubstr("mirrored"));
}

TEST_F(StudyFile, RelativePathOfTheStudyGivesAbsolutePaths) {
  read(kGoodStudy);
  const fs::path before = fs::current_path();
  fs::current_path(folder().path());
  const Study study = read_study("study.toml");
  fs::current_path(before);
  EXPECT_TRUE(study.find_case("").ct.is_absolute());
  EXPECT_TRUE(fs::equivalent(study.path, path()));
}

TEST_F(StudyFile, RigPathIsRelativeToTheFile) {
  fs::create_directory(folder() / "rigs");
  test::write_input(folder() / "rigs/my.toml", builtin_rig_text("treatment-room"));
  const Study study = read(replaced(kGoodStudy, "treatment-room", "rigs/my.toml"));
  EXPECT_EQ(study.rig_name_or_path, folder() / "rigs/my.toml");
  EXPECT_THAT(study_to_toml(study, folder().path()), HasSubstr("rig = \"rigs/my.toml\"\n"));
  const std::string missing = replaced(kGoodStudy, "treatment-room", "gone.toml");
  EXPECT_THAT(message_of<FileError>([&] { read(missing); }), HasSubstr(folder() / "gone.toml"));
}

TEST_F(StudyFile, PointsAreStatedInTheStoredXray) {
  CameraRig rig = parse_rig(builtin_rig_text("treatment-room"), "treatment-room");
  rig.cameras[0].distortion = {{-3.0, 12.0, 0.04, -0.03}};
  test::write_input(folder() / "lens.toml", rig_to_toml(rig));
  const std::string text =
      replaced(replaced(replaced(kGoodStudy, "treatment-room", "lens.toml"),
                        "fiducials_ct_mm",
                        "landmarks_ct_mm = [[0,0,0], [9,9,9]]\nfiducials_ct_mm"),
               "field = ",
               "landmarks_px = [[20.5, 30.0], []]\nfield = ");
  const Study study = read(text);
  const PixelDistortion distortion(study.rig.cameras[0]);
  const StudyView& view = study.cases[0].views[0];
  constexpr double kInversePx = 1e-8;
  EXPECT_LT((distortion.stored_from_ideal(view.fiducials_px[3]) - Vector2d(7.5, 8.25)).norm(),
            kInversePx);
  EXPECT_GT((view.fiducials_px[3] - Vector2d(7.5, 8.25)).norm(), 0.5);
  EXPECT_LT((distortion.stored_from_ideal(*view.landmarks_px[0]) - Vector2d(20.5, 30.0)).norm(),
            kInversePx);
  EXPECT_FALSE(view.landmarks_px[1].has_value());
  EXPECT_EQ(study.cases[0].views[1].fiducials_px[0], Vector2d(10, 20)) << "a lens of its own";
  const Study back = read(study_to_toml(study, folder().path()));
  EXPECT_LT((back.cases[0].views[0].fiducials_px[3] - view.fiducials_px[3]).norm(), kInversePx);
}

TEST_F(StudyFile, RoundTripKeepsEveryBit) {
  Study study = read(kGoodStudy);
  StudyCase second = study.cases.front();
  second.name = "quote \" and µ";
  second.nominal_room_from_ct.linear() = rotation_from_angles({0.1, 0.2, 0.3});
  second.gold_room_from_ct =
      pose_from_parameters(second.frame(), PoseParameters::from_deg_and_mm({1, 2, 3, 4, 5, 6}));
  second.center_ct_mm = Vector3d(1.0 / 3.0, -1e-300, 1e6);
  second.fiducials_ct_mm.clear();
  for (StudyView& view : second.views) view.fiducials_px.clear();
  study.cases.push_back(second);
  const Study back = read(study_to_toml(study, folder().path()));
  ASSERT_EQ(back.cases.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) expect_identical(back.cases[i], study.cases[i]);
}

TEST_F(StudyFile, PathsBelowTheFolderAreWrittenRelativeAndOthersAbsolute) {
  const Study study = read(kGoodStudy);
  EXPECT_THAT(study_to_toml(study, folder().path()),
              AllOf(HasSubstr("ct = \"ct.nii.gz\"\n"),
                    HasSubstr("field = \"fields/A.af.h5\"\n"),
                    HasSubstr("xray = \"/elsewhere/B.mha\"\n")));
  EXPECT_EQ(study_to_toml(study, folder().path() / ""), study_to_toml(study, folder().path()));
  EXPECT_THAT(study_to_toml(study, "/another"),
              HasSubstr("ct = \"" + (folder() / "ct.nii.gz").string() + "\""));
}

TEST_F(StudyFile, FrameTurnsAboutTheRegionsCentre) {
  const Study study = read(kGoodStudy);
  const StudyCase& study_case = study.find_case("");
  const RigidTransform turned = pose_from_parameters(
      study_case.frame(), PoseParameters::from_deg_and_mm({10, 20, 30, 0, 0, 0}));
  const Vector3d moved =
      turned * study_case.center_ct_mm - study_case.nominal_room_from_ct * study_case.center_ct_mm;
  EXPECT_LT(moved.norm(), 1e-12);
}

TEST_F(StudyFile, FindCaseListsTheKnownNames) {
  const Study study = read(kGoodStudy);
  EXPECT_EQ(study.find_case("").name, "skull-01");
  EXPECT_THAT(message_of<InputError>([&] { static_cast<void>(study.find_case("x")); }),
              HasSubstr("skull-01"));
  Study two = study;
  two.cases.push_back(two.cases.front());
  two.cases.back().name = "pelvis";
  EXPECT_THAT(message_of<InputError>([&] { static_cast<void>(two.find_case("")); }),
              HasSubstr("skull-01, pelvis"));
}

TEST_F(StudyFile, BadValuesAreRefusedWithLineKeyValueAndConstraint) {
  EXPECT_THAT(
      refusal("[0,0,-1,20]", "[0,0,-1.2,20]"),
      AllOf(HasSubstr(path() + ":5: case[0].nominal_room_from_ct"), HasSubstr("not rigid")));
  EXPECT_THAT(refusal("[0,1,0,30]", "[0,-1,0,30]"), HasSubstr("reflection"));
  EXPECT_THAT(refusal("[0,1,0,30],[0,0,0,1]", "[0,1,0,30]"),
              HasSubstr("4 lists of 4 finite numbers"));
  EXPECT_THAT(
      refusal("[1.0, 2.0, 3.0]", "[1.0, inf, 3.0]"),
      HasSubstr(":6: case[0].center_ct_mm = [1, inf, 3]: must be a list of 3 finite numbers"));
  EXPECT_THAT(refusal("[30,31,32]", "[30,-31,32]"), HasSubstr(":7: case[0].target_box_ct_mm"));
  EXPECT_THAT(refusal("[30,31,32]", "[30000,31,32]"), HasSubstr("2e4 mm"));
  EXPECT_THAT(refusal("[30,31,32]", "[3000,3000,3000]"), HasSubstr("1e7 cells"));
  EXPECT_THAT(refusal("\"ct.nii.gz\"", "\"\""), HasSubstr(":4: case[0].ct = \"\""));
  EXPECT_THAT(refusal("\"skull-01\"", "\"a/b\""), HasSubstr(":3: case[0].name = \"a/b\""));
  EXPECT_THAT(refusal("[150, 160, 200, 201]", "[313, 160, 200, 201]"),
              AllOf(HasSubstr(":13: case[0].view[0].roi_px = [313, 160, 200, 201]: must"),
                    HasSubstr("512 x 512")));
  EXPECT_THAT(refusal("[150, 160, 200, 201]", "[2147483647, 1, 2147483647, 1]"),
              HasSubstr("roi_px"));
  EXPECT_THAT(refusal("[150, 160, 200, 201]", "[-1, 1, 5, 5]"), HasSubstr("roi_px"));
  EXPECT_THAT(refusal("[150, 160, 200, 201]", "[1, 1, 0, 5]"), HasSubstr("roi_px"));
  EXPECT_THAT(refusal("\"intensity\"", "\"bright\""),
              HasSubstr(":12: case[0].view[0].xray_domain = \"bright\": must be \"intensity\" or"));
  EXPECT_THAT(
      refusal("camera = \"A\"", "camera = \"C\""),
      HasSubstr(
          ":10: case[0].view[0].camera = \"C\": must be a camera of the rig, which has A, B"));
  EXPECT_THAT(refusal("camera = \"B\"", "camera = \"A\""), HasSubstr("already has a view"));
}

TEST_F(StudyFile, FiducialsMustBeEnoughNotCollinearAndEquallyMany) {
  EXPECT_THAT(refusal("[[0,0,0], [50,0,0], [0,50,0], [0,0,50]]",
                      "[[0,0,0], [50,0,0], [100,0.01,0], [9,0,0]]"),
              AllOf(HasSubstr(":8: case[0].fiducials_ct_mm"), HasSubstr("not collinear")));
  EXPECT_THAT(
      refusal("[[0,0,0], [50,0,0], [0,50,0], [0,0,50]]", "[[7,7,7], [7,7,7], [7,7,7], [7,7,7]]"),
      HasSubstr("not collinear"));
  EXPECT_THAT(
      refusal("[5,6], [7.5,8.25]]", "[5,6]]"),
      HasSubstr(":14: case[0].view[0].fiducials_px = [[1, 2], [3, 4], [5, 6]]: has 3 points, "
                "but the case has 4"));
  EXPECT_THAT(refusal("fiducials_px = [[1,2], [3,4], [5,6], [7.5,8.25]]\n", ""),
              HasSubstr(":9: case[0].view[0].fiducials_px: has 0 points"));
  EXPECT_THAT(refusal("[7.5,8.25]", "[7.5,512]"),
              HasSubstr("point [7.5, 512.0] must lie on the detector"));
  EXPECT_THAT(refusal("[7.5,8.25]", "[7.5,nan]"),
              HasSubstr(":14: case[0].view[0].fiducials_px[3]"));
}

TEST_F(StudyFile, FiducialsMayBeHiddenInAView) {
  const auto view_with = [&](const std::string& row) {
    return read(replaced(kGoodStudy, "[5,6], [7.5,8.25]]", row + ", [7.5,8.25]]"));
  };
  for (const char* hidden : {"[]", "[nan,nan]", "[nan, +nan]"}) {
    const Study study = view_with(hidden);
    const StudyView& view = study.find_case("").views[0];
    ASSERT_EQ(view.fiducials_px.size(), 4U) << hidden;
    EXPECT_FALSE(view.fiducials_px[2].allFinite()) << hidden;
    EXPECT_EQ(view.fiducials_px[3], Vector2d(7.5, 8.25));
    // Written and read again.
    const StudyView again = read(study_to_toml(study, folder().path())).find_case("").views[0];
    EXPECT_FALSE(again.fiducials_px[2].allFinite()) << hidden;
    EXPECT_EQ(again.fiducials_px[3], view.fiducials_px[3]);
  }
  // Half a point is not a point, and all of the CT's fiducials must be there.
  for (const char* bad : {"[nan,5]", "[5]", "[nan]", "[inf,inf]", "\"\"", "[[]]"})
    EXPECT_THAT(refusal("[5,6], [7.5,8.25]]", std::string(bad) + ", [7.5,8.25]]"),
                HasSubstr("or [] for one that is absent"))
        << bad;
  EXPECT_THAT(refusal("[0,50,0], [0,0,50]]", "[], [0,0,50]]"), HasSubstr("fiducials_ct_mm"));
}

TEST_F(StudyFile, CaseWithNeitherFiducialsNorGoldPoseIsAccepted) {
  std::string text =
      replaced(kGoodStudy, "fiducials_ct_mm = [[0,0,0], [50,0,0], [0,50,0], [0,0,50]]\n", "");
  text = replaced(text, "fiducials_px = [[1,2], [3,4], [5,6], [7.5,8.25]]\n", "");
  text = replaced(text, "fiducials_px = [[10,20], [30,40], [50,60], [70,80]]\n", "");
  EXPECT_TRUE(read(text).find_case("").fiducials_ct_mm.empty());
}

TEST_F(StudyFile, GoldPoseMustBeRigid) {
  const std::string gold =
      "gold_room_from_ct = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n[[case.view]]";
  EXPECT_TRUE(read(replaced(kGoodStudy, "[[case.view]]", gold)).find_case("").gold_room_from_ct);
  EXPECT_THAT(refusal("[[case.view]]", replaced(gold, "[0,1,0,0]", "[0,1,1,0]")),
              HasSubstr(":9: case[0].gold_room_from_ct"));
}

TEST_F(StudyFile, UnknownKeysAreRefusedWithTheNearestName) {
  EXPECT_THAT(
      refusal("xray_domain", "xray_domian"),
      AllOf(HasSubstr(
                ":12: case[0].view[0]: unknown key \"xray_domian\": did you mean \"xray_domain\"?"),
            HasSubstr("xray_domain is missing")));
  EXPECT_THAT(refusal("center_ct_mm", "centre_ct_mm"), HasSubstr("did you mean \"center_ct_mm\"?"));
  EXPECT_THAT(refusal("rig = \"treatment-room\"", "rig = \"treatment-room\"\ncasse = 1"),
              HasSubstr(":2: unknown key \"casse\": did you mean \"case\"?"));
}

TEST_F(StudyFile, MissingPartsAreAllNamed) {
  const std::string message =
      message_of<InputError>([&] { read("rig = \"treatment-room\"\n[[case]]\nname = \"x\"\n"); });
  for (const char* key : {"ct", "center_ct_mm", "target_box_ct_mm", "view"})
    EXPECT_THAT(message, HasSubstr(path() + ":2: case[0]." + key + " is missing"));
  EXPECT_THAT(message_of<InputError>([&] { read("rig = \"treatment-room\"\n"); }),
              HasSubstr("case is missing"));
  EXPECT_THAT(message_of<InputError>([&] { read("[[case]]\n"); }), HasSubstr("rig is missing"));
}

TEST_F(StudyFile, WithoutANominalPoseTheCentreLiesAtTheIsocentre) {
  CameraRig rig = read_rig("treatment-room");
  rig.isocenter_point = {5.0, -6.0, 7.0};
  std::ofstream(folder() / "rig.toml") << rig_to_toml(rig);
  const std::regex nominal("nominal_room_from_ct = [^\n]*\n");
  const std::string text = replaced(kGoodStudy, "treatment-room", "rig.toml");
  const StudyCase study_case = read(std::regex_replace(text, nominal, "")).find_case("");
  EXPECT_EQ(study_case.nominal_room_from_ct * study_case.center_ct_mm, rig.isocenter_point);
  EXPECT_EQ(study_case.nominal_room_from_ct.linear(), Eigen::Matrix3d::Identity());
}

TEST_F(StudyFile, ATargetFarFromTheCentreAtTheIsocentreIsRefused) {
  const std::regex nominal("nominal_room_from_ct = [^\n]*\n");
  const std::string text =
      replaced(kGoodStudy, "[[-30,-31,-32],[30,31,32]]", "[[-30,-31,-932],[30,31,-868]]");
  EXPECT_THAT(message_of<InputError>([&] { read(std::regex_replace(text, nominal, "")); }),
              AllOf(HasSubstr(path() + ":6: case[0].target_box_ct_mm = "),
                    HasSubstr("in the beam of camera 'A', but it is projected to columns"),
                    HasSubstr("; center_ct_mm is what lies at the isocentre there")));
}

TEST_F(StudyFile, ANominalPoseThatShowsNoneOfTheTargetIsRefused) {
  EXPECT_THAT(refusal("[[1,0,0,10]", "[[1,0,0,900]"),
              AllOf(HasSubstr(path() + ":5: case[0].nominal_room_from_ct = "),
                    HasSubstr("in the beam of camera 'A', but it is projected to columns"),
                    HasSubstr("without this key center_ct_mm is put at the isocentre")));
  const CameraGeometry camera = read_rig("treatment-room").camera("A");
  StudyCase behind = read(kGoodStudy).find_case("");
  behind.nominal_room_from_ct.translation() = camera.source_point - 500.0 * camera.beam_direction();
  EXPECT_THAT(beam_problem(behind, camera), HasSubstr("but it is behind the source"));
  // A part in the beam is enough: a corner of the box at the detector's edge.
  StudyCase at_edge = read(kGoodStudy).find_case("");
  at_edge.nominal_room_from_ct = RigidTransform::Identity();
  at_edge.nominal_room_from_ct.translation() =
      camera.detector_point(0.0, 0.0) - at_edge.target_box_ct.high_mm;
  EXPECT_EQ(beam_problem(at_edge, camera), "");
}

TEST_F(StudyFile, ATargetBoxOutsideTheCtIsRefused) {
  const StudyCase study_case = read(kGoodStudy).find_case("");
  CtGrid grid;
  grid.size = {100, 90, 210};
  grid.spacing_mm = {4.0, 4.0, 2.0};
  grid.origin_mm = {-200.0, -180.0, -848.0};
  EXPECT_THAT(message_of<InputError>([&] { require_target_in_ct(study_case, grid); }),
              AllOf(HasSubstr(path() + ":7: case[0].target_box_ct_mm: [[-30.0, -31.0, -32.0], "),
                    HasSubstr("must reach into the CT, which spans"),
                    HasSubstr("z -849.0 to -429.0 mm")));
  // A corner of the CT within the box, whatever the order and direction of the voxels.
  for (const double turn_deg : {0.0, 30.0, 90.0, 180.0}) {
    grid.direction = Eigen::AngleAxisd(turn_deg * kRadPerDeg, Vector3d::UnitZ()).toRotationMatrix();
    grid.origin_mm.setZero();
    grid.origin_mm = Vector3d(29.0, 30.0, 31.0) - grid.point_mm({99.0, 89.0, 209.0});
    EXPECT_NO_THROW(require_target_in_ct(study_case, grid)) << turn_deg;
  }
}

TEST(ResidualsText, SaysWhetherTheMarksAgree) {
  StudyCase study_case;
  study_case.views.resize(2);
  study_case.views[0].camera = "A";
  study_case.views[1].camera = "B";
  LandmarkPose pose;
  pose.residuals = {{0, 0, 3.0, 1.0}, {2, 1, 60.0, 18.0}};
  const auto text = [&](double rms_mm) {
    pose.rms_mm = rms_mm;
    return residuals_text(pose, study_case);
  };
  EXPECT_THAT(text(2.5), HasSubstr("good: within the 2.5 mm that count as a successful"));
  EXPECT_THAT(text(2.6), HasSubstr("rough: beyond the 2.5 mm"));
  EXPECT_THAT(text(10.1), AllOf(HasSubstr("bad: beyond the 10 mm"), HasSubstr("B #3 first")));
}

TEST_F(StudyFile, WithoutARegionTheWholeDetectorCounts) {
  const std::regex roi("roi_px = [^\n]*\n");
  const Study study = read(std::regex_replace(kGoodStudy, roi, ""));
  const StudyView& view = study.find_case("").views.front();
  const Eigen::Vector2i size_px = study.rig.camera(view.camera).size_px;
  EXPECT_EQ(view.roi.column, 0);
  EXPECT_EQ(view.roi.row, 0);
  EXPECT_EQ(view.roi.width, size_px.x());
  EXPECT_EQ(view.roi.height, size_px.y());
  EXPECT_FALSE(view.is_roi_stated);
  EXPECT_THAT(study_to_toml(study, folder().path()), testing::Not(HasSubstr("roi_px")));
  EXPECT_TRUE(read(kGoodStudy).find_case("").views.front().is_roi_stated);
}

/// The good study with landmarks and no nominal pose: points of the CT as cameras A and B see them
/// at `room_from_ct`.
std::string study_of_landmarks(const RigidTransform& room_from_ct) {
  const CameraRig rig = read_rig("treatment-room");
  const std::vector<Eigen::Vector3d> points = {{20, -10, 5}, {-15, 12, 25}, {3, 30, -20}};
  std::string text =
      "rig = \"treatment-room\"\n[[case]]\nname = \"x\"\nct = \"ct.nii\"\n"
      "center_ct_mm = [0, 0, 0]\ntarget_box_ct_mm = [[-9, -9, -9], [9, 9, 9]]\n"
      "landmarks_ct_mm = [[20, -10, 5], [-15, 12, 25], [3, 30, -20]]\n";
  for (const CameraGeometry& camera : rig.cameras) {
    text += "[[case.view]]\ncamera = \"" + camera.name + "\"\nxray = \"x.png\"\n" +
            "xray_domain = \"intensity\"\nlandmarks_px = [";
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector2d px = camera.project(room_from_ct * point);
      text += "[" + std::to_string(px.x()) + ", " + std::to_string(px.y()) + "], ";
    }
    text += "]\n";
  }
  return text;
}

TEST_F(StudyFile, LandmarksGiveTheNominalPoseThatIsNotStated) {
  RigidTransform pose = RigidTransform::Identity();
  pose.linear() = Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  pose.translation() = Eigen::Vector3d(4, -5, 6);
  const std::string text = study_of_landmarks(pose);
  const RigidTransform nominal = read(text).find_case("").nominal_room_from_ct;
  // Pixels are written to 1e-6.
  EXPECT_LT((nominal.matrix() - pose.matrix()).cwiseAbs().maxCoeff(), 1e-3);
  const std::string too_few =
      std::regex_replace(std::regex_replace(text, std::regex(", \\[3, 30, -20\\]"), ""),
                         std::regex(", \\[[^\\]]*\\], \\]\n"),
                         "]\n");
  EXPECT_THAT(message_of<InputError>([&] { read(too_few); }),
              HasSubstr("must give the nominal pose, which is not stated"));
}

TEST_F(StudyFile, LandmarksThatAreNoListAreRefusedAlsoWhereTheCaseHasNone) {
  EXPECT_THAT(refusal("field = ", "landmarks_px = 3\nfield = "),
              AllOf(HasSubstr("landmarks_px"), HasSubstr("must be a list")));
}

TEST_F(StudyFile, RepeatedCaseNameIsRefused) {
  const std::string body = kGoodStudy;
  const std::string twice = body + body.substr(body.find("[[case]]"));
  EXPECT_THAT(message_of<InputError>([&] { read(twice); }),
              AllOf(HasSubstr("case[1].name"), HasSubstr("study.toml:2")));
}

TEST_F(StudyFile, ErrorsOfItsFilesNameTheLine) {
  const Study study = read(kGoodStudy);
  const StudyView& view = study.cases.front().views.front();
  const auto fails = [] { throw FileError("A.mha", "is gone"); };
  EXPECT_EQ(message_of<FileError>([&] { naming_study_line(view.places, "xray", fails); }),
            path() + ":11: case[0].view[0].xray: A.mha: is gone");
  EXPECT_EQ(message_of<InputError>([&] {
              naming_study_line(
                  study.cases.front().places, "ct", [] { throw InputError("no HU"); });
            }),
            path() + ":4: case[0].ct: no HU");
  // Files that the study does not name, and other defects, get no line.
  EXPECT_EQ(message_of<FileError>([&] { naming_study_line(view.places, "mask", fails); }),
            "A.mha: is gone");
  EXPECT_THAT(
      message_of<FileError>([&] { read(replaced(kGoodStudy, "treatment-room", "gone.toml")); }),
      HasSubstr(path() + ":1: rig: "));
}

/// The template with every optional key uncommented.
std::string uncommented(const std::string& text) {
  return std::regex_replace(text, std::regex("(^|\n)# ([a-z_]+ = )"), "$1$2");
}

TEST_F(StudyFile, TemplateIsAValidStudyWithAndWithoutItsOptionalKeys) {
  const Study plain = read(template_text("study"));
  ASSERT_EQ(plain.cases.size(), 2U);
  EXPECT_TRUE(plain.cases.front().fiducials_ct_mm.empty());
  const StudyCase full = read(uncommented(template_text("study"))).cases.front();
  EXPECT_EQ(full.fiducials_ct_mm.size(), 4U);
  EXPECT_TRUE(full.gold_room_from_ct.has_value());
  EXPECT_FALSE(full.note.empty());
  EXPECT_TRUE(full.views.front().field.has_value());
  EXPECT_TRUE(full.views.front().mask.has_value());
  EXPECT_EQ(full.views.back().fiducials_px.size(), 4U);
  EXPECT_THROW(template_text("patient"), InputError);
}

TEST_F(StudyFile, TemplateOfARigIsAValidRig) {
  test::write_input(folder() / "rig.toml", template_text("rig"));
  EXPECT_EQ(read_rig(folder() / "rig.toml").cameras.size(), 2U);
}

TEST_F(StudyFile, WhatIsNotTomlIsAFileError) {
  EXPECT_THROW(read(""), FileError);
  EXPECT_THROW(read(std::string("\0\1\2\3\xFF", 5)), FileError);
  EXPECT_THROW(read_study(folder() / "missing.toml"), FileError);
  EXPECT_THROW(read_study(folder().path()), FileError);
}

TEST_F(StudyFile, DamagedFilesAreReadOrRefused) {
  const std::size_t refused = test::refused_damaged_copies(
      kGoodStudy, 7, 1000, [&](const std::string& text) { read(text); });
  EXPECT_GT(refused, 300U);
}

TEST_F(StudyFile, KeepsHowAnXrayIsRead) {
  const char* const keys =
      "xray_domain = \"intensity\"\nxray_frame = 3\nxray_polarity = \"inverted\"\nmask = "
      "\"auto\"\ndark_level = 8500.0\nair_level = 51000\nxray_spacing = \"ignore\"";
  Study study = read(replaced(kGoodStudy, "xray_domain = \"intensity\"", keys));
  for (const bool again : {false, true}) {
    if (again) study = read(study_to_toml(study, folder().path()));
    const StudyView& view = study.cases[0].views[0];
    EXPECT_EQ(view.reading.frame, 3);
    EXPECT_EQ(view.reading.polarity, XrayPolarity::Inverted);
    EXPECT_TRUE(view.reading.masks_borders);
    EXPECT_FALSE(view.mask);
    EXPECT_EQ(view.reading.dark_level, 8500.0);
    EXPECT_EQ(view.reading.air, AirSource::Value);
    EXPECT_EQ(view.reading.air_level, 51000.0);
    EXPECT_TRUE(view.reading.ignores_spacing);
    EXPECT_FALSE(study.cases[0].views[1].reading.masks_borders);
  }
  study = read(replaced(kGoodStudy,
                        "xray_domain = \"intensity\"",
                        "xray_domain = \"intensity\"\nflat = \"f.mha\"\ndark = \"d.mha\""));
  study = read(study_to_toml(study, folder().path()));
  EXPECT_EQ(study.cases[0].views[0].reading.flat, folder() / "f.mha");
  EXPECT_EQ(study.cases[0].views[0].reading.dark, folder() / "d.mha");
}

TEST_F(StudyFile, AMaskMayBeAFileAndAutomatic) {
  const auto with = [](const std::string& mask) {
    return replaced(kGoodStudy, "mask = \"B-mask.png\"", "mask = " + mask);
  };
  Study study = read(with("[\"auto\", \"B-mask.png\"]"));
  for (const bool again : {false, true}) {
    if (again) study = read(study_to_toml(study, folder().path()));
    EXPECT_TRUE(study.cases[0].views[1].reading.masks_borders);
    EXPECT_EQ(study.cases[0].views[1].mask, folder() / "B-mask.png");
  }
  for (const char* bad : {"3", "[\"a.png\", \"b.png\"]", "[\"auto\", \"auto\"]", "[[]]", "\"\""})
    EXPECT_THAT(message_of<InputError>([&] { (void)read(with(bad)); }),
                HasSubstr("must be \"auto\", a file, or"))
        << bad;
}

TEST_F(StudyFile, RefusesContradictionsInHowAnXrayIsRead) {
  const auto refused = [&](const std::string& keys) {
    return refusal("xray_domain = \"intensity\"", "xray_domain = \"intensity\"\n" + keys);
  };
  EXPECT_THAT(refused("xray_frame = 0"), HasSubstr("xray_frame = 0: must be at least 1"));
  EXPECT_THAT(refused("xray_frame = 1.5"), HasSubstr("must be a whole number"));
  EXPECT_THAT(refused("air_level = -1.0"), HasSubstr("must be positive"));
  EXPECT_THAT(refused("air_level = \"sky\""), HasSubstr("percentile, open-beam"));
  EXPECT_THAT(refused("air_level = 3.0\nflat = \"f.mha\""), HasSubstr("together with `flat`"));
  EXPECT_THAT(refused("dark_level = 3.0\ndark = \"d.mha\""), HasSubstr("together with `dark`"));
  EXPECT_THAT(refused("dark_level = nan"), HasSubstr("must be a finite number"));
  EXPECT_THAT(refused("xray_polarity = \"upside down\""), HasSubstr("\"as-stored\""));
  EXPECT_THAT(refused("xray_spacing = \"no\""), HasSubstr("\"check\" or \"ignore\""));
  EXPECT_THAT(
      refusal("xray_domain = \"attenuation\"", "xray_domain = \"attenuation\"\nair_level = 3.0"),
      HasSubstr("is for xray_domain = \"intensity\" only"));
}

TEST_F(StudyFile, KeepsHowACtIsRead) {
  const char* const keys =
      "ct = \"ct.nii.gz\"\nct_resample = true\nct_values = \"labels\"\nct_label_hu = [\"3=700\", "
      "\"1=40\"]\nct_body_only = true\nct_series = \"1.2\"";
  Study study = read(replaced(kGoodStudy, "ct = \"ct.nii.gz\"", keys));
  for (const bool again : {false, true}) {
    if (again) study = read(study_to_toml(study, folder().path()));
    const CtReadOptions& reading = study.cases[0].ct_reading;
    EXPECT_TRUE(reading.resamples);
    EXPECT_EQ(reading.values, "labels");
    EXPECT_EQ(reading.label_hu, (std::vector<std::string>{"3=700", "1=40"}));
    EXPECT_TRUE(reading.keeps_body_only);
    EXPECT_EQ(reading.series_uid, "1.2");
  }
  EXPECT_EQ(ct_keys_text(CtReadOptions()), "");
  CtReadOptions typed;
  typed.values = "mu";
  EXPECT_EQ(ct_reading_of(to_toml(typed)).values, "mu");
  EXPECT_EQ(ct_reading_of("st_nodes = 3").text(), "");
}

TEST_F(StudyFile, RefusesContradictionsInHowACtIsRead) {
  const auto refused = [&](const std::string& keys) {
    return refusal("ct = \"ct.nii.gz\"", "ct = \"ct.nii.gz\"\n" + keys);
  };
  EXPECT_THAT(refused("ct_values = \"raw\""), HasSubstr("ct_raw_slope_per_mm = 0"));
  EXPECT_THAT(refused("ct_values = \"grey\""), HasSubstr("must be one of hu, mu, raw, labels"));
  EXPECT_THAT(refused("ct_resample = 1"), HasSubstr("must be true or false"));
  EXPECT_THAT(refused("ct_label_hu = [3]"), HasSubstr("must be a list of texts"));
  EXPECT_THAT(refused("ct_resamples = true"), HasSubstr("did you mean \"ct_resample\""));
}

/// The good study with landmarks, and [] and nan for what is not visible.
std::string study_with_landmarks() {
  std::string text =
      replaced(kGoodStudy,
               "fiducials_ct_mm = ",
               "landmarks_ct_mm = [[1,2,3], [40,5,6], [7,80,9]]\nfiducials_ct_mm = ");
  text = replaced(
      text, "field = \"fields", "landmarks_px = [[10,20.5], [], [30,40]]\nfield = \"fields");
  return replaced(text, "mask = ", "landmarks_px = [[nan,nan], [1,2], [3,4]]\nmask = ");
}

TEST_F(StudyFile, LandmarksMayBeInvisibleInAView) {
  const Study study = read(study_with_landmarks());
  const StudyCase& study_case = study.cases.at(0);
  ASSERT_EQ(study_case.landmarks_ct_mm.size(), 3U);
  EXPECT_EQ(study_case.landmarks_ct_mm[2], Vector3d(7, 80, 9));
  const auto& a = study_case.views.at(0).landmarks_px;
  ASSERT_EQ(a.size(), 3U);
  EXPECT_EQ(a[0], Vector2d(10, 20.5));
  EXPECT_FALSE(a[1].has_value());
  EXPECT_FALSE(study_case.views.at(1).landmarks_px.at(0).has_value());
  const Study again = read(study_to_toml(study, study.path.parent_path()));
  EXPECT_EQ(again.cases.at(0).views.at(0).landmarks_px, a);
  EXPECT_EQ(again.cases.at(0).landmarks_ct_mm, study_case.landmarks_ct_mm);
}

TEST_F(StudyFile, LandmarksWithMistakesAreRefusedWithTheirLine) {
  const auto refused = [&](const std::string& from, const std::string& to) {
    return message_of<InputError>([&] { read(replaced(study_with_landmarks(), from, to)); });
  };
  EXPECT_THAT(refused("[[10,20.5], [], ", "[[10,20.5], "),
              AllOf(HasSubstr("landmarks_px"), HasSubstr("2 entries")));
  EXPECT_THAT(refused("[10,20.5]", "[10]"), HasSubstr("[column, row]"));
  EXPECT_THAT(refused("[10,20.5]", "[10,nan]"), HasSubstr("[column, row]"));
  EXPECT_THAT(refused("[10,20.5]", "[10,20.5,3]"), HasSubstr("[column, row]"));
  EXPECT_THAT(refused("[10,20.5]", "\"none\""), HasSubstr("[column, row]"));
  EXPECT_THAT(refused("[10,20.5]", "[10,2000]"), HasSubstr("on the detector"));
  EXPECT_THAT(refused("landmarks_px = [[10,20.5], [], [30,40]]", "landmarks_px = 3"),
              HasSubstr("must be a list"));
}

}  // namespace
}  // namespace af
