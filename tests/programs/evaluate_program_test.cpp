// SPDX-License-Identifier: Apache-2.0
// af-evaluate as a user meets it: files, the same rows on every rank count, exit codes, messages.
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/csv_table.h"
#include "io/output_file.h"
#include "io/study_file.h"
#include "programs/small_study.h"
#include "support/run_program.h"
#include "support/test_paths.h"

namespace af {
namespace {

using nlohmann::json;
using testing::HasSubstr;

/// The small study with fiducials: their exact projections at the gold pose, which the study also
/// states.
void write_study_with_fiducials(const std::filesystem::path& folder) {
  Study study = read_study(folder / "study.toml");
  StudyCase& study_case = study.cases.front();
  study_case.fiducials_ct_mm = {{20, 5, -8}, {-25, 10, 3}, {4, -22, 18}, {-6, 14, -20}};
  for (StudyView& view : study_case.views)
    for (const Eigen::Vector3d& point : study_case.fiducials_ct_mm)
      view.fiducials_px.push_back(
          study.rig.camera(view.camera).project(*study_case.gold_room_from_ct * point));
  write_text_file(folder / "with-fiducials.toml", study_to_toml(study, folder));
}

/// One study and its fields for all tests of this file.
class EvaluateProgram : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    setenv("OMPI_ALLOW_RUN_AS_ROOT", "1", 1);
    setenv("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1", 1);
    setenv("OMPI_MCA_hwloc_base_binding_policy", "none", 1);
    folder_ = new test::ScratchFolder();
    test::write_small_study(folder_->path());
    write_study_with_fiducials(folder_->path());
    for (const char* camera : {"AP", "LAT"}) {
      const test::ProgramRun run = test::run_command(
          std::string(AF_PROGRAM_FOLDER "/af-precompute --study ") + path("study.toml") +
          " --camera " + camera +
          " --max-rotation-deg 15 --max-translation-mm 12 --uv-nodes 20 --st-nodes 64"
          " --codewords 512 -o " +
          path(std::string(camera) + ".af.h5"));
      ASSERT_EQ(run.exit_code, 0) << run.output;
    }
  }
  static void TearDownTestSuite() { delete folder_; }

  static std::string path(const std::string& name) { return (*folder_ / name).string(); }
  static std::string text(const std::string& name) { return read_text_file(*folder_ / name); }
  static std::string fields() {
    return " --field AP=" + path("AP.af.h5") + " --field LAT=" + path("LAT.af.h5") + " ";
  }
  static test::ProgramRun evaluate(const std::string& arguments, int ranks = 0) {
    const std::string launcher =
        ranks == 0 ? ""
                   : std::string(AF_MPIEXEC " --oversubscribe -n ") + std::to_string(ranks) + " ";
    return test::run_command(launcher + AF_PROGRAM_FOLDER "/af-evaluate " + arguments);
  }
  /// registrations.csv without its last column, the timings.
  static std::string rows_without_seconds(const std::string& folder) {
    const CsvTable table = CsvTable::read(path(folder + "/registrations.csv"));
    EXPECT_EQ(table.columns().back(), "seconds");
    std::string result;
    for (std::size_t i = 0; i < table.row_count(); ++i)
      for (const std::string& column : table.columns())
        if (column != "seconds") result += table.text(i, column) + ",";
    return result;
  }
  static void expect_refused(const test::ProgramRun& run, int exit_code, const std::string& part) {
    EXPECT_EQ(run.exit_code, exit_code) << run.output;
    EXPECT_THAT(run.output, HasSubstr(part));
  }

 private:
  static inline test::ScratchFolder* folder_ = nullptr;
};

TEST_F(EvaluateProgram, ComparesImagesAlikeOnAnyRankCountAndVectorWidth) {
  const std::string arguments = "image-quality --field " + path("AP.af.h5") + " --ct " +
                                path("ct.nii.gz") + " --pose-count 7 --seed 5 -o ";
  const test::ProgramRun alone = evaluate(arguments + path("quality-0"));
  ASSERT_EQ(alone.exit_code, 0) << alone.output;
  EXPECT_THAT(alone.output, HasSubstr("PSNR median"));
  const std::string expected = text("quality-0/image-quality.csv");
  for (const int ranks : {1, 2, 3, 4}) {
    const std::string folder = "quality-" + std::to_string(ranks);
    const test::ProgramRun run = evaluate(arguments + path(folder), ranks);
    ASSERT_EQ(run.exit_code, 0) << run.output;
    EXPECT_EQ(text(folder + "/image-quality.csv"), expected) << ranks << " ranks";
  }
  setenv("AF_VECTOR_BITS", "128", 1);
  EXPECT_EQ(evaluate(arguments + path("quality-narrow")).exit_code, 0);
  unsetenv("AF_VECTOR_BITS");
  EXPECT_EQ(text("quality-narrow/image-quality.csv"), expected);

  const json summary = json::parse(text("quality-0/summary.json"));
  EXPECT_EQ(summary["compared"], 7);
  EXPECT_EQ(summary["provenance"]["seed"], 5);
  for (const char* name :
       {"psnr.svg", "psnr.png", "worst-pair.png", "median-pair.png", "reproduce.sh"})
    EXPECT_TRUE(std::filesystem::exists(path(std::string("quality-0/") + name))) << name;
}

TEST_F(EvaluateProgram, ReportsPosesOutsideTheFieldInsteadOfExtrapolating) {
  write_text_file(path("poses.csv"),
                  "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n0,0,0,0,0,0\n0,0,0,300,0,0\n");
  const test::ProgramRun run =
      evaluate("image-quality --field " + path("AP.af.h5") + " --ct " + path("ct.nii.gz") +
               " --poses " + path("poses.csv") + " -o " + path("outside"));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const CsvTable table = CsvTable::read(path("outside/image-quality.csv"));
  EXPECT_GT(table.number(0, "psnr_db"), 20.0);
  EXPECT_EQ(table.number(0, "rays_outside"), 0.0);
  EXPECT_EQ(table.text(1, "psnr_db"), "nan");
  EXPECT_GT(table.number(1, "rays_outside"), 0.0);
  EXPECT_EQ(json::parse(text("outside/summary.json"))["outside_or_empty"], 1);
}

TEST_F(EvaluateProgram, RegistersAlikeOnAnyRankCount) {
  const std::string arguments =
      "registration --study " + path("with-fiducials.toml") + fields() +
      "--renderer both --intervals 3 --starts-per-interval 4 "
      "--raycast-starts-per-interval 2 --raycast-intervals 2 --seed 3 -o ";
  std::string expected;
  for (const int ranks : {1, 2, 3, 4}) {
    const std::string folder = "registration-" + std::to_string(ranks);
    const test::ProgramRun run = evaluate(arguments + path(folder), ranks);
    ASSERT_EQ(run.exit_code, 0) << run.output;
    if (ranks == 1) expected = rows_without_seconds(folder);
    EXPECT_EQ(rows_without_seconds(folder), expected) << ranks << " ranks";
    EXPECT_EQ(text(folder + "/starts.csv"), text("registration-1/starts.csv")) << ranks;
  }
  const CsvTable rows = CsvTable::read(path("registration-1/registrations.csv"));
  ASSERT_EQ(rows.row_count(), 12u + 4u);
  for (std::size_t i = 0; i < rows.row_count(); ++i) {
    EXPECT_EQ(rows.text(i, "renderer"), i < 12 ? "field" : "raycast");
    // The gold pose is the fiducials', and these are exact: both errors are the same.
    EXPECT_NEAR(rows.number(i, "tre_mm"), rows.number(i, "stated_pose_tre_mm"), 1e-6);
    // The X-rays are ray-cast DRRs: whatever starts within 2 mm must succeed.
    if (rows.number(i, "initial_tre_mm") < 2.0) {
      EXPECT_EQ(rows.text(i, "success"), "1");
    }
  }
  const json summary = json::parse(text("registration-1/summary.json"));
  EXPECT_EQ(summary["cases"][0]["gold"]["source"], "fiducials");
  EXPECT_LT(summary["cases"][0]["gold"]["fre_mm"].get<double>(), 1e-6);
  EXPECT_EQ(summary["field_against_raycast"]["common_starts"], 4);
}

TEST_F(EvaluateProgram, WritesOneSelfContainedReport) {
  const std::string quality = "image-quality --field " + path("LAT.af.h5") + " --ct " +
                              path("ct.nii.gz") + " --pose-count 3 -o " + path("runs/quality");
  const std::string registration = "registration --study " + path("study.toml") + fields() +
                                   "--intervals 2 --starts-per-interval 2 -o " +
                                   path("runs/registration");
  for (const std::string& arguments : {quality, registration}) {
    const test::ProgramRun run = evaluate(arguments);
    ASSERT_EQ(run.exit_code, 0) << run.output;
  }
  const test::ProgramRun run =
      evaluate("report " + path("runs") + " -o " + path("runs/report.html"));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const std::string page = text("runs/report.html");
  // Not by matchers: these would print a page of megabytes.
  const auto has = [&](const char* part) { return page.find(part) != std::string::npos; };
  EXPECT_TRUE(page.starts_with("<!DOCTYPE html>"));
  EXPECT_TRUE(has("<h1>Registration of ellipsoids</h1>"));
  EXPECT_TRUE(has("href=\"registration/reproduce.sh\""));
  EXPECT_TRUE(has("they are taken to be real"));
  EXPECT_FALSE(has("The X-rays are simulated"));
  EXPECT_FALSE(has(">nan"));
  EXPECT_FALSE(has("http://"));
  EXPECT_FALSE(has("https://"));
  std::size_t images = 0;
  for (std::size_t at = page.find(" src=\""); at != std::string::npos;
       at = page.find(" src=\"", at + 1)) {
    EXPECT_EQ(page.compare(at, 11, " src=\"data:"), 0) << page.substr(at, 60);
    ++images;
  }
  // Three figures, X-rays, three overlays in two views; box plot, worst and median pair.
  EXPECT_EQ(images, 3u + 1u + 6u + 1u + 2u);
}

TEST_F(EvaluateProgram, SaysWhenTheFieldHasNoRoomForTheStarts) {
  const test::ProgramRun run =
      evaluate("registration --study " + path("study.toml") + fields() +
               "--intervals 20 --starts-per-interval 1 -o " + path("too-far"));
  expect_refused(run, 3, "starts_per_interval = 1: not reached in every interval");
  EXPECT_FALSE(std::filesystem::exists(path("too-far/registrations.csv")));
}

TEST_F(EvaluateProgram, RefusesBadInputWithTheContractsCodes) {
  const std::string field = "image-quality --field " + path("AP.af.h5") + " ";
  expect_refused(evaluate(""), 2, "subcommand");
  expect_refused(evaluate(field), 2, "--ct");
  expect_refused(evaluate(field + "--ct " + path("ct.nii.gz") + " --pose-count 0 --step-mm -1 -o " +
                          path("x")),
                 3,
                 "--pose-count = 0");
  expect_refused(
      evaluate(field + "--ct " + path("missing.nii.gz") + " -o " + path("x")), 4, "missing.nii.gz");
  write_text_file(path("damaged.h5"), text("AP.af.h5").substr(0, 3000));
  expect_refused(evaluate("image-quality --field " + path("damaged.h5") + " --ct " +
                          path("ct.nii.gz") + " -o " + path("x")),
                 4,
                 "damaged.h5");
  const std::string study = "registration --study " + path("study.toml") + " ";
  expect_refused(evaluate(study + "-o " + path("x")), 3, "--field AP=FIELD.h5");
  expect_refused(evaluate(study + "--field AP -o " + path("x")), 3, "must be CAMERA=PATH");
  expect_refused(evaluate(study + fields() + "--gold fiducials -o " + path("x")), 3, "fiducials");
  expect_refused(evaluate(study + fields() + "--case nobody -o " + path("x")), 3, "nobody");
  expect_refused(
      evaluate(study + fields() + "--raycast-intervals 3 --starts-per-interval 0 -o " + path("x")),
      3,
      "--raycast-intervals = 3");
  expect_refused(evaluate("report " + path("nowhere")), 4, "nowhere");
  std::filesystem::create_directories(path("empty"));
  expect_refused(
      evaluate("report " + path("empty") + " -o " + path("x.html")), 3, "no finished run");
  EXPECT_FALSE(std::filesystem::exists(path("x.html")));
}

TEST_F(EvaluateProgram, RefusesAFieldOfAnotherCt) {
  CtVolume other = test::five_ellipsoids();
  std::vector<std::int16_t> voxels(other.hu.view().begin(), other.hu.view().end());
  voxels[voxels.size() / 2] = 1234;
  other.hu = SharedArray<std::int16_t>(std::move(voxels));
  write_ct(other, path("other.nii.gz"));
  expect_refused(evaluate("image-quality --field " + path("AP.af.h5") + " --ct " +
                          path("other.nii.gz") + " -o " + path("x")),
                 4,
                 "CT of the field");
}

}  // namespace
}  // namespace af
