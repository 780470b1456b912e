// SPDX-License-Identifier: Apache-2.0
// What a user meets in af-inspect: what it recognises, what it says, how it ends.
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/build_info.h"
#include "field/field_reading.h"
#include "files/csv_table.h"
#include "geometry/ray_coverage.h"
#include "programs/small_study.h"
#include "study/pose_file.h"
#include "study/rig_file.h"
#include "support/io_checks.h"
#include "support/run_program.h"
#include "support/test_paths.h"
#include "unit/ct/ct_test_data.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::ScratchFolder;
using testing::Contains;
using testing::HasSubstr;

std::string program(const std::string& name) {
  return std::string(AF_PROGRAM_FOLDER "/") + name;
}

test::ProgramRun inspect(const std::string& arguments) {
  return test::run_command(program("af-inspect") + " " + arguments);
}

/// Its standard output alone.
test::ProgramRun json_run(const std::string& arguments) {
  return test::run_command("(" + program("af-inspect") + " --json " + arguments + " 2>/dev/null)");
}

/// The one entry that af-inspect --json gives for a usable path.
json inspect_json(const std::string& path, int exit_code = 0) {
  const test::ProgramRun run = json_run(path);
  EXPECT_EQ(run.exit_code, exit_code) << run.output;
  const json array = json::parse(run.output, nullptr, false);
  EXPECT_TRUE(array.is_array() && array.size() == 1) << run.output;
  return array.is_array() && array.size() == 1 ? array[0] : json::object();
}

void write_bytes(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

TEST(WarningsOfACt, AreToldOnceByEveryProgramThatReadsIt) {
  const ScratchFolder folder;
  CtGrid grid = test::small_grid();
  grid.spacing_mm *= 10.0;
  grid.origin_mm = -grid.center_mm();
  test::write_dicom_series(
      test::asymmetric_ct(grid), folder / "ct", [](int slice, test::DicomTestFile& file) {
        file.set_text({0x0028, 0x1053}, "DS", slice == 2 ? "100" : "1");
      });
  const std::string ct = " --ct " + (folder / "ct").string();
  const std::string camera = ct + " --rig c-arm-12in --camera AP";
  for (const std::string& command :
       {program("af-inspect") + " " + (folder / "ct").string(),
        program("af-drr") + camera + " -o " + (folder / "drr.mha").string(),
        program("af-precompute") + camera + " --dry-run -o " + (folder / "f.af.h5").string(),
        program("af-simulate") + ct + " --rig c-arm-12in -o " + (folder / "study").string()}) {
    const test::ProgramRun run = test::run_command(command);
    EXPECT_EQ(run.exit_code, 0) << run.output;
    const std::string warning = "beyond int16 were clamped";
    const std::size_t first = run.output.find(warning);
    EXPECT_NE(first, std::string::npos) << command << run.output;
    EXPECT_EQ(run.output.find(warning, first + 1), std::string::npos) << command << run.output;
  }
}

TEST(AfInspect, TellsACtsGeometryValuesAndContentHash) {
  const ScratchFolder folder;
  CtGrid grid = test::small_grid();
  grid.direction = Eigen::Vector3d(-1, -1, 1).asDiagonal();
  const CtVolume ct = test::asymmetric_ct(grid);
  write_ct(ct, folder / "ct.nii.gz");
  const json entry = inspect_json((folder / "ct.nii.gz").string());
  EXPECT_EQ(entry["kind"], "CT");
  EXPECT_EQ(entry["ok"], true);
  const json& facts = entry["facts"];
  EXPECT_EQ(facts["geometry"]["size_voxels"], json({7, 6, 5}));
  EXPECT_EQ(facts["geometry"]["axes_point_to"], json({"R", "A", "S"}));
  EXPECT_EQ(facts["ct_content_sha256"], identity_of(ct).content_sha256);
  EXPECT_EQ(facts["values"]["min_hu"], -1000);
  // Of 7 x 6 x 5 voxels, those with i < 2 or j < 1 are air: 1 - (5 * 5) / (7 * 6). The position
  // adds at most 93 HU (i + 7 j + 13 k), so air stays below -900.
  EXPECT_DOUBLE_EQ(facts["values"]["share_air_below_-900_hu"].get<double>(), 1.0 - 25.0 / 42.0);
  // From -0.5 to 6.5 voxels of 0.8 mm towards R from -31.25 mm.
  EXPECT_NEAR(facts["geometry"]["right_to_left_mm"][0].get<double>(), -31.25 - 6.5 * 0.8, 1e-4);
  EXPECT_NEAR(facts["geometry"]["right_to_left_mm"][1].get<double>(), -31.25 + 0.5 * 0.8, 1e-4);
  EXPECT_THAT(entry["warnings"].get<std::vector<std::string>>(),
              Contains(HasSubstr("truncated field of view")));
}

TEST(AfInspect, WarnsOfThickSlicesAndOfALeftHandedGrid) {
  const ScratchFolder folder;
  CtGrid grid = test::small_grid();
  grid.spacing_mm.z() = 5.0;
  grid.direction = Eigen::Vector3d(1, 1, -1).asDiagonal();
  write_ct(test::asymmetric_ct(grid), folder / "ct.mha");
  const auto warnings =
      inspect_json((folder / "ct.mha").string())["warnings"].get<std::vector<std::string>>();
  EXPECT_THAT(warnings, Contains(HasSubstr("anisotropic")));
  EXPECT_THAT(warnings, Contains(HasSubstr("left-handed")));
}

TEST(AfInspect, SaysOnceThatValuesAreNoHu) {
  const ScratchFolder folder;
  CtVolume raw = test::asymmetric_ct(test::small_grid());
  std::vector<std::int16_t> values(raw.hu.view().begin(), raw.hu.view().end());
  for (std::int16_t& value : values) value = static_cast<std::int16_t>(value + 1024);
  raw.hu = SharedArray<std::int16_t>(std::move(values));
  write_ct(raw, folder / "raw.mha");
  const auto warnings =
      inspect_json((folder / "raw.mha").string())["warnings"].get<std::vector<std::string>>();
  EXPECT_THAT(warnings, testing::ElementsAre(HasSubstr("do not look like HU")));
}

TEST(AfInspect, RefusesADicomFolderWithTwoSeriesUntilOneIsChosen) {
  const ScratchFolder folder;
  const CtVolume ct = test::asymmetric_ct(test::small_grid());
  test::write_dicom_series(ct, folder / "dicom", {}, "1.2.3.4", "A");
  test::write_dicom_series(ct, folder / "dicom", {}, "1.2.3.5", "B");
  const test::ProgramRun run = inspect((folder / "dicom").string());
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_THAT(run.output, HasSubstr("1.2.3.5  5 slices"));
  const json entry = inspect_json("--series 1.2.3.5 " + (folder / "dicom").string());
  EXPECT_EQ(entry["facts"]["ct_content_sha256"], identity_of(ct).content_sha256);
}

TEST(AfInspect, KnowsUnfinishedWork) {
  const ScratchFolder folder;
  std::filesystem::create_directories(folder / "f.h5.progress");
  // The recorded options may be long, and may come before the format.
  std::ofstream(folder / "f.h5.progress" / "units.json")
      << R"({"decides": {"seed": ")" << std::string(10000, '1')
      << R"("}, "format": "af-progress-journal", "format_version": 4, "plan": 1})";
  const test::ProgramRun run = inspect((folder / "f.h5.progress").string());
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_NE(run.output.find("unfinished work"), std::string::npos) << run.output;
}

TEST(AfInspect, TellsImagesStacksAndCtsApart) {
  const ScratchFolder folder;
  Image2d image(4, 3);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = 0.25f * static_cast<float>(i);
  write_image(image, folder / "drr.mha", 0.5, 0.75);
  write_image_stack({image, image}, folder / "stack.nrrd", 0.5, 0.75);
  write_image_stack({image, image}, folder / "stack.tif", 0.5, 0.75);
  write_png_image(image, folder / "drr.png", 0, 3);
  const json drr = inspect_json((folder / "drr.mha").string());
  EXPECT_EQ(drr["kind"], "X-ray or DRR image");
  EXPECT_EQ(drr["facts"]["columns_rows"], json({4, 3}));
  EXPECT_EQ(drr["facts"]["pixel_spacing_mm"], json({0.5, 0.75}));
  EXPECT_EQ(drr["facts"]["values"]["max"], 2.75);
  EXPECT_EQ(inspect_json((folder / "drr.png").string())["kind"], "X-ray or DRR image");
  for (const char* name : {"stack.nrrd", "stack.tif"}) {
    const json stack = inspect_json((folder / name).string());
    EXPECT_EQ(stack["kind"], "image stack") << name;
    EXPECT_EQ(stack["facts"]["columns_rows_images"], json({4, 3, 2})) << name;
  }
}

TEST(AfInspect, DescribesRigsByNameAndFileAndWarnsOfMirroredOnes) {
  const ScratchFolder folder;
  const json shipped = inspect_json("c-arm-12in");
  EXPECT_EQ(shipped["kind"], "rig");
  EXPECT_EQ(shipped["facts"]["cameras"][0]["source_detector_distance_mm"], 1020.0);
  EXPECT_EQ(shipped["facts"]["angles_between_beams_deg"][0]["angle_deg"], 90.0);
  std::string text = builtin_rig_text("c-arm-12in");
  const std::string right = "column_direction = [1.0, 0.0, 0.0]";
  ASSERT_NE(text.find(right), std::string::npos);
  text.replace(text.find(right), right.size(), "column_direction = [-1.0, 0.0, 0.0]");
  write_bytes(folder / "rig.toml", text);
  const auto warnings =
      inspect_json((folder / "rig.toml").string())["warnings"].get<std::vector<std::string>>();
  EXPECT_THAT(warnings, Contains(HasSubstr("mirrored")));
}

TEST(AfInspect, RefusesFilesOfOtherProgramsWithTheCommandThatConvertsThem) {
  const ScratchFolder folder;
  write_bytes(folder / "cam.txt", "image size\n1024,768\n");
  write_bytes(folder / "pose.toml", "diffdrr_parameterization = \"quaternion\"\n");
  for (const char* name : {"cam.txt", "pose.toml"}) {
    const std::string path = (folder / name).string();
    const test::ProgramRun run = inspect(path);
    EXPECT_EQ(run.exit_code, 3) << run.output;
    EXPECT_THAT(run.output, HasSubstr("af-convert " + path + " -o "));
  }
}

TEST(AfInspect, RecognisesPosesTablesAndResults) {
  const ScratchFolder folder;
  const RigidTransform pose(Eigen::Translation3d(1, 2, 3));
  write_bytes(folder / "pose.toml", pose_to_toml(pose));
  write_bytes(folder / "pose.tfm", pose_to_itk_transform(pose));
  for (const char* name : {"pose.toml", "pose.tfm"}) {
    const json entry = inspect_json((folder / name).string());
    EXPECT_EQ(entry["kind"], "pose") << name;
    EXPECT_EQ(entry["facts"]["room_from_ct"][1], json({0.0, 1.0, 0.0, 2.0})) << name;
  }
  write_bytes(folder / "image-quality.csv",
              "pose_index,rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm,psnr_db\n"
              "0,1,2,3,4,5,6,43.5\n1,1,2,3,4,5,6,inf\n2,1,2,3,4,5,6,41.5\n3,0,0,0,0,0,0,45\n");
  const json quality = inspect_json((folder / "image-quality.csv").string());
  EXPECT_EQ(quality["kind"], "image quality");
  EXPECT_EQ(quality["facts"]["poses"], 4);
  EXPECT_EQ(quality["facts"]["with_finite_psnr"], 3);
  EXPECT_EQ(quality["facts"]["median_psnr_db"], 43.5);
  EXPECT_EQ(quality["facts"]["min_psnr_db"], 41.5);
  write_bytes(folder / "registrations.csv",
              "case,start_index,renderer,tre_mm,stop_reason\n"
              "a,0,field,0.5,step-below-final\na,1,field,9,left-range\na,2,field,nan,failed\n");
  const json rows = inspect_json((folder / "registrations.csv").string());
  EXPECT_EQ(rows["kind"], "registrations");
  EXPECT_EQ(rows["facts"]["rows_by"]["stop_reason"]["left-range"], 1);
  EXPECT_EQ(rows["facts"]["tre_below_2.5_mm"], 1);
  write_bytes(folder / "poses.csv", "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n1,2,3,4,5,6\n");
  EXPECT_EQ(inspect_json((folder / "poses.csv").string())["kind"], "poses");
  write_bytes(folder / "summary.json",
              R"({"format": "attenuation-fields evaluation", "provenance": {"seed": 7}})");
  const json summary = inspect_json((folder / "summary.json").string());
  EXPECT_EQ(summary["kind"], "attenuation-fields evaluation");
  EXPECT_EQ(summary["facts"]["provenance"]["seed"], 7);
  // The folder that holds all of these.
  const json all = inspect_json(folder.path().string());
  EXPECT_EQ(all["kind"], "folder of results");
  EXPECT_EQ(all["items"].size(), 5u);
}

TEST(AfInspect, SaysWhatItTriedWhenNothingFits) {
  const ScratchFolder folder;
  write_bytes(folder / "noise.bin", std::string("\x01\x02\x00\xff rubbish", 12));
  write_bytes(folder / "empty", "");
  write_bytes(folder / "shot.dcm", "\xff\xd8\xff\xe0 a JPEG picture under another name");
  fs::create_directory(folder / "folder");
  write_bytes(folder / "other.json", R"({"a": 1})");
  write_bytes(folder / "other.csv", "a,b\n1,2\n");
  write_bytes(folder / "cut.json", R"({"format": "attenu)");
  for (const auto& [name, code, message] :
       {std::tuple("noise.bin", 4, "not recognised; tried: DICOM folder"),
        std::tuple("empty", 4, "not recognised (it is empty)"),
        std::tuple("shot.dcm", 4, "not recognised (it begins as a JPEG picture does)"),
        std::tuple("folder", 4, "not recognised (the folder is empty)"),
        std::tuple("none", 4, "does not exist"),
        std::tuple("other.json", 3, "no result of this project"),
        std::tuple("other.csv", 3, "none of registrations.csv"),
        std::tuple("cut.json", 4, "cut short")}) {
    const test::ProgramRun run = inspect((folder / name).string());
    EXPECT_EQ(run.exit_code, code) << name << ": " << run.output;
    EXPECT_THAT(run.output, HasSubstr(message));
    EXPECT_THAT(run.output, HasSubstr("NOT USABLE"));
  }
}

TEST(AfInspect, NamesTheStudysLineOfAFileThatIsGone) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  fs::remove(folder / "LAT.mha");
  const test::ProgramRun run = inspect((folder / "study.toml").string());
  EXPECT_EQ(run.exit_code, 4);
  EXPECT_THAT(run.output, testing::ContainsRegex("study.toml:[0-9]+: case.0..view.1..xray: "));
}

TEST(AfInspect, TakesAStudyWhoseFieldsAreStillToBeMade) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  Study study = read_study(folder / "study.toml");
  study.cases[0].views[1].field = folder / "LAT.af.h5";
  write_text_file(folder / "study.toml", study_to_toml(study, folder.path()));
  const json entry = inspect_json((folder / "study.toml").string());
  EXPECT_EQ(entry["ok"], true);
  ASSERT_EQ(entry["warnings"].size(), 1u);
  EXPECT_THAT(entry["warnings"][0].get<std::string>(), HasSubstr("LAT.af.h5 does not exist yet"));
}

TEST(AfInspect, RefusesAStudyWhoseTargetLiesOutsideTheCt) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  Study study = read_study(folder / "study.toml");
  study.cases[0].target_box_ct = {{-20, -20, 60}, {20, 20, 80}};
  study.cases[0].nominal_room_from_ct.translation().z() = -70;
  write_text_file(folder / "study.toml", study_to_toml(study, folder.path()));
  for (const char* more : {"", " --pictures "}) {
    const std::string pictures = *more == '\0' ? "" : more + (folder / "pictures").string();
    const test::ProgramRun run = inspect((folder / "study.toml").string() + pictures);
    EXPECT_EQ(run.exit_code, 3) << run.output;
    EXPECT_THAT(run.output, HasSubstr("case[0].target_box_ct_mm: [[-20.0, -20.0, 60.0], "));
    EXPECT_THAT(run.output, HasSubstr("z -48.0 to 48.0 mm"));
  }
}

TEST(AfInspect, DrawsPicturesOfACtAndOfAStudy) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  const std::string to = " --pictures " + (folder / "pictures").string();
  ASSERT_EQ(inspect((folder / "ct.nii.gz").string() + to).exit_code, 0);
  EXPECT_TRUE(fs::exists(folder / "pictures" / "ct-ct.png"));
  const test::ProgramRun run = inspect((folder / "study.toml").string() + to);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, testing::Not(HasSubstr("LOOK")));
  for (const char* name : {"AP", "LAT", "room", "ct", "ct-axial"})
    EXPECT_TRUE(fs::exists(folder / "pictures" / ("ellipsoids-" + std::string(name) + ".png")));
}

int png_width(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  file.seekg(16);
  int width = 0;
  for (int i = 0; i < 4; ++i) width = 256 * width + file.get();
  return width;
}

// The marks are so rough that the pose found from the nominal one differs from it only by rounding.
TEST(AfInspect, DrawsOneDrrWhereRoughLandmarksGiveTheNominalPose) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  const std::string to = " --pictures " + (folder / "pictures").string();
  const fs::path picture = folder / "pictures" / "ellipsoids-AP.png";
  ASSERT_EQ(inspect((folder / "study.toml").string() + to).exit_code, 0);
  const int width = png_width(picture);
  Study study = read_study(folder / "study.toml");
  StudyCase& only = study.cases[0];
  only.landmarks_ct_mm = {{-30, 20, 10}, {25, -35, 30}, {5, 30, -30}};
  for (StudyView& view : only.views) {
    double off_px = 5.0;
    for (const Eigen::Vector3d& point : only.landmarks_ct_mm)
      view.landmarks_px.emplace_back(study.rig.camera(view.camera).project(point) +
                                     Eigen::Vector2d(off_px *= -1.3, 4.0));
  }
  const std::regex nominal("nominal_room_from_ct = [^\n]*\n");
  write_text_file(folder / "study.toml",
                  std::regex_replace(study_to_toml(study, folder.path()), nominal, ""));
  const test::ProgramRun run = inspect((folder / "study.toml").string() + to);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("(RMS): rough: "));
  EXPECT_EQ(png_width(picture), width);
}

// The target and the CT's air are in the beam; the anatomy is 400 mm beside it.
TEST(AfInspect, RefusesAnEmptyDrrByNameAndDrawsIt) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  CtVolume ct;
  ct.grid.size = {60, 20, 20};
  ct.grid.spacing_mm = Eigen::Vector3d::Constant(10.0);
  ct.grid.origin_mm = {-95.0, -95.0, -95.0};
  std::vector<std::int16_t> hu(ct.grid.voxel_count(), -1000);
  for (std::size_t i = 55; i < hu.size(); i += 60) hu[i] = 500;
  ct.hu = SharedArray<std::int16_t>(std::move(hu));
  write_ct(ct, folder / "ct.nii.gz");
  const test::ProgramRun run =
      inspect((folder / "study.toml").string() + " --pictures " + (folder / "pictures").string());
  EXPECT_EQ(run.exit_code, 3) << run.output;
  EXPECT_THAT(run.output, HasSubstr("LOOK: camera AP: the DRR at the nominal pose is empty"));
  EXPECT_THAT(run.output, HasSubstr("case 'ellipsoids', camera 'AP': the DRR at the nominal pose"));
  EXPECT_TRUE(fs::exists(folder / "pictures" / "ellipsoids-room.png"));
}

TEST(AfInspect, ListsAnglesOfCamerasThatLookAtTheSamePatient) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  Study study = read_study(folder / "study.toml");
  CameraGeometry third = study.rig.cameras[0];
  third.name = "other";
  study.rig.cameras.push_back(third);
  write_text_file(folder / "rig.toml", rig_to_toml(study.rig));
  StudyCase other = study.cases[0];
  other.name = "second";
  other.views.erase(other.views.begin() + 1);
  other.views[0].camera = "other";
  study.cases.push_back(other);
  write_text_file(folder / "study.toml", study_to_toml(study, folder.path()));
  const json angles =
      inspect_json((folder / "study.toml").string())["facts"]["rig"]["angles_between_beams_deg"];
  ASSERT_EQ(angles.size(), 1u);
  EXPECT_EQ(angles[0]["cameras"], json::array({"AP", "LAT"}));
}

TEST(AfInspect, ListsWhereTheGoldPoseOfEveryCaseIsFrom) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  Study study = read_study(folder / "study.toml");
  study.cases.resize(3, study.cases.front());
  study.cases[1].name = "without";
  study.cases[1].gold_room_from_ct.reset();
  study.cases[2].name = "pins";
  study.cases[2].fiducials_ct_mm = {{20, 5, -8}, {-25, 10, 3}, {4, -22, 18}};
  for (StudyView& view : study.cases[2].views)
    for (const Eigen::Vector3d& point : study.cases[2].fiducials_ct_mm)
      view.fiducials_px.push_back(
          study.rig.camera(view.camera).project(*study.cases[2].gold_room_from_ct * point));
  write_text_file(folder / "study.toml", study_to_toml(study, folder.path()));
  EXPECT_EQ(inspect("--list-views " + (folder / "study.toml").string()).output,
            "ellipsoids\tAP\tstudy\nellipsoids\tLAT\tstudy\n"
            "without\tAP\tnone\nwithout\tLAT\tnone\n"
            "pins\tAP\tfiducials\npins\tLAT\tfiducials\n");
}

TEST(AfInspect, SaysThatARegionWithoutRoiIsAboutTheTargetBox) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  Study study = read_study(folder / "study.toml");
  std::vector<StudyView>& views = study.cases.front().views;
  views[0].roi = {6, 8, 30, 36};
  views[1].is_roi_stated = false;
  write_text_file(folder / "study.toml", study_to_toml(study, folder.path()));
  const std::string path = (folder / "study.toml").string();
  const json found = inspect_json(path)["facts"]["cases"][0]["views"];
  EXPECT_EQ(found[0]["roi_px"], json({6, 8, 30, 36}));
  EXPECT_FALSE(found[0].contains("region"));
  EXPECT_FALSE(found[1].contains("roi_px"));
  const std::string text = inspect(path).output;
  EXPECT_THAT(text, HasSubstr("roi px: 6, 8, 30, 36\n"));
  EXPECT_THAT(text, HasSubstr("region: the target box and a quarter of its sides"));
}

TEST(AfInspect, PrintsATemplateThatItAccepts) {
  const ScratchFolder folder;
  const test::ProgramRun printed = inspect("--template rig");
  ASSERT_EQ(printed.exit_code, 0);
  write_bytes(folder / "rig.toml", printed.output);
  EXPECT_EQ(inspect((folder / "rig.toml").string()).exit_code, 0);
  EXPECT_THAT(inspect("--template study").output, HasSubstr("[[case.view]]"));
  EXPECT_EQ(inspect("--template patient").exit_code, 2);
  EXPECT_EQ(inspect("").exit_code, 2);
}

TEST(AfInspect, EndsWithTheWorstCodeButReportsEveryPath) {
  const ScratchFolder folder;
  write_bytes(folder / "pose.toml",
              "room_from_ct = [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]");  // not rigid
  const std::string paths = "treatment-room " + (folder / "pose.toml").string() + " " +
                            (folder / "none").string() + " c-arm-12in";
  const test::ProgramRun run = json_run(paths);
  EXPECT_EQ(run.exit_code, 4);
  const json array = json::parse(run.output);
  ASSERT_EQ(array.size(), 4u);
  EXPECT_EQ(array[0]["exit_code"], 0);
  EXPECT_EQ(array[1]["exit_code"], 3);
  EXPECT_EQ(array[2]["exit_code"], 4);
  EXPECT_EQ(array[3]["ok"], true);
  EXPECT_EQ(inspect("").exit_code, 2);
  EXPECT_EQ(inspect("--no-such-option x").exit_code, 2);
}

TEST(AfInspect, VerifiesAFieldAndAStudyAndSeesDamage) {
  const ScratchFolder folder;
  test::write_small_study(folder.path());
  const std::string study = (folder / "study.toml").string();
  const json study_entry = inspect_json(study);
  EXPECT_EQ(study_entry["kind"], "study");
  EXPECT_EQ(study_entry["facts"]["cases"][0]["views"].size(), 2u);
  EXPECT_EQ(inspect("--list-views " + study).output,
            "ellipsoids\tAP\tstudy\nellipsoids\tLAT\tstudy\n");
  std::string inputs;
  for (const char* name : {"ct.nii.gz", "rig.toml", "AP.mha", "LAT.mha"})
    inputs += "ellipsoids\t" + (folder / name).string() + "\n";
  EXPECT_EQ(inspect("--list-inputs " + study).output, inputs);

  const fs::path field = folder / "AP.af.h5";
  const test::ProgramRun made = test::run_command(
      program("af-precompute") + " --study " + study +
      " --camera AP --max-rotation-deg 4 --max-translation-mm 8 --uv-nodes 6 --st-nodes 24"
      " --codewords 16 -o " +
      field.string());
  ASSERT_EQ(made.exit_code, 0) << made.output;
  const json facts = inspect_json(field.string())["facts"];
  EXPECT_EQ(facts["checksums"], "verified");
  EXPECT_EQ(facts["payload_sha256"].get<std::string>().size(), 64u);
  EXPECT_EQ(facts["camera"]["name"], "AP");
  EXPECT_EQ(facts["codewords"], 16);
  EXPECT_EQ(facts["ct_content_sha256"],
            inspect_json((folder / "ct.nii.gz").string())["facts"]["ct_content_sha256"]);
  EXPECT_EQ(facts["ct_grid"]["size_voxels"], json(test::five_ellipsoids().grid.size));
  // 6 x 6 viewpoints of 24 x 24 rays, 2 bytes each, in MB of 10^6 bytes.
  EXPECT_DOUBLE_EQ(facts["sizes"]["uncompressed_mb"].get<double>(), 2 * 36 * 576 / 1e6);
  EXPECT_DOUBLE_EQ(facts["sizes"]["file_mb"].get<double>(),
                   static_cast<double>(fs::file_size(field)) / 1e6);
  EXPECT_EQ(facts["provenance"]["source_version"], std::string(program_version()));
  EXPECT_GE(facts["provenance"]["details"]["training"]["iterations"].get<int>(), 1);

  const auto run_precompute = [&](const std::string& more) {
    return test::run_command(program("af-precompute") + " --study " + study +
                             " --camera AP --max-rotation-deg 4 --max-translation-mm 8"
                             " --uv-nodes 6 --st-nodes 24 --codewords 16 " +
                             more + " -o " + (folder / "both.af.h5").string());
  };
  // For ranges per axis, and ranges about poses, the file holds the bounds.
  const fs::path bounded = folder / "bounded.af.h5";
  std::ofstream(folder / "poses.csv") << "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n"
                                         "0,0,0,0,0,0\n1,0,-3,0,5,0\n";
  const test::ProgramRun made_bounded = test::run_command(
      program("af-precompute") + " --study " + study +
      " --camera AP --max-rotation-deg 2 --max-translation-mm 4 --rotation-range-deg rz=-5:1"
      " --cover " +
      (folder / "poses.csv").string() + " --uv-nodes 6 --st-nodes 24 --codewords 16 -o " +
      bounded.string());
  ASSERT_EQ(made_bounded.exit_code, 0) << made_bounded.output;
  EXPECT_EQ(inspect_json(bounded.string())["facts"]["range"],
            "rx -2 to 3 ry -2 to 2 rz -8 to 1 degrees, tx -4 to 4 ty -4 to 9 tz -4 to 4 mm");
  EXPECT_FALSE(facts.contains("range"));

  // The field is to hold the rays of a second camera, too, which it would not otherwise hold over
  // this range.
  CameraRig rig = read_rig((folder / "rig.toml").string());
  for (CameraGeometry& camera : rig.cameras) camera.source_point.x() += 20.0;
  std::ofstream(folder / "moved.toml") << rig_to_toml(rig);
  EXPECT_EQ(run_precompute("--cover-rig " + (folder / "moved.toml").string()).exit_code, 3)
      << "LAT looks from across";
  rig.cameras.resize(1);
  std::ofstream(folder / "moved.toml") << rig_to_toml(rig);
  const test::ProgramRun covers_both =
      run_precompute("--cover-rig " + (folder / "moved.toml").string());
  ASSERT_EQ(covers_both.exit_code, 0) << covers_both.output;
  const CompressedAttenuationField both = read_field_header(folder / "both.af.h5");
  EXPECT_TRUE(
      covers_range(both.light_slab, rig.cameras[0], both.identity.frame, both.identity.range));
  EXPECT_FALSE(covers_range(read_field_header(field).light_slab,
                            rig.cameras[0],
                            both.identity.frame,
                            both.identity.range));

  // When the study names the field, af-inspect says what the field covers: its own range, for its
  // own camera and region.
  std::ifstream lines(study);
  std::string text((std::istreambuf_iterator<char>(lines)), {});
  const std::size_t at = text.find("xray = ");
  ASSERT_NE(at, std::string::npos);
  text.insert(at, "field = \"AP.af.h5\"\n");
  std::ofstream(study) << text;
  const test::ProgramRun covered = inspect(study);
  EXPECT_EQ(covered.exit_code, 0) << covered.output;
  EXPECT_THAT(covered.output, HasSubstr("field camera: the nominal camera"));
  EXPECT_THAT(covered.output, HasSubstr("field covers 100 % of camera AP's rays within"));

  fs::resize_file(field, fs::file_size(field) / 2);
  EXPECT_EQ(inspect(field.string()).exit_code, 4);
  // A study is sound even when its field is not, but af-inspect reports the field.
  const test::ProgramRun halved = inspect(study);
  EXPECT_EQ(halved.exit_code, 0) << halved.output;
  EXPECT_THAT(halved.output, HasSubstr("cannot be used"));
  fs::remove(folder / "LAT.mha");
  const test::ProgramRun broken = inspect(study);
  EXPECT_EQ(broken.exit_code, 4);
  EXPECT_THAT(broken.output, HasSubstr("LAT.mha"));
}

}  // namespace
}  // namespace af
