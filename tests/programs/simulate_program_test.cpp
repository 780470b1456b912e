// SPDX-License-Identifier: Apache-2.0
// The program af-simulate as people run it.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <list>
#include <string>

#include <gtest/gtest.h>

#include "ct/ct_reader.h"
#include "evaluate/simulate/phantom.h"
#include "evaluate/simulate/siddon_projector.h"
#include "evaluate/simulate/solid_projector.h"
#include "files/output_file.h"
#include "geometry/fiducial_registration.h"
#include "geometry/target_box.h"
#include "geometry/tre.h"
#include "images/dicom_elements.h"
#include "study/pose_file.h"
#include "study/rig_file.h"
#include "study/study_file.h"
#include "study/xray_reader.h"
#include "support/run_program.h"
#include "support/test_paths.h"
#include "xray/image_file.h"

namespace af {
namespace {

namespace fs = std::filesystem;

const std::string coarse = "--phantom spine --phantom-voxel-mm 4 ";

class AfSimulate : public ::testing::Test {
 protected:
  /// Exit code of the program; log() has what it printed.
  int run(const std::string& arguments, const std::string& program = "af-simulate") {
    last_run_ = test::run_command(AF_PROGRAM_FOLDER "/" + program + " " + arguments);
    return last_run_.exit_code;
  }
  [[nodiscard]] std::string log() const { return last_run_.output; }
  std::string folder(const std::string& name) { return "-o '" + (scratch_ / name).string() + "'"; }

  test::ScratchFolder scratch_;
  test::ProgramRun last_run_;
};

TEST_F(AfSimulate, MakesAStudyThatReadsBack) {
  ASSERT_EQ(run(coarse + "--seed 5 " + folder("s")), 0) << log();
  const Study study = read_study(scratch_ / "s" / "study.toml");
  const StudyCase& patient = study.find_case("");
  ASSERT_EQ(patient.views.size(), 2u);
  ASSERT_EQ(patient.fiducials_ct_mm.size(), 4u);
  for (const StudyView& view : patient.views) {
    const CameraGeometry& camera = study.rig.camera(view.camera);
    const Image2d attenuation = read_view_xray(view, camera).attenuation;
    EXPECT_EQ(attenuation.width, camera.size_px.x());
    EXPECT_GE(view.roi.column, 2);
    EXPECT_LE(view.roi.row + view.roi.height, camera.size_px.y() - 2);
  }
  EXPECT_NO_THROW(read_ct(patient.ct));
  for (const char* name : {"provenance.json", "reproduce.sh", "A-preview.png", "B-preview.png"})
    EXPECT_TRUE(fs::exists(scratch_ / "s" / name)) << name;
  EXPECT_FALSE(fs::exists(scratch_ / "s.partial"));
}

TEST_F(AfSimulate, TruthIsWithinTheStatedRangeAndTheFiducialsFindIt) {
  ASSERT_EQ(run(coarse + "--seed 5 " + folder("s")), 0) << log();
  const Study study = read_study(scratch_ / "s" / "study.toml");
  const StudyCase& patient = study.find_case("");
  ASSERT_TRUE(patient.gold_room_from_ct.has_value());
  const RigidTransform gold = *patient.gold_room_from_ct;
  EXPECT_TRUE(gold.isApprox(read_pose(scratch_ / "s" / "truth.toml"), 1e-12));
  const auto offset = parameters_from_pose(patient.frame(), gold).deg_and_mm();
  double largest = 0.0;
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_LE(std::abs(offset[i]), i < 3 ? 5.0 : 10.0);
    largest = std::max(largest, std::abs(offset[i]));
  }
  EXPECT_GT(largest, 0.1);
  std::vector<FiducialView> views;
  for (const StudyView& view : patient.views)
    views.push_back({study.rig.camera(view.camera), view.fiducials_px});
  const auto fitted = gold_from_fiducials(views, patient.fiducials_ct_mm);
  // 0.2 px are 0.058 mm at the isocentre; four pins average to about half of that per axis, and
  // five standard errors stay below 0.25 mm.
  EXPECT_LT((fitted.room_from_ct * patient.center_ct_mm - gold * patient.center_ct_mm).norm(),
            0.25);
}

TEST_F(AfSimulate, SameSeedGivesTheSameBytesOnAnyNumberOfThreads) {
  ASSERT_EQ(run(coarse + "--seed 9 --threads 1 " + folder("one")), 0) << log();
  ASSERT_EQ(run(coarse + "--seed 9 --threads 3 " + folder("three")), 0) << log();
  ASSERT_EQ(run(coarse + "--seed 10 --threads 3 " + folder("other")), 0) << log();
  for (const char* name : {"A.mha", "B.mha", "study.toml", "truth.toml", "ct.nii.gz"}) {
    const std::string one = read_text_file(scratch_ / "one" / name);
    EXPECT_EQ(one, read_text_file(scratch_ / "three" / name)) << name;
    const bool depends_on_seed = std::string(name) != "ct.nii.gz";
    EXPECT_EQ(one != read_text_file(scratch_ / "other" / name), depends_on_seed) << name;
  }
}

TEST_F(AfSimulate, IdealXrayIsTheExactIntegralOfTheStudysCt) {
  constexpr double kTolerance = 1e-4;  // the contract's
  ASSERT_EQ(run(coarse + "--ideal --no-fiducials " + folder("s")), 0) << log();
  const Study study = read_study(scratch_ / "s" / "study.toml");
  const StudyCase& patient = study.find_case("");
  const CtVolume ct = read_ct(patient.ct);
  const AttenuationModel model;
  const AttenuationVolume volume(ct, model);
  const TissueModel tissue(model);
  const SiddonProjector projector(volume, tissue);
  const RigidTransform ct_from_room = patient.gold_room_from_ct->inverse();
  for (const StudyView& view : patient.views) {
    const CameraGeometry& camera = study.rig.camera(view.camera);
    const Image2d xray = read_image(view.xray);
    for (int row = 3; row < camera.size_px.y(); row += 50)
      for (int column = 5; column < camera.size_px.x(); column += 50) {
        const PathIntegrals path = projector.integrate(
            ct_from_room * camera.source_point, ct_from_room * camera.detector_point(column, row));
        const double exact = model.mu_water_per_mm * (path.water_mm + path.bone_mm);
        const double level = static_cast<double>(xray.at(column, row));
        ASSERT_NEAR(-std::log(level / 4000.0), exact, kTolerance) << column << ' ' << row;
      }
  }
}

TEST_F(AfSimulate, StressChangesTheXraysButNeitherTruthNorTargetNorRegions) {
  ASSERT_EQ(run(coarse + "--seed 5 " + folder("clean")), 0) << log();
  const Study clean_study = read_study(scratch_ / "clean" / "study.toml");
  const StudyCase& clean = clean_study.find_case("");
  const std::string hash = identity_of(read_ct(clean.ct)).content_sha256;
  for (const char* stress : {"rods", "fiducials", "heel", "scatter", "noise", "motion"}) {
    ASSERT_EQ(run(coarse + "--seed 5 --force --stress " + stress + " " + folder("s")), 0) << log();
    const Study study = read_study(scratch_ / "s" / "study.toml");
    const StudyCase& hard = study.find_case("");
    EXPECT_EQ(hard.gold_room_from_ct->matrix(), clean.gold_room_from_ct->matrix()) << stress;
    EXPECT_EQ(hard.target_box_ct.low_mm, clean.target_box_ct.low_mm) << stress;
    EXPECT_EQ(hard.views[0].roi.column, clean.views[0].roi.column) << stress;
    EXPECT_EQ(hard.views[0].fiducials_px, clean.views[0].fiducials_px) << stress;
    EXPECT_NE(hard.note.find(std::string(stress) + " ("), std::string::npos) << hard.note;
    EXPECT_NE(read_text_file(hard.views[0].xray), read_text_file(clean.views[0].xray)) << stress;
    EXPECT_EQ(identity_of(read_ct(hard.ct)).content_sha256, hash) << stress;
    EXPECT_EQ(read_text_file(scratch_ / "s" / "rig.toml"),
              read_text_file(scratch_ / "clean" / "rig.toml"))
        << stress;
  }
}

TEST_F(AfSimulate, MetalIsDenseInTheXraysAndClippedInTheCt) {
  for (const char* name : {"spine", "pelvis", "head"}) {
    const std::string phantom =
        std::string("--phantom ") + name + " --phantom-voxel-mm 3 --no-fiducials ";
    ASSERT_EQ(run(phantom + "--force " + folder("s")), 0) << log();
    const Study plain = read_study(scratch_ / "s" / "study.toml");
    const Image2d without = read_image(plain.find_case("").views[0].xray);
    ASSERT_EQ(run(phantom + "--metal --force " + folder("s")), 0) << log();
    const Study study = read_study(scratch_ / "s" / "study.toml");
    const StudyCase& patient = study.find_case("");
    EXPECT_NE(patient.note.find("with metal"), std::string::npos);
    const CtVolume ct = read_ct(patient.ct);
    EXPECT_EQ(*std::max_element(ct.hu.view().begin(), ct.hu.view().end()), 3071) << name;
    const Image2d with = read_image(patient.views[0].xray);
    int darker = 0;
    for (std::size_t i = 0; i < with.pixels.size(); ++i)
      darker += with.pixels[i] < 0.7f * without.pixels[i] ? 1 : 0;
    EXPECT_GT(darker, 20) << name;
  }
}

TEST_F(AfSimulate, DegradedCtIsTheStudysWhileTheXraysShowTheGoodOne) {
  ASSERT_EQ(run(coarse + "--seed 5 " + folder("clean")), 0) << log();
  ASSERT_EQ(run(coarse + "--seed 5 --stress degraded-ct " + folder("s")), 0) << log();
  EXPECT_EQ(read_text_file(scratch_ / "s" / "A.mha"), read_text_file(scratch_ / "clean" / "A.mha"));
  const CtVolume good = read_ct(scratch_ / "clean" / "ct.nii.gz");
  const CtVolume poor = read_ct(scratch_ / "s" / "ct.nii.gz");
  EXPECT_NE(identity_of(poor).content_sha256, identity_of(good).content_sha256);
  EXPECT_TRUE(std::all_of(
      poor.hu.view().begin(), poor.hu.view().end(), [](int hu) { return hu % 20 == 0; }));
}

TEST_F(AfSimulate, CalibrationErrorLeavesTheStudysRigAndRecordsTheTrueOne) {
  ASSERT_EQ(run(coarse + "--seed 5 " + folder("clean")), 0) << log();
  ASSERT_EQ(run(coarse + "--seed 5 --stress calibration " + folder("s")), 0) << log();
  EXPECT_EQ(read_text_file(scratch_ / "s" / "rig.toml"),
            read_text_file(scratch_ / "clean" / "rig.toml"));
  EXPECT_FALSE(fs::exists(scratch_ / "clean" / "rig-true.toml"));
  const CameraRig true_rig = read_rig((scratch_ / "s" / "rig-true.toml").string());
  const Study study = read_study(scratch_ / "s" / "study.toml");
  const StudyCase& patient = study.find_case("");
  for (const CameraGeometry& camera : true_rig.cameras) {
    double sum = 0.0;
    for (const Eigen::Vector3d& corner : patient.target_box_ct.corner_points()) {
      const Eigen::Vector3d in_room = *patient.gold_room_from_ct * corner;
      sum +=
          (camera.project(in_room) - study.rig.camera(camera.name).project(in_room)).squaredNorm();
    }
    EXPECT_NEAR(std::sqrt(sum / 8.0), 0.2, 1e-6);
  }
}

TEST_F(AfSimulate, AllStressesTogetherDependOnTheSeedButNotOnThreads) {
  ASSERT_EQ(run(coarse + "--stress all --seed 9 --threads 1 " + folder("one")), 0) << log();
  ASSERT_EQ(run(coarse + "--stress all --seed 9 --threads 3 " + folder("three")), 0) << log();
  for (const char* name :
       {"A.mha", "B.mha", "study.toml", "truth.toml", "ct.nii.gz", "rig-true.toml"})
    EXPECT_EQ(read_text_file(scratch_ / "one" / name), read_text_file(scratch_ / "three" / name))
        << name;
  const std::string record = read_text_file(scratch_ / "one" / "provenance.json");
  for (const char* name : {"rods", "heel", "degraded-ct", "calibration", "motion"})
    EXPECT_NE(record.find(std::string("\"name\": \"") + name + "\""), std::string::npos) << name;
}

TEST_F(AfSimulate, RefusesBadInputByTheContractsCodesAndLeavesNothing) {
  std::ofstream(scratch_ / "not-a-ct.nii.gz") << "text";
  std::ofstream(scratch_ / "bad.toml") << "isocenter_point = [0, 0, 0]\n";
  const std::string text_file = "'" + (scratch_ / "not-a-ct.nii.gz").string() + "' ";
  const std::string bad_rig = "'" + (scratch_ / "bad.toml").string() + "' ";
  struct Case {
    std::string arguments;
    int exit_code;
    std::string message;
  };
  const std::vector<Case> cases{
      {"", 2, "--ct,--phantom"},
      {"--ct a --phantom spine", 2, "2 were given"},
      {"--phantom knee", 2, "spine"},
      {"--phantom spine --center-ct-mm 1,2", 2, "center-ct-mm"},
      {coarse + "--stress rods,bones", 2, "bones"},
      {"--ct a --metal", 3, "metal"},
      {"--ct a --moved-bone T12", 3, "moved-bone: applies to --phantom only"},
      {coarse + "--moved-bone jaw", 3, "must be one of T9, T10, T11, T12, L1, L2, L3"},
      {"--phantom head --moved-bone T12", 3, "moved-bone = 'T12': must be one of jaw"},
      {coarse + "--moved-bone T12 --cone-beam 8", 3, "moved-bone: applies to studies only"},
      {coarse + "--target-bone T12 --cone-beam 8", 3, "target-bone: applies to studies only"},
      {"--ct a --target-bone T12", 3, "target-bone: applies to --phantom only"},
      {"--phantom head --target-bone T12", 3, "target-bone = 'T12': must be one of jaw"},
      {coarse + "--target-bone T12 --moved-bone L1", 3, "target-bone: not with --moved-bone"},
      {coarse + "--bits 7", 3, "bits = 7"},
      {coarse + "--tube-kvp 10", 3, "tube-kvp = 10"},
      {coarse + "--water-mu-per-mm 0.6", 3, "water_mu_per_mm"},
      {coarse + "--center-ct-mm 900,0,0", 3, "center_ct_mm"},
      {coarse + "--target-box-ct-mm 0,0,0,-1,5,5", 3, "target_box_ct_mm: must be [[low"},
      // A study with more than 1e7 cells of 2 mm would be refused.
      {coarse + "--target-box-ct-mm=-300,-300,-300,300,300,300", 3, "target_box_ct_mm: must be sm"},
      {coarse + "--rig " + bad_rig, 3, "camera"},
      {coarse + "--rig nowhere.toml", 4, "nowhere.toml"},
      {"--ct /nowhere/ct.nii.gz", 4, "/nowhere/ct.nii.gz"},
      {"--ct " + text_file, 4, "not-a-ct.nii.gz"},
  };
  for (const Case& bad : cases) {
    EXPECT_EQ(run(bad.arguments + " " + folder("s")), bad.exit_code) << bad.arguments << '\n'
                                                                     << log();
    EXPECT_NE(log().find(bad.message), std::string::npos) << bad.arguments << '\n' << log();
    EXPECT_FALSE(fs::exists(scratch_ / "s")) << bad.arguments;
    EXPECT_FALSE(fs::exists(scratch_ / "s.partial")) << bad.arguments;
  }
}

TEST_F(AfSimulate, KeepsAnExistingFolderUnlessForced) {
  fs::create_directories(scratch_ / "s");
  std::ofstream(scratch_ / "s" / "mine") << "x";
  EXPECT_EQ(run(coarse + folder("s")), 3);
  EXPECT_NE(log().find("--force"), std::string::npos);
  EXPECT_TRUE(fs::exists(scratch_ / "s" / "mine"));
  EXPECT_EQ(run(coarse + "--force " + folder("s")), 0) << log();
  EXPECT_FALSE(fs::exists(scratch_ / "s" / "mine"));
  EXPECT_TRUE(fs::exists(scratch_ / "s" / "study.toml"));
}

/// A camera that looks at the isocentre from where an XA positioner at these angles does, for a
/// patient whose axes are the room's.
CameraGeometry oblique_camera(const std::string& name, double primary_deg, double secondary_deg) {
  const double primary = primary_deg * kRadPerDeg;
  const double secondary = secondary_deg * kRadPerDeg;
  const Eigen::Vector3d beam(std::sin(primary) * std::cos(secondary),
                             -std::cos(primary) * std::cos(secondary),
                             std::sin(secondary));
  CameraGeometry camera;
  camera.name = name;
  camera.size_px = {96, 80};
  camera.pixel_spacing_mm = {2.5, 2.0};
  camera.source_point = -800.0 * beam;
  camera.row_direction =
      (-Eigen::Vector3d::UnitZ() + beam.z() * beam).normalized();  // head side first
  camera.column_direction = camera.row_direction.cross(beam);
  camera.detector_origin_point =
      400.0 * beam - 47.5 * 2.5 * camera.column_direction - 39.5 * 2.0 * camera.row_direction;
  return camera;
}

TEST_F(AfSimulate, DicomXaOfObliqueViewsGivesTheLineIntegralsOfMetaImageToTheBit) {
  CameraRig rig;
  rig.cameras = {oblique_camera("LAO", 30.0, 20.0), oblique_camera("RAO", -55.0, -10.0)};
  write_text_file(scratch_ / "rig.toml", rig_to_toml(rig));
  const std::string arguments = coarse + "--rig '" + (scratch_ / "rig.toml").string() + "' ";
  for (const int bits : {12, 16}) {
    const std::string name = "dicom" + std::to_string(bits);
    const std::string with_bits = arguments + "--bits " + std::to_string(bits) + " ";
    const std::string other = "mha" + std::to_string(bits);
    ASSERT_EQ(run(with_bits + folder(other)), 0) << log();
    ASSERT_EQ(run(with_bits + "--xray-format dicom " + folder(name)), 0) << log();
    const Study meta = read_study(scratch_ / other / "study.toml");
    const Study dicom = read_study(scratch_ / name / "study.toml");
    for (std::size_t i = 0; i < 2; ++i) {
      const StudyView& view = dicom.cases[0].views[i];
      EXPECT_EQ(view.xray.extension(), ".dcm");
      const ViewXray found = read_view_xray(view, dicom.rig.cameras[i]);
      const ViewXray expected = read_view_xray(meta.cases[0].views[i], meta.rig.cameras[i]);
      EXPECT_EQ(found.attenuation.pixels, expected.attenuation.pixels);
      EXPECT_NE(found.note.find("MONOCHROME1"), std::string::npos) << found.note;
      EXPECT_NE(found.note.find(std::to_string((1 << bits) - 1) + " - stored"), std::string::npos);
    }
    EXPECT_TRUE(meta.cases[0].gold_room_from_ct->isApprox(*dicom.cases[0].gold_room_from_ct));
    const DicomElements lao = DicomElements::read(dicom.cases[0].views[0].xray);
    EXPECT_NEAR(*lao.number_or_none({0x0018, 0x1510}, "primary"), 30.0, 1e-6);
    EXPECT_NEAR(*lao.number_or_none({0x0018, 0x1511}, "secondary"), 20.0, 1e-6);
    EXPECT_NEAR(*lao.number_or_none({0x0018, 0x1110}, "to detector"), 1200.0, 1e-6);
    EXPECT_NEAR(*lao.number_or_none({0x0018, 0x1111}, "to patient"), 800.0, 1e-6);
    const DicomElements rao = DicomElements::read(dicom.cases[0].views[1].xray);
    EXPECT_NEAR(*rao.number_or_none({0x0018, 0x1510}, "primary"), -55.0, 1e-6);
    EXPECT_NEAR(*rao.number_or_none({0x0018, 0x1511}, "secondary"), -10.0, 1e-6);
  }
  EXPECT_EQ(run(coarse + "--ideal --xray-format dicom " + folder("floats")), 3);
}

/// What a bone of the drawn spine 7 adds, in every pixel, to muscle of its shape (mm of water).
Eigen::ArrayXd shadow_of(const std::string& bone,
                         const CameraGeometry& camera,
                         const RigidTransform& room_from_bone) {
  Phantom phantom = make_phantom("spine", false, 7);
  std::erase_if(phantom.solids, [&](const Solid& solid) { return solid.bone != bone; });
  for (Solid& solid : phantom.solids) solid.hu -= 1000 + kMuscleHu;
  const TissueModel tissue{AttenuationModel()};
  const SolidProjector projector(phantom, tissue);
  const RigidTransform bone_from_room = room_from_bone.inverse();
  Eigen::ArrayXd shadow(camera.size_px.prod());
  for (int pixel = 0; pixel < shadow.size(); ++pixel) {
    const PathIntegrals path =
        projector.integrate(bone_from_room * camera.source_point,
                            bone_from_room * camera.detector_point(pixel % camera.size_px.x(),
                                                                   pixel / camera.size_px.x()));
    shadow[pixel] = path.water_mm + path.bone_mm;
  }
  return shadow;
}

double correlation(const Eigen::ArrayXd& a, const Eigen::ArrayXd& b) {
  const Eigen::ArrayXd from_a = a - a.mean();
  const Eigen::ArrayXd from_b = b - b.mean();
  return (from_a * from_b).mean() / std::sqrt(from_a.square().mean() * from_b.square().mean());
}

Eigen::ArrayXd attenuation_of(const StudyView& view) {
  const Image2d xray = read_image(view.xray);
  return -(Eigen::Map<const Eigen::ArrayXf>(xray.pixels.data(),
                                            static_cast<Eigen::Index>(xray.pixels.size()))
               .cast<double>() /
           4000.0)
              .log();
}

class MovedT12 : public AfSimulate {
 protected:
  void SetUp() override {
    rig_.cameras = {oblique_camera("front", 5.0, 3.0), oblique_camera("side", 80.0, -4.0)};
    write_text_file(scratch_ / "rig.toml", rig_to_toml(rig_));
  }
  /// The drawn spine 7 in these two cameras, and its study.
  const StudyCase& simulated(const std::string& arguments, const std::string& name) {
    EXPECT_EQ(run(arguments_ + arguments + " " + folder(name)), 0) << log();
    studies_.push_back(read_study(scratch_ / name / "study.toml"));
    return studies_.back().find_case("");
  }

  CameraRig rig_;
  std::string arguments_ = coarse + "--anatomy-seed 7 --seed 5 --rig '" +
                           (scratch_ / "rig.toml").string() + "' --case one ";
  std::list<Study> studies_;
};

TEST_F(MovedT12, HasItsOwnPoseInTheTruthAndTheRestHasThatOfTheSameStudyWithoutIt) {
  const StudyCase& still = simulated("--ideal --target-bone T10", "still");
  const StudyCase& moved = simulated("--ideal --moved-bone T10", "moved");
  EXPECT_EQ(moved.center_ct_mm, still.center_ct_mm);
  EXPECT_EQ(moved.target_box_ct.low_mm, still.target_box_ct.low_mm);
  EXPECT_EQ(moved.views[0].roi.column, still.views[0].roi.column);
  EXPECT_EQ(read_text_file(moved.ct), read_text_file(still.ct));
  const fs::path truth = scratch_ / "moved" / "truth.toml";
  EXPECT_TRUE(moved.gold_room_from_ct->isApprox(read_pose(truth), 1e-12));
  // The table [rest] as a file of its own.
  const std::string text = read_text_file(truth);
  const std::size_t rest_begin = text.find("room_from_ct", text.find("[rest]"));
  write_text_file(scratch_ / "rest.toml",
                  text.substr(rest_begin, text.find("[fiducial_gold]") - rest_begin));
  EXPECT_TRUE(still.gold_room_from_ct->isApprox(read_pose(scratch_ / "rest.toml"), 1e-12));
  const double displacement_mm = mean_tre_mm(
      *moved.gold_room_from_ct, *still.gold_room_from_ct, target_points(still.target_box_ct));
  EXPECT_GE(displacement_mm, 2.0);
  const std::string key = "displacement_mm = ";
  EXPECT_NEAR(std::stod(text.substr(text.find(key) + key.size())), displacement_mm, 1e-6);
  EXPECT_NE(text.find("name = \"T10\""), std::string::npos);
  EXPECT_NE(moved.note.find("T10 turned by "), std::string::npos) << moved.note;
  EXPECT_NE(read_text_file(scratch_ / "moved" / "provenance.json").find("T10 turned by "),
            std::string::npos);
  // The gold pose from the pins must be the bone's.
  std::vector<FiducialView> views;
  for (const StudyView& view : moved.views)
    views.push_back({rig_.camera(view.camera), view.fiducials_px});
  // 0.2 px are 0.33 mm at the isocentre: as above, five standard errors.
  EXPECT_LT((gold_from_fiducials(views, moved.fiducials_ct_mm).room_from_ct * moved.center_ct_mm -
             *moved.gold_room_from_ct * moved.center_ct_mm)
                .norm(),
            1.4);
}

TEST_F(MovedT12, IsInTheXraysWhereItsPoseSaysAndPinsAreWithIt) {
  // The rest of the difference comes from discs and ribs where the bone was, and from bodies before
  // it.
  constexpr double kLowest = 0.9;
  constexpr double kHighestOfAFlippedMotion = 0.7;  // 0.5 where shadows do not overlap
  const StudyCase& still = simulated("--ideal --no-fiducials", "still");
  const StudyCase& moved = simulated("--ideal --no-fiducials --moved-bone T12", "moved");
  const StudyCase& pinned = simulated("--ideal --moved-bone T12", "pinned");
  const RigidTransform& rest = *still.gold_room_from_ct;
  const RigidTransform& gold = *moved.gold_room_from_ct;
  for (std::size_t i = 0; i < 2; ++i) {
    const CameraGeometry& camera = rig_.cameras[i];
    const Eigen::ArrayXd difference =
        attenuation_of(moved.views[i]) - attenuation_of(still.views[i]);
    const Eigen::ArrayXd before = shadow_of("T12", camera, rest);
    EXPECT_GT(correlation(shadow_of("T12", camera, gold) - before, difference), kLowest);
    EXPECT_LT(
        correlation(shadow_of("T12", camera, rest * gold.inverse() * rest) - before, difference),
        kHighestOfAFlippedMotion);
    const Eigen::ArrayXd pins = attenuation_of(pinned.views[i]) - attenuation_of(moved.views[i]);
    for (const Eigen::Vector2d& pixel : pinned.views[i].fiducials_px) {
      double darkest = 0.0;  // a pin may pass between the centres of pixels
      for (const int down : {-1, 0, 1})
        for (const int right : {-1, 0, 1})
          darkest = std::max(
              darkest,
              pins[static_cast<int>(std::lround(pixel.x())) + right +
                   camera.size_px.x() * (static_cast<int>(std::lround(pixel.y())) + down)]);
      EXPECT_GT(darkest, 0.1) << pixel.transpose();
    }
  }
}

TEST_F(MovedT12, WithEveryStressDependsOnTheSeedButNotOnThreads) {
  simulated("--moved-bone L1 --stress all --threads 1", "one");
  simulated("--moved-bone L1 --stress all --threads 3", "three");
  for (const char* name :
       {"front.mha", "side.mha", "study.toml", "truth.toml", "ct.nii.gz", "rig-true.toml"})
    EXPECT_EQ(read_text_file(scratch_ / "one" / name), read_text_file(scratch_ / "three" / name))
        << name;
}

TEST_F(MovedT12, IsAlsoOfOneViewAndOfTheTypicalAdult) {
  rig_.cameras.pop_back();
  write_text_file(scratch_ / "rig.toml", rig_to_toml(rig_));
  EXPECT_EQ(simulated("--moved-bone T9", "one-view").views.size(), 1u);
  arguments_.replace(arguments_.find("--anatomy-seed 7"), 16, "");
  EXPECT_NE(simulated("--moved-bone T12", "typical").note.find("bodies themselves"),
            std::string::npos);
}

TEST_F(AfSimulate, DicomXaStatesTheCameraThatTookIt) {
  // AP as it is stored, left of the image is the patient's right, and the lateral view.
  ASSERT_EQ(run(coarse + "--rig c-arm-12in --xray-format dicom " + folder("dicom")), 0) << log();
  const Study study = read_study(scratch_ / "dicom" / "study.toml");
  const StudyCase& study_case = study.cases[0];
  for (std::size_t i = 0; i < 2; ++i) {
    const fs::path rig = scratch_ / "of-header.toml";
    const std::string xray = study_case.views[i].xray.string();
    ASSERT_EQ(run("'" + xray + "' -o '" + rig.string() + "'", "af-convert"), 0) << log();
    const CameraGeometry of_header = read_rig(rig.string()).cameras.front();
    for (const Eigen::Vector3d& from_center :
         {Eigen::Vector3d(20.0, -10.0, 30.0), Eigen::Vector3d(-5.0, 40.0, -25.0)}) {
      const Eigen::Vector3d in_room =
          study_case.nominal_room_from_ct * (study_case.center_ct_mm + from_center);
      constexpr double kDecimalsPx = 1e-6;  // of the header's lengths and angles
      EXPECT_LT((of_header.project(from_center) - study.rig.cameras[i].project(in_room)).norm(),
                kDecimalsPx)
          << study_case.views[i].camera;
    }
  }
}

}  // namespace
}  // namespace af
