// SPDX-License-Identifier: Apache-2.0
// Looks for leaks that would make simulated registrations look better than they are
// (docs/threats-to-validity.md).
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "ct/ct_reader.h"
#include "files/csv_table.h"
#include "files/output_file.h"
#include "support/run_program.h"
#include "support/test_paths.h"
#include "xray/image_file.h"

namespace af {
namespace {

namespace fs = std::filesystem;

/// Studies of drawn heads seen by two cameras of 96 x 96 pixels of 3.2 mm, registered by ray
/// casting with the preset robust: a second or two each.
class Leaks : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new test::ScratchFolder();
    write_text_file(
        *folder_ / "rig.toml",
        "isocenter_point = [0.0, 0.0, 0.0]\n" +
            camera("AP", "[0.0, -650.0, 0.0]", "[-152.0, 370.0, 152.0]", "[1.0, 0.0, 0.0]") +
            camera("LAT", "[650.0, 0.0, 0.0]", "[-370.0, -152.0, 152.0]", "[0.0, 1.0, 0.0]"));
    simulate("one", "--anatomy-seed 1 --seed 1");
    simulate("other", "--anatomy-seed 2 --seed 1");
    simulate("spine", "--anatomy-seed 2 --seed 3", 3.0, 1.0, "spine");
    simulate("elsewhere", "--anatomy-seed 1 --seed 2");
  }
  static void TearDownTestSuite() { delete folder_; }

  static std::string path(const std::string& name) { return (*folder_ / name).string(); }
  static void simulate(const std::string& name,
                       const std::string& options,
                       double voxel_mm = 3.0,
                       double offset = 1.0,
                       const std::string& phantom = "head") {
    const test::ProgramRun run = test::run_command(
        AF_PROGRAM_FOLDER "/af-simulate --phantom " + phantom + " --rig " + path("rig.toml") +
        " --case head --no-fiducials --roi-px 64 64 --max-offset-rotation-deg " +
        std::to_string(3.0 * offset) + " --max-offset-translation-mm " +
        std::to_string(5.0 * offset) + " --phantom-voxel-mm " + std::to_string(voxel_mm) + " " +
        options + " -o " + path(name));
    ASSERT_EQ(run.exit_code, 0) << run.output;
  }
  /// Registers a study, once, from a start a little off the nominal pose; result.json.
  static nlohmann::json registered(const std::string& name) {
    const std::string output = path(name + "-result");
    if (!fs::exists(output)) {
      const test::ProgramRun run = test::run_command(
          AF_PROGRAM_FOLDER "/af-register --renderer raycast --preset robust --study " +
          path(name + "/study.toml") +
          " --start-rotation-deg 1,-1,2 --start-translation-mm 2,-2,3 -o " + output);
      EXPECT_TRUE(run.exit_code == 0 || run.exit_code == 7) << run.output;
    }
    std::ifstream file(output + "/result.json");
    return nlohmann::json::parse(file);
  }
  /// A copy of study "one" that is changed before it is registered.
  static void copy_one(const std::string& name) {
    fs::copy(path("one"), path(name), fs::copy_options::recursive);
  }
  static void take_xrays_of(const std::string& from, const std::string& to) {
    for (const char* const file : {"/AP.mha", "/LAT.mha"})
      fs::copy_file(path(from) + file, path(to) + file, fs::copy_options::overwrite_existing);
  }

 private:
  static std::string camera(const std::string& name,
                            const std::string& source,
                            const std::string& origin,
                            const std::string& columns) {
    return "[[camera]]\nname = \"" + name + "\"\nsource_point = " + source +
           "\ndetector_origin_point = " + origin + "\ncolumn_direction = " + columns +
           "\nrow_direction = [0.0, 0.0, -1.0]\npixel_spacing_mm = [3.2, 3.2]\nsize_px = [96, "
           "96]\n";
  }

  static inline test::ScratchFolder* folder_ = nullptr;
};

/// With these X-rays, found poses are right to a third of a pixel of 2 mm at the isocentre.
constexpr double kFoundTreMm = 1.0;

TEST_F(Leaks, TheRightXraysAreRegistered) {
  const nlohmann::json result = registered("one");
  EXPECT_GT(result.at("initial_tre_mm").get<double>(), 3.0);
  EXPECT_LT(result.at("tre_mm").get<double>(), kFoundTreMm);
  EXPECT_EQ(result.at("verdict"), "found");
}

/// How much of the X-rays' gradients the pose explains in detail, averaged over the views.
double detail_of(const nlohmann::json& result) {
  double sum = 0.0;
  for (const nlohmann::json& view : result.at("views").at("cameras"))
    sum += view.at("judge_value_fine").get<double>();
  return sum / static_cast<double>(result.at("views").at("cameras").size());
}

TEST_F(Leaks, XraysOfOtherAnatomyAreNotFound) {
  // If the CT leaked into the registration other than through the X-rays, this would register.
  copy_one("spine-for-head");
  take_xrays_of("spine", "spine-for-head");
  EXPECT_EQ(registered("spine-for-head").at("verdict"), "not found");
}

TEST_F(Leaks, XraysOfAnotherPatientFitWorse) {
  // Heads of one model resemble each other, most of all in pixels of 2 mm at the isocentre. Another
  // head's CT can find their pose, but must not fit as well as their own.
  copy_one("swapped");
  take_xrays_of("other", "swapped");
  EXPECT_LT(detail_of(registered("swapped")), 0.8 * detail_of(registered("one")));
}

TEST_F(Leaks, XraysAtAnotherPoseAreFoundThereNotAtTheStudysGoldPose) {
  // If the registration used the study's gold pose, it would end there.
  copy_one("moved");
  take_xrays_of("elsewhere", "moved");
  const nlohmann::json result = registered("moved");
  EXPECT_GT(result.at("tre_mm").get<double>(), 2.0 * kFoundTreMm);  // to the pose of "one"
  const nlohmann::json there = registered("elsewhere");
  EXPECT_LT(there.at("tre_mm").get<double>(), kFoundTreMm);
  EXPECT_EQ(result.at("room_from_ct"), there.at("room_from_ct"));
}

TEST_F(Leaks, TheGoldPoseDoesNotReachTheRegistration) {
  // Another gold pose, or none at all, must give the same end to the last bit.
  const nlohmann::json result = registered("one");
  const std::string study = read_text_file(path("one/study.toml"));
  const std::size_t begin = study.find("gold_room_from_ct");
  ASSERT_NE(begin, std::string::npos);
  const std::size_t end = study.find('\n', begin);
  for (const std::string gold :
       {"", "gold_room_from_ct = [[1, 0, 0, 30], [0, 1, 0, -20], [0, 0, 1, 10], [0, 0, 0, 1]]"}) {
    const std::string name = gold.empty() ? "no-gold" : "wrong-gold";
    copy_one(name);
    fs::remove(path(name + "/truth.toml"));
    std::string text = study;
    write_text_file(path(name + "/study.toml"), text.replace(begin, end - begin, gold));
    EXPECT_EQ(registered(name).at("room_from_ct"), result.at("room_from_ct")) << name;
  }
}

TEST_F(Leaks, AMirroredXrayIsFoundAtAnotherPoseOrNotAtAll) {
  // Nobody would notice a flip that both sides of a simulation share, so only one side is flipped.
  // A head is nearly its own mirror image, and is found elsewhere. A hip is not.
  simulate("pelvis", "--anatomy-seed 1 --seed 1", 3.0, 1.0, "pelvis");
  const double own = detail_of(registered("pelvis"));
  for (const std::string study : {"one", "pelvis"}) {
    const std::string mirrored = "mirrored-" + study;
    fs::copy(path(study), path(mirrored), fs::copy_options::recursive);
    Image2d image = read_image(path(study + "/AP.mha"));
    for (int row = 0; row < image.height; ++row)
      for (int column = 0; 2 * column < image.width; ++column)
        std::swap(image.at(column, row), image.at(image.width - 1 - column, row));
    write_image_u16(image, path(mirrored + "/AP.mha"), 3.2, 3.2);
    const nlohmann::json result = registered(mirrored);
    if (result.at("verdict") == "found") {
      EXPECT_GT(result.at("tre_mm").get<double>(), kFoundTreMm) << study;
    }
    if (study == "pelvis") {
      EXPECT_LT(detail_of(result), 0.8 * own);
    }
  }
}

TEST_F(Leaks, SeedsShareNoNoise) {
  // Two X-rays of one patient at one pose with different seeds have independent noise. Over n
  // pixels the correlation is within 5 / sqrt(n).
  simulate("noise-1", "--anatomy-seed 1 --seed 1", 3.0, 0.0);
  simulate("noise-2", "--anatomy-seed 1 --seed 2", 3.0, 0.0);
  simulate("noiseless", "--anatomy-seed 1 --seed 1 --photons-per-pixel 0 --bits 0", 3.0, 0.0);
  const Image2d mean = read_image(path("noiseless/AP.mha"));
  const Image2d one = read_image(path("noise-1/AP.mha"));
  const Image2d two = read_image(path("noise-2/AP.mha"));
  double both = 0.0;
  double first = 0.0;
  double second = 0.0;
  for (std::size_t i = 0; i < mean.pixels.size(); ++i) {
    const double a = one.pixels[i] - mean.pixels[i];
    const double b = two.pixels[i] - mean.pixels[i];
    both += a * b;
    first += a * a;
    second += b * b;
  }
  EXPECT_GT(first, 0.0);
  EXPECT_LT(std::abs(both) / std::sqrt(first * second),
            5.0 / std::sqrt(static_cast<double>(mean.pixels.size())));
}

TEST_F(Leaks, StartsDependOnTheirSeedAndNotOnThePose) {
  // Starts relative to gold must not tell where gold is. A study at another true pose has the same
  // draws, and another seed has others.
  const auto starts = [&](const std::string& study, int seed) {
    const std::string output = path("starts-" + study + std::to_string(seed));
    const test::ProgramRun run = test::run_command(
        AF_PROGRAM_FOLDER
        "/af-evaluate registration --renderer raycast --gold study --starts-only "
        "--intervals 4 --starts-per-interval 2 --study " +
        path(study + "/study.toml") + " --seed " + std::to_string(seed) + " -o " + output);
    EXPECT_EQ(run.exit_code, 0) << run.output;
    const CsvTable table = CsvTable::read(output + "/starts.csv");
    std::string text;
    for (std::size_t row = 0; row < table.row_count(); ++row)
      text += table.text(row, "start_rx_deg") + " " + table.text(row, "start_tz_mm") + "\n";
    return text;
  };
  EXPECT_EQ(starts("one", 1), starts("elsewhere", 1));
  EXPECT_NE(starts("one", 1), starts("one", 2));
}

TEST_F(Leaks, XraysShareNoVoxelsWithTheCt) {
  // X-rays do not come from the CT, so a coarser CT of the same patient leaves them as they are.
  simulate("coarse", "--anatomy-seed 1 --seed 1", 5.0);
  for (const char* const file : {"AP.mha", "LAT.mha"})
    EXPECT_EQ(read_text_file(path("one") + "/" + file),
              read_text_file(path("coarse") + "/" + file));
  EXPECT_NE(read_ct(path("one/ct.nii.gz")).grid.size, read_ct(path("coarse/ct.nii.gz")).grid.size);
}

}  // namespace
}  // namespace af
