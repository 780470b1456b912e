// SPDX-License-Identifier: Apache-2.0
// Fields corrected by measured projections, made as a user would: from a simulated cone-beam scan
// and its reconstruction. Plain and corrected fields are judged by views that nothing was fitted
// to.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/csv_table.h"
#include "files/output_file.h"
#include "support/run_program.h"
#include "support/test_paths.h"
#include "xray/image_file.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr const char* kRig = R"(isocenter_point = [0.0, 0.0, 0.0]
[[camera]]
name = "C"
source_point = [0.0, -700.0, 0.0]
detector_origin_point = [-196.875, 400.0, 196.875]
column_direction = [1.0, 0.0, 0.0]
row_direction = [0.0, 0.0, -1.0]
pixel_spacing_mm = [6.25, 6.25]
size_px = [64, 64]
)";

std::string program(const std::string& name) {
  return std::string(AF_PROGRAM_FOLDER) + "/" + name;
}

class MeasuredFields : public testing::Test {
 protected:
  /// A scan of the head, its reconstruction and a plain field, once for all tests.
  static void SetUpTestSuite() {
    scratch_ = std::make_unique<test::ScratchFolder>();
    write_text_file(path("rig.toml"), kRig);
    run(program("af-simulate") + " --phantom head --phantom-voxel-mm 4 --rig " + path("rig.toml") +
        " --cone-beam 96 --elevations-deg 0,3 --elevated-views 2 -o " + path("scan"));
    run(program("af-scan") + " --scan " + path("scan/scan.toml") +
        " --as-stated --write-projections --pairs 1 -o " + path("study"));
    const std::string calibration = read_text_file(path("study/calibration.toml"));
    const std::string key = "water_mu_per_mm = ";
    const std::size_t at = calibration.find(key) + key.size();
    water_ = calibration.substr(at, calibration.find('\n', at) - at);
    plain_hash_ = hash_in(run(precompute("") + " -o " + path("plain.af.h5")).output);
  }
  static void TearDownTestSuite() { scratch_.reset(); }

  static std::string path(const std::string& name) { return (*scratch_ / name).string(); }
  static test::ProgramRun run(const std::string& command, int exit_code = 0) {
    const test::ProgramRun done = test::run_command(command);
    EXPECT_EQ(done.exit_code, exit_code) << command << '\n' << done.output;
    return done;
  }
  static std::string precompute(const std::string& more, const std::string& launcher = "") {
    return launcher + program("af-precompute") + " --ct " + path("study/ct.nii.gz") + " --rig " +
           path("study/projections/rig.toml") +
           " --camera view-001 --max-rotation-deg 8 --max-translation-mm 5 --uv-nodes 12 "
           "--st-nodes 96 --codewords 2048 --look-up cubic --water-mu-per-mm " +
           water_ + " " + more;
  }
  static std::string with_projections(const std::string& study = "study/projections.toml") {
    return " --projections " + path(study) + " --projections-case measured ";
  }
  static std::string hash_in(const std::string& output) {
    return output.substr(output.rfind("sha256 "), 71);
  }
  /// A copy of projections.toml with one text replaced, beside it.
  static std::string edited(const std::string& from, const std::string& to) {
    std::string text = read_text_file(path("study/projections.toml"));
    for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at)) {
      text.replace(at, from.size(), to);
      at += to.size();
    }
    write_text_file(path("study/edited.toml"), text);
    return "study/edited.toml";
  }
  static void expect_refused(int exit_code, const std::string& message, const std::string& study) {
    const test::ProgramRun refused =
        run(precompute(with_projections(study)) + " -o " + path("refused.af.h5"), exit_code);
    EXPECT_THAT(refused.output, HasSubstr(message));
    EXPECT_FALSE(fs::exists(path("refused.af.h5")));
  }

  static std::unique_ptr<test::ScratchFolder> scratch_;
  static std::string water_;
  static std::string plain_hash_;
};

std::unique_ptr<test::ScratchFolder> MeasuredFields::scratch_;
std::string MeasuredFields::water_;
std::string MeasuredFields::plain_hash_;

TEST_F(MeasuredFields, PredictViewsThatWereHeldOutBetterThanTheReconstruction) {
  run(precompute(with_projections()) + " -o " + path("corrected.af.h5"));
  run(program("af-evaluate") + " held-out --study " + path("scan/elevated.toml") + " --field " +
      path("plain.af.h5") + " --field " + path("corrected.af.h5") + " --ct " +
      path("study/ct.nii.gz") + " -o " + path("elevated.md"));
  const CsvTable table = CsvTable::read(path("elevated.csv"));
  std::map<std::pair<std::string, std::string>, double> least;
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    double& value =
        least.try_emplace({table.text(row, "case"), table.text(row, "prediction")}, 99.0)
            .first->second;
    value = std::min(value, table.number(row, "psnr_db"));
  }
  ASSERT_EQ(least.size(), 6U);
  // Between measured views, 7.5 degrees apart, and 3 degrees above them. At 0 and 4 degrees
  // docs/measured-fields.md has 4.9 and 1.9 dB for a scan like this.
  EXPECT_GT(least.at({"elevation-0", "corrected.af.h5"}),
            least.at({"elevation-0", "plain.af.h5"}) + 3.0);
  EXPECT_GT(least.at({"elevation-3", "corrected.af.h5"}),
            least.at({"elevation-3", "plain.af.h5"}) + 2.0);
}

/// Stripes at the same pixels of every view come from the detector.
TEST_F(MeasuredFields, LeaveOutStripesOfTheDetectorWhenTheyAreToldTo) {
  fs::create_directory(path("study/striped"));
  for (int view = 0; view < 96; view += 2) {
    const std::string name = "view-0" + std::string(view < 10 ? "0" : "") + std::to_string(view);
    Image2d image = read_image(path("study/projections/" + name + ".mha"));
    for (int row = 0; row < image.height; ++row)
      for (int column = 0; column < image.width; column += 4) image.at(column, row) += 0.5F;
    write_image(image, path("study/striped/" + name + ".mha"), 6.25, 6.25);
  }
  fs::copy_file(path("study/projections/rig.toml"), path("study/striped/rig.toml"));
  const std::string striped = with_projections(edited("projections/view", "striped/view"));
  const std::string removing = " --projections-common remove";
  const auto field = [](const std::string& name) { return path(name + ".af.h5"); };
  run(precompute(striped) + " -o " + field("striped-kept"));
  run(precompute(striped + removing) + " -o " + field("striped-removed"));
  run(precompute(with_projections() + removing) + " -o " + field("removed"));
  std::string fields;
  for (const char* name : {"plain", "striped-kept", "striped-removed", "removed"})
    fields += " --field " + field(name);
  run(program("af-evaluate") + " held-out --study " + path("scan/elevated.toml") + fields +
      " --case elevation-0 --ct " + path("study/ct.nii.gz") + " -o " + path("stripes.md"));
  const CsvTable table = CsvTable::read(path("stripes.csv"));
  std::map<std::string, double> psnr_db;
  for (std::size_t row = 0; row < table.row_count(); ++row)
    psnr_db[table.text(row, "prediction")] = table.number(row, "psnr_db");
  EXPECT_LT(psnr_db.at("striped-kept.af.h5"), psnr_db.at("plain.af.h5"));
  // Both fields are quantised with codebooks of their own, which costs them tenths of a decibel.
  EXPECT_NEAR(psnr_db.at("striped-removed.af.h5"), psnr_db.at("removed.af.h5"), 0.3);
  EXPECT_GT(psnr_db.at("removed.af.h5"), psnr_db.at("plain.af.h5") + 1.0);
}

TEST_F(MeasuredFields, HaveTheSameBytesOnAnyNumberOfRanks) {
  const std::string one = run(precompute(with_projections()) + " -o " + path("one.af.h5")).output;
  const std::string three =
      run(precompute(with_projections(), AF_MPIEXEC " -n 3 ") + " -o " + path("three.af.h5"))
          .output;
  EXPECT_EQ(hash_in(one), hash_in(three));
  EXPECT_NE(hash_in(one), plain_hash_);
}

TEST_F(MeasuredFields, RefuseProjectionsWithoutAPose) {
  expect_refused(3, "gold_room_from_ct", edited("gold_room_from_ct", "# gold_room_from_ct"));
}

TEST_F(MeasuredFields, RefuseProjectionsOfAnotherPose) {
  // The CT is half a turn about the axis away, and no head looks the same after that.
  expect_refused(3,
                 "must be X-rays of this CT",
                 edited("gold_room_from_ct = [[1.0, 0.0, 0.0, 0.0]",
                        "gold_room_from_ct = [[1.0, 0.0, 0.0, 90.0]"));
}

TEST_F(MeasuredFields, RefuseAMissingATruncatedAndANonFiniteView) {
  const fs::path view = path("study/projections/view-002.mha");
  const fs::path kept = path("kept.mha");
  fs::rename(view, kept);
  expect_refused(4, "view-002.mha", "study/projections.toml");
  fs::copy_file(kept, view);
  fs::resize_file(view, fs::file_size(view) / 2);
  expect_refused(4, "view-002.mha", "study/projections.toml");
  fs::remove(view);
  Image2d image = read_image(kept);
  image.at(10, 10) = std::nanf("");
  write_image(image, view, 6.25, 6.25);
  expect_refused(3, "view-002.mha", "study/projections.toml");
  fs::remove(view);
  fs::rename(kept, view);
}

TEST_F(MeasuredFields, RefuseAScanOfAnotherDetector) {
  const fs::path view = path("study/projections/view-004.mha");
  const fs::path kept = path("kept-004.mha");
  fs::rename(view, kept);
  write_image(Image2d(60, 64), view, 6.25, 6.25);
  expect_refused(3, "must be that of camera 'view-004'", "study/projections.toml");
  fs::rename(kept, view);
}

TEST_F(MeasuredFields, RefuseFieldsOfBone) {
  const test::ProgramRun refused =
      run(precompute(with_projections()) + " --material bone -o " + path("bone.af.h5"), 3);
  EXPECT_THAT(refused.output, HasSubstr("projections"));
}

TEST_F(MeasuredFields, ScansOfCamerasThatLookPastTheIsocentreAreRefused) {
  std::string text = kRig;
  text.replace(text.find("[0.0, -700.0"), 5, "[40.0,");
  write_text_file(path("askew.toml"), text);
  const test::ProgramRun refused =
      run(program("af-simulate") + " --phantom head --rig " + path("askew.toml") +
              " --cone-beam 96 -o " + path("askew"),
          3);
  EXPECT_THAT(refused.output, HasSubstr("must look straight at the rig's isocentre"));
}

}  // namespace
}  // namespace af
