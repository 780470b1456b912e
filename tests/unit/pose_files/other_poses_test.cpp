// SPDX-License-Identifier: Apache-2.0
// Poses in the formats of other programs, each against what its convention says of points.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "geometry/diffdrr_convention.h"
#include "pose_files/autoscoper_pose.h"
#include "pose_files/dicom_items.h"
#include "pose_files/dicom_registration.h"
#include "pose_files/itk_transform.h"
#include "pose_files/pose_file.h"
#include "support/io_checks.h"

namespace af {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using test::message_of;
using testing::AllOf;
using testing::HasSubstr;

/// Products and inverses of rotations, of translations up to 1000 mm.
constexpr double kRoundingMm = 1e-10;
/// Decimal strings of DICOM have 16 characters: 13 digits behind the point of a rotation's element,
/// taken to points 1000 mm away.
constexpr double kDicomMm = 1e-6;

RigidTransform uneven_pose() {
  return pose_from_parameters(
      PoseFrame(), PoseParameters::from_deg_and_mm({11.0, -23.0, 47.0, 101.0, -202.0, 303.0}));
}

/// An oblique CT: 20 x 30 x 40 voxels, all axes of the grid turned.
CtGrid uneven_grid() {
  CtGrid grid;
  grid.size = {20, 30, 40};
  grid.origin_mm = {-12.0, 34.0, -56.0};
  grid.spacing_mm = {0.5, 0.75, 2.0};
  grid.direction = rotation_from_angles({0.1, -0.2, 0.3});
  return grid;
}

CameraGeometry frontal_camera() {
  CameraGeometry camera;
  camera.name = "A";
  camera.source_point = {0.0, -650.0, 0.0};
  camera.detector_origin_point = {-100.0, 370.0, 90.0};
  camera.column_direction = {1.0, 0.0, 0.0};
  camera.row_direction = {0.0, 0.0, -1.0};
  camera.size_px = {200, 180};
  return camera;
}

PoseContext whole_context() {
  PoseContext context;
  context.frame = PoseFrame();
  context.ct_grid = [] { return uneven_grid(); };
  context.rig = [] { return CameraRig{Vector3d::Zero(), {frontal_camera()}}; };
  context.ct_frame_of_reference = [] { return std::string("1.2.3.4"); };
  return context;
}

double distance(const RigidTransform& a, const RigidTransform& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

class OtherPoses : public testing::Test {
 protected:
  RigidTransform read(const std::string& name,
                      const std::string& bytes,
                      const PoseContext& context = whole_context()) {
    test::write_input(folder_ / name, bytes);
    return read_pose(folder_ / name, context);
  }
  PosesInFile read_all(const std::string& name, const std::string& bytes) {
    return read_pose_file(write(name, bytes), whole_context());
  }
  std::filesystem::path write(const std::string& name, const std::string& bytes) {
    test::write_input(folder_ / name, bytes);
    return folder_ / name;
  }

  const RigidTransform pose_ = uneven_pose();

 private:
  test::ScratchFolder folder_;
};

TEST_F(OtherPoses, EveryWrittenFormatReadsBackWhateverTheNameAndIsToldByContent) {
  for (const std::string& format : written_pose_formats()) {
    const std::string bytes = pose_file_bytes(format, {&pose_, 1}, whole_context());
    // One line of 16 numbers is told from a plain matrix by its name alone.
    const std::string name = format == "autoscoper" ? "a.tra" : "pose";
    EXPECT_LT(distance(read(name, bytes), pose_), kDicomMm) << format;
    EXPECT_EQ(format_of_pose_file({name, bytes}).name, format);
  }
}

TEST_F(OtherPoses, EveryFormatSurvivesDamage) {
  for (const std::string& format : written_pose_formats()) {
    const std::string good = pose_file_bytes(format, {&pose_, 1}, whole_context());
    const std::string name = format == "autoscoper" ? "a.tra" : "pose";
    const std::size_t step = good.size() > 1000 ? 37 : 7;
    EXPECT_GT(test::refused_damaged_copies(
                  good, step, 100, [&](const std::string& text) { (void)read(name, text); }),
              20U)
        << format;
  }
}

TEST_F(OtherPoses, FormatsOfSeveralPosesKeepTheirOrder) {
  const std::vector<RigidTransform> poses = {pose_, pose_.inverse(), pose_ * pose_};
  for (const char* format : {"csv", "autoscoper", "diffdrr"}) {
    const PosesInFile found = read_all("poses", pose_file_bytes(format, poses, whole_context()));
    ASSERT_EQ(found.poses.size(), poses.size()) << format;
    for (std::size_t i = 0; i < poses.size(); ++i)
      EXPECT_LT(distance(found.poses[i].room_from_ct, poses[i]), kRoundingMm) << format;
    EXPECT_THROW(read("poses", pose_file_bytes(format, poses, whole_context())), InputError);
  }
  for (const char* format : {"itk", "itk-hdf5", "dicom", "toml", "matrix"})
    EXPECT_THROW(pose_file_bytes(format, poses, whole_context()), InputError) << format;
  EXPECT_THROW(pose_file_bytes("json", poses, whole_context()), InputError);
}

TEST_F(OtherPoses, FormatsThatNeedTheCtOrTheCameraSayWhatIsMissing) {
  const std::string tra = pose_file_bytes("autoscoper", {&pose_, 1}, whole_context());
  EXPECT_THAT(message_of<InputError>([&] { read("a.tra", tra, {}); }), HasSubstr("--ct"));
  const std::string diffdrr = pose_file_bytes("diffdrr", {&pose_, 1}, whole_context());
  EXPECT_THAT(message_of<InputError>([&] { read("p", diffdrr, {}); }), HasSubstr("--rig"));
  EXPECT_THAT(message_of<InputError>([&] {
                read("p.csv", "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n1,2,3,4,5,6\n", {});
              }),
              HasSubstr("nominal"));
}

// itk::Euler3DTransform's documented order: R = Rz Rx Ry, or Rz Ry Rx; all about the centre.
TEST_F(OtherPoses, ItkEulerAnglesTurnAboutTheCentreInItksOrder) {
  const auto text = [](const std::string& fixed) {
    return "#Insight Transform File V1.0\nTransform: Euler3DTransform_double_3_3\n"
           "Parameters: 0.1 0.2 0.3 4 5 6\nFixedParameters: " +
           fixed + "\n";
  };
  const auto about = [](const Vector3d& axis, double angle) {
    return Matrix3d(Eigen::AngleAxisd(angle, axis));
  };
  const Matrix3d x = about(Vector3d::UnitX(), 0.1);
  const Matrix3d y = about(Vector3d::UnitY(), 0.2);
  const Matrix3d z = about(Vector3d::UnitZ(), 0.3);
  const Vector3d center(10.0, 20.0, 30.0);
  const Vector3d point(-7.0, 80.0, 9.0);
  for (const auto& [fixed, rotation] : {std::pair<std::string, Matrix3d>{"10 20 30", z * x * y},
                                        {"10 20 30 0", z * x * y},
                                        {"10 20 30 1", z * y * x}}) {
    const RigidTransform ct_from_room = read("p.tfm", text(fixed)).inverse();
    const Vector3d expected = rotation * (point - center) + center + Vector3d(4.0, 5.0, 6.0);
    EXPECT_LT((ct_from_room * point - expected).norm(), kRoundingMm) << fixed;
  }
}

TEST_F(OtherPoses, ItkQuaternionsAndTranslationsAreRead) {
  // A half angle of 30 degrees about z.
  const RigidTransform turned =
      read("p.tfm",
           "#Insight\nTransform: QuaternionRigidTransform_double_3_3\n"
           "Parameters: 0 0 0.5 0.86602540378443864676 1 2 3\nFixedParameters: 0 0 0\n")
          .inverse();
  EXPECT_LT((turned.linear() - rotation_from_angles({0, 0, 60.0 * kRadPerDeg})).norm(), 1e-14);
  EXPECT_LT((turned.translation() - Vector3d(1, 2, 3)).norm(), kRoundingMm);
  const RigidTransform moved =
      read("p.tfm",
           "#Insight\nTransform: TranslationTransform_double_3_3\nParameters: 1 2 3\n"
           "FixedParameters: \n")
          .inverse();
  EXPECT_LT((moved.translation() - Vector3d(1, 2, 3)).norm(), kRoundingMm);
  EXPECT_TRUE(moved.linear().isIdentity(1e-14));
}

// By hand: the centres of the corner voxels in Autoscoper's frame, as its ray caster has it: the
// box is [0, 1] x [0, 1] x [-1, 0] of the volume's size, y upwards, the stack along -z.
TEST_F(OtherPoses, AutoscopersFrameStandsAtTheLowerLeftCornerOfTheFirstPicture) {
  const CtGrid grid = uneven_grid();
  const RigidTransform ct_from_volume = ct_from_autoscoper_volume(grid);
  EXPECT_LT(
      (ct_from_volume * Vector3d(0.25, 30 * 0.75 - 0.375, -1.0) - grid.point_mm({0, 0, 0})).norm(),
      kRoundingMm);
  EXPECT_LT((ct_from_volume * Vector3d(20 * 0.5 - 0.25, 0.375, -79.0) - grid.point_mm({19, 29, 39}))
                .norm(),
            kRoundingMm);
  CtGrid mirrored = grid;
  mirrored.direction.col(0) *= -1.0;
  EXPECT_THROW(ct_from_autoscoper_volume(mirrored), InputError);
}

TEST_F(OtherPoses, AutoscoperFramesThatWereNotTrackedAreLeftOutAndSaid) {
  const std::string nans = "NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN\n";
  const PosesInFile found =
      read_all("a.tra", nans + pose_file_bytes("autoscoper", {&pose_, 1}, whole_context()) + nans);
  ASSERT_EQ(found.poses.size(), 1U);
  EXPECT_EQ(found.poses[0].number, 2);
  EXPECT_THAT(found.notes,
              testing::ElementsAre(
                  AllOf(HasSubstr("a.tra: 2 of 3 frames"), testing::EndsWith("left out: 1, 3"))));
  EXPECT_THROW(read("a.tra", nans), InputError);
  EXPECT_THROW(read("a.tra", "NaN 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"), FileError);
  EXPECT_THAT(
      message_of<InputError>([&] { read("a.tra", "2 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n" + nans); }),
      HasSubstr("frame 1"));
}

TEST_F(OtherPoses, StartsAreRefusedWhereAFrameBeforeTheLastPoseHasNone) {
  const std::string nans = "NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN\n";
  const std::string one = pose_file_bytes("autoscoper", {&pose_, 1}, whole_context());
  const std::filesystem::path path = write("a.tra", one + nans + one);
  std::vector<std::string> notes;
  EXPECT_EQ(read_poses(path, whole_context(), &notes).size(), 2U);
  EXPECT_THAT(notes, testing::ElementsAre(testing::EndsWith("left out: 2")));
  EXPECT_THAT(message_of<InputError>([&] { read_unbroken_poses(path, whole_context()); }),
              AllOf(HasSubstr("a.tra"), HasSubstr("frame 2")));
  // What is missing at the end moves no other frame.
  notes.clear();
  const std::filesystem::path cut = write("b.tra", one + one + nans);
  EXPECT_EQ(read_unbroken_poses(cut, whole_context(), &notes).size(), 2U);
  EXPECT_THAT(notes, testing::ElementsAre(testing::EndsWith("left out: 3")));
}

TEST_F(OtherPoses, DiffDrrsPoseOfSeveralCamerasIsRefusedUntilOneIsNamed) {
  PoseContext context = whole_context();
  context.rig = [] {
    CameraGeometry other = frontal_camera();
    other.name = "B";
    return CameraRig{Vector3d::Zero(), {frontal_camera(), other}};
  };
  EXPECT_THAT(message_of<InputError>([&] {
                pose_file_bytes("diffdrr", {&pose_, 1}, context);
              }),
              HasSubstr("--camera"));
}

// DiffDRR's first example: no rotation, 850 mm along y, AP: the source stands 850 mm in front of
// the patient, whose head is up and whose right side is on the picture's left.
TEST_F(OtherPoses, DiffDrrsApViewLooksAtThePatientFromTheFront) {
  DiffDrrPose pose;
  pose.rotation = {0.0, 0.0, 0.0};
  pose.translation_mm = {0.0, 850.0, 0.0};
  const RigidTransform world_from_camera = world_from_diffdrr_camera(pose);
  EXPECT_LT((world_from_camera.translation() - Vector3d(0, 850, 0)).norm(), kRoundingMm);
  const Vector3d anterior(0, 1, 0);
  const Vector3d right(1, 0, 0);
  const Vector3d head(0, 0, 1);
  EXPECT_LT((world_from_camera.linear().col(2) + anterior).norm(), 1e-14);  // the beam
  EXPECT_LT((-world_from_camera.linear().col(0) + right).norm(), 1e-14);    // of columns
  EXPECT_LT((-world_from_camera.linear().col(1) + head).norm(), 1e-14);     // of rows
  // The translation turns with the camera: a quarter about z puts the source to the patient's left.
  pose.rotation = {std::numbers::pi / 2.0, 0.0, 0.0};
  EXPECT_LT((world_from_diffdrr_camera(pose).translation() - Vector3d(-850, 0, 0)).norm(),
            kRoundingMm);
}

TEST_F(OtherPoses, DiffDrrPosesProjectTheCtsMiddleWhereTheCameraDoes) {
  const RigidTransform pose =
      read("p.toml",
           "diffdrr_parameterization = \"euler_angles\"\nrotation_rad = [[0.0, 0.0, 0.0]]\n"
           "translation_mm = [[10.0, 650.0, -20.0]]\n");
  // The camera's source is 650 mm before the room's origin; the CT's middle is 10 mm to the
  // patient's left of the beam (room +x) and 20 mm above it.
  const Vector3d middle = pose * uneven_grid().center_mm();
  EXPECT_LT((middle - Vector3d(10.0, 0.0, 20.0)).norm(), kRoundingMm) << middle.transpose();
  // Patient axes: left is +x, posterior +y, head +z, as in the room of a supine patient.
  EXPECT_TRUE(pose.linear().isIdentity(1e-14));
}

TEST_F(OtherPoses, DiffDrrAnglesOfEveryOrderComeBack) {
  const Vector3d angles(0.3, -0.4, 0.5);
  for (const char* convention : {"XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"}) {
    DiffDrrPose pose;
    pose.convention = convention;
    pose.orientation = "none";
    pose.rotation = {angles[0], angles[1], angles[2]};
    const Matrix3d rotation = world_from_diffdrr_camera(pose).linear();
    EXPECT_LT((angles_of_convention(rotation, convention) - angles).norm(), 1e-13) << convention;
    // At and beside gimbal lock the angles are not unique, or poorly known; the rotation is both.
    for (const double beside_rad : {0.0, 1e-15, 1e-13, 1e-9, 1e-5})
      for (const double quarter : {-std::numbers::pi / 2.0, std::numbers::pi / 2.0}) {
        pose.rotation = {0.3, quarter - beside_rad, 0.5};
        const Matrix3d locked = world_from_diffdrr_camera(pose).linear();
        const Vector3d found = angles_of_convention(locked, convention);
        pose.rotation = {found[0], found[1], found[2]};
        EXPECT_LT((world_from_diffdrr_camera(pose).linear() - locked).norm(), 1e-14)
            << convention << " " << quarter << " " << beside_rad;
      }
  }
}

// A camera that looks from the feet to the head stands at gimbal lock of ZXY and AP.
TEST_F(OtherPoses, DiffDrrPosesOfACameraAlongTheBodyKeepTheTurnAboutTheBeam) {
  PoseContext context = whole_context();
  context.rig = [] {
    CameraGeometry camera = frontal_camera();
    camera.source_point = {0.0, 0.0, -650.0};
    camera.detector_origin_point = {-100.0, -90.0, 370.0};
    camera.row_direction = {0.0, 1.0, 0.0};
    return CameraRig{Vector3d::Zero(), {camera}};
  };
  RigidTransform turned = RigidTransform::Identity();
  turned.linear() = rotation_from_angles({0.0, 0.0, 30.0 * kRadPerDeg});
  const std::string bytes = pose_file_bytes("diffdrr", {&turned, 1}, context);
  EXPECT_LT(distance(read("p", bytes, context), turned), kRoundingMm);
}

TEST_F(OtherPoses, DiffDrrFilesWithMistakesAreRefused) {
  const std::string good =
      "diffdrr_parameterization = \"euler_angles\"\nconvention = \"ZXY\"\n"
      "rotation_rad = [[0.0, 0.0, 0.0]]\ntranslation_mm = [[10.0, 650.0, -20.0]]\n";
  EXPECT_NO_THROW(read("p", good));
  for (const auto& [from, to] : {std::pair{"ZXY", "ZZY"},
                                 {"ZXY", "zxy"},
                                 {"\"euler_angles\"", "\"se3\""},
                                 {"650.0, -20.0]]", "650.0]]"},
                                 {"[[10.0", "[[1.0, 2.0, 3.0], [10.0"},
                                 {"convention", "conventoin"}})
    EXPECT_THROW(read("p", test::replaced(good, from, to)), InputError) << to;
  EXPECT_THROW(read("p",
                    "diffdrr_parameterization = \"quaternion\"\nrotation = [[1.0, 1.0, 0, 0]]\n"
                    "translation_mm = [[1.0, 2.0, 3.0]]\n"),
               InputError);
  PoseContext mirrored = whole_context();
  mirrored.rig = [] {
    CameraGeometry camera = frontal_camera();
    camera.column_direction = -camera.column_direction;
    return CameraRig{Vector3d::Zero(), {camera}};
  };
  EXPECT_THAT(test::message_of<InputError>([&] { read("p", good, mirrored); }),
              testing::HasSubstr("must not be mirrored"));
}

TEST_F(OtherPoses, ARegistrationsMatrixTakesTheCtToTheRoom) {
  const std::string bytes = pose_file_bytes("dicom", {&pose_, 1}, whole_context());
  const DicomItem object = dicom_item_of_bytes(bytes, "r.dcm");
  EXPECT_EQ(object.text({0x0008, 0x0060}), "REG");
  const std::vector<DicomItem>& items = object.items({0x0070, 0x0308});
  ASSERT_EQ(items.size(), 2U);
  EXPECT_EQ(items[0].text({0x0020, 0x0052}), object.text({0x0020, 0x0052}));
  EXPECT_EQ(items[1].text({0x0020, 0x0052}), "1.2.3.4");
  const DicomItem& matrix = items[1].items({0x0070, 0x0309}).at(0).items({0x0070, 0x030a}).at(0);
  EXPECT_EQ(matrix.text({0x0070, 0x030c}), "RIGID");
  std::string words = matrix.text({0x3006, 0x00c6});
  for (char& c : words)
    if (c == '\\') c = ' ';
  const std::vector<double> numbers = numbers_of(words, "matrix");
  ASSERT_EQ(numbers.size(), 16U);
  for (int i = 0; i < 16; ++i)
    EXPECT_NEAR(numbers[static_cast<std::size_t>(i)], pose_.matrix()(i / 4, i % 4), 1e-9) << i;
  EXPECT_EQ(bytes, pose_file_bytes("dicom", {&pose_, 1}, whole_context()));
}

/// A registration of the room and these frames: UID, matrix type, matrix (or none).
std::string registration(const std::string& room_uid,
                         const std::vector<std::array<std::string, 3>>& frames) {
  std::vector<std::vector<DicomElementToWrite>> items;
  for (const auto& [uid, type, matrix] : frames) {
    const std::vector<DicomElementToWrite> inner = {{{0x0070, 0x030c}, "CS", type, {}},
                                                    {{0x3006, 0x00c6}, "DS", matrix, {}}};
    std::vector<std::vector<DicomElementToWrite>> matrices;
    if (!matrix.empty()) matrices = {{{{0x0070, 0x030a}, "SQ", "", {inner}}}};
    items.push_back({{{0x0020, 0x0052}, "UI", uid, {}}, {{0x0070, 0x0309}, "SQ", "", matrices}});
  }
  return dicom_file_bytes({{{0x0008, 0x0016}, "UI", "1.2.840.10008.5.1.4.1.1.66.1", {}},
                           {{0x0020, 0x0052}, "UI", room_uid, {}},
                           {{0x0070, 0x0308}, "SQ", "", items}},
                          "1.2.840.10008.5.1.4.1.1.66.1",
                          "1.2.3");
}

TEST_F(OtherPoses, TheFixedFramesOwnMatrixIsTakenOff) {
  // Room to registered: 5 mm along x. CT to registered: a quarter turn about z and 7 mm along y.
  const std::string moved = "1\\0\\0\\5\\0\\1\\0\\0\\0\\0\\1\\0\\0\\0\\0\\1";
  const std::string turned = "0\\-1\\0\\0\\1\\0\\0\\7\\0\\0\\1\\0\\0\\0\\0\\1";
  const RigidTransform pose =
      read("r", registration("1.1", {{"1.2.3.4", "RIGID", turned}, {"1.1", "RIGID", moved}}));
  EXPECT_LT((pose * Vector3d(1, 0, 0) - Vector3d(-5, 8, 0)).norm(), kRoundingMm);
}

TEST_F(OtherPoses, OfARegistrationToTheCtTheRoomsMatrixIsInverted) {
  const std::string identity = "1\\0\\0\\0\\0\\1\\0\\0\\0\\0\\1\\0\\0\\0\\0\\1";
  // Room to CT: a quarter turn about z, then 7 mm along y.
  const std::string turned = "0\\-1\\0\\0\\1\\0\\0\\7\\0\\0\\1\\0\\0\\0\\0\\1";
  const std::array<std::string, 3> room = {"9.9", "RIGID", turned};
  for (const auto& frames : std::vector<std::vector<std::array<std::string, 3>>>{
           {{"1.2.3.4", "RIGID", identity}, room}, {room}}) {
    const RigidTransform pose = read("r", registration("1.2.3.4", frames));
    EXPECT_LT((pose * Vector3d(0, 8, 0) - Vector3d(1, 0, 0)).norm(), kRoundingMm);
  }
}

TEST_F(OtherPoses, WithoutTheCtsFrameTheOneTakenForItIsNamed) {
  const std::string identity = "1\\0\\0\\0\\0\\1\\0\\0\\0\\0\\1\\0\\0\\0\\0\\1";
  const PosesInFile found = read_pose_file(
      write("r", registration("1.1", {{"9.9", "RIGID", identity}, {"1.1", "RIGID", identity}})));
  EXPECT_THAT(found.notes, testing::ElementsAre(AllOf(HasSubstr("9.9"), HasSubstr("--ct"))));
}

TEST_F(OtherPoses, AFrameThatIsNeitherTheCtsNorTheRoomsIsNamed) {
  const std::string identity = "1\\0\\0\\0\\0\\1\\0\\0\\0\\0\\1\\0\\0\\0\\0\\1";
  const std::string moved = "1\\0\\0\\5\\0\\1\\0\\0\\0\\0\\1\\0\\0\\0\\0\\1";
  const PosesInFile found =
      read_all("r", registration("1.1", {{"1.2.3.4", "RIGID", identity}, {"9.9", "RIGID", moved}}));
  EXPECT_THAT(found.notes, testing::ElementsAre(HasSubstr("9.9 is not read")));
}

TEST_F(OtherPoses, RegistrationsThatAreNotOneRigidPoseAreRefused) {
  const std::string identity = "1\\0\\0\\0\\0\\1\\0\\0\\0\\0\\1\\0\\0\\0\\0\\1";
  EXPECT_THAT(
      message_of<InputError>([&] {
        read("r", registration("1.1", {{"7.1", "RIGID", identity}, {"7.2", "RIGID", identity}}));
      }),
      HasSubstr("7.1, 7.2"));
  EXPECT_THROW(read("r", registration("1.1", {{"1.2.3.4", "AFFINE", identity}})), InputError);
  EXPECT_THROW(read("r", registration("1.1", {{"1.2.3.4", "RIGID", "1\\2"}})), FileError);
  EXPECT_THROW(read("r", registration("1.1", {{"1.2.3.4", "RIGID", "2" + identity.substr(1)}})),
               InputError);
  EXPECT_THROW(read("r", registration("1.1", {})), FileError);
  EXPECT_THAT(message_of<FileError>([&] {
                read("r", registration("1.1", {{"1.2.3.4", "RIGID", ""}, {"1.1", "RIGID", ""}}));
              }),
              HasSubstr("no matrix of the frame of reference 1.2.3.4"));
  // Registered to the CT, so that either may be the room.
  EXPECT_THAT(
      message_of<InputError>([&] {
        read("r",
             registration("1.2.3.4", {{"9.8", "RIGID", identity}, {"9.9", "RIGID", identity}}));
      }),
      AllOf(HasSubstr("1.2.3.4"), HasSubstr("9.8, 9.9")));
  EXPECT_THAT(
      message_of<InputError>([&] {
        read("r",
             registration("1.1", {{"1.2.3.4", "RIGID", identity}, {"1.2.3.4", "RIGID", identity}}));
      }),
      HasSubstr("twice"));
  EXPECT_NO_THROW(read("r", registration("1.2.3.4", {{"1.2.3.4", "RIGID", identity}})));
  // Of another CT: taken, and said.
  const PosesInFile found =
      read_all("r", registration("1.1", {{"9.9", "RIGID", identity}, {"1.1", "RIGID", identity}}));
  EXPECT_THAT(found.notes, testing::ElementsAre(HasSubstr("9.9")));
}

}  // namespace
}  // namespace af
