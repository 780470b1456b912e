// SPDX-License-Identifier: Apache-2.0
// What a user meets in af-evaluate: files, the same rows on every rank count, exit codes, messages.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/csv_table.h"
#include "files/output_file.h"
#include "files/output_lock.h"
#include "programs/evaluated_study.h"
#include "study/pose_file.h"
#include "study/study_file.h"
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

class EvaluateProgram : public test::EvaluatedStudy {
 protected:
  static void SetUpTestSuite() {
    set_up([] { write_study_with_fiducials(path("")); });
  }
  /// Makes, once per process, a run of every kind, a registration whose searches end too early to
  /// succeed, and a report of all.
  static void make_runs_of_every_kind() {
    if (std::filesystem::exists(path("runs/report.html"))) return;
    const std::string registration =
        "registration --study " + path("study.toml") + fields() + "--intervals 2 ";
    const std::vector<std::string> runs = {
        "image-quality --field " + path("LAT.af.h5") + " --ct " + path("ct.nii.gz") +
            " --pose-count 3 -o " + path("runs/quality"),
        registration + "--starts-per-interval 2 -o " + path("runs/registration"),
        registration + "--starts-per-interval 3 --max-evaluations 14 -o " + path("runs/short"),
        "similarity-curves --study " + path("study.toml") + fields() +
            "--renderer field --half-width-mm 1 --half-width-deg 1 -o " + path("runs/curves"),
        "field-parameters --study " + path("study.toml") +
            " --camera AP --max-rotation-deg 8 --max-translation-mm 8"
            " --base-uv-nodes 8 --base-st-nodes 32 --base-codewords 16 --uv-nodes 4"
            " --st-nodes 32 --codewords 16 --training-fraction 0.1 --pose-count 2 -o " +
            path("runs/sweep"),
        "report " + path("runs") + " -o " + path("runs/report.html")};
    for (const std::string& arguments : runs) {
      const test::ProgramRun run = evaluate(arguments);
      ASSERT_EQ(run.exit_code, 0) << run.output;
    }
  }
};

TEST_F(EvaluateProgram, IsPrepared) {
  for (const char* name : {"with-fiducials.toml", "AP.af.h5", "LAT.af.h5"})
    EXPECT_TRUE(std::filesystem::exists(path(name))) << name;
}

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
    // The gold pose comes from the fiducials, which are exact, so both errors are the same.
    EXPECT_NEAR(rows.number(i, "tre_mm"), rows.number(i, "stated_pose_tre_mm"), 1e-6);
    // The X-rays are ray-cast DRRs, so every start within 2 mm must succeed.
    if (rows.number(i, "initial_tre_mm") < 2.0) {
      EXPECT_EQ(rows.text(i, "success"), "1");
    }
  }
  const json summary = json::parse(text("registration-1/summary.json"));
  EXPECT_EQ(summary["cases"][0]["gold"]["source"], "fiducials");
  EXPECT_LT(summary["cases"][0]["gold"]["fre_mm"].get<double>(), 1e-6);
  EXPECT_EQ(summary["field_against_raycast"]["common_starts"], 4);
  const json& notes = summary["provenance"]["input_notes"];
  const std::string first_case = summary["cases"][0]["case"];
  EXPECT_EQ(notes.count(first_case + ": xray AP"), 1U) << "as af-register: " << notes.dump();
}

TEST_F(EvaluateProgram, RegistersCasesThatShareFieldsAsItDoesEachAlone) {
  Study study = read_study(path("study.toml"));
  for (StudyView& view : study.cases.front().views) view.field = path(view.camera + ".af.h5");
  study.cases.push_back(study.cases.front());
  study.cases.back().name = "turned";
  study.cases.back().nominal_room_from_ct =
      study.cases.back().nominal_room_from_ct * Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitY());
  write_text_file(path("two-cases.toml"), study_to_toml(study, path("")));
  const std::string run = "registration --study " + path("two-cases.toml") +
                          " --intervals 2 --starts-per-interval 2 --preset robust ";
  std::string alone;
  for (const StudyCase& of : study.cases) {
    const std::string folder = "case-" + of.name;
    const test::ProgramRun one = evaluate(run + "--case " + of.name + " -o " + path(folder));
    ASSERT_EQ(one.exit_code, 0) << one.output;
    alone += rows_without_seconds(folder);
  }
  const test::ProgramRun both = evaluate(run + "-o " + path("two-cases"), 2);
  ASSERT_EQ(both.exit_code, 0) << both.output;
  EXPECT_EQ(rows_without_seconds("two-cases"), alone);
}

TEST_F(EvaluateProgram, TakesStartsWithoutACaseWhereOneCaseIsChosen) {
  Study study = read_study(path("study.toml"));
  for (StudyView& view : study.cases.front().views) view.field = path(view.camera + ".af.h5");
  study.cases.push_back(study.cases.front());
  study.cases.back().name = "twin";
  write_text_file(path("twins.toml"), study_to_toml(study, path("")));
  write_text_file(path("no-case.csv"),
                  "start_rx_deg,start_ry_deg,start_rz_deg,start_tx_mm,start_ty_mm,start_tz_mm\n"
                  "0,0,0,1,0,0\n");
  const std::string run = "registration --study " + path("twins.toml") +
                          " --preset fast --starts-from " + path("no-case.csv") + " -o ";
  const test::ProgramRun one = evaluate(run + path("twin-only") + " --case twin");
  ASSERT_EQ(one.exit_code, 0) << one.output;
  EXPECT_EQ(CsvTable::read(path("twin-only/registrations.csv")).text(0, "case"), "twin");
  expect_refused(evaluate(run + path("both-twins")), 3, "needed with several cases");
}

TEST_F(EvaluateProgram, ASecondRunThatWritesTheSameIsRefused) {
  const std::string registration = "registration --study " + path("study.toml") + fields();
  const std::string run = path("run");
  ASSERT_EQ(evaluate(registration + "--intervals 2 --starts-per-interval 2 -o " + run).exit_code,
            0);
  const OutputLock folder_lock(path("taken"));
  const OutputLock file_lock(path("taken.md"));
  const OutputLock page_lock(path("taken.html"));
  const OutputLock study_lock(path("taken.toml"));
  const std::vector<std::string> commands = {
      registration + " -o " + path("taken"),
      "similarity-curves --study " + path("study.toml") + fields() + " -o " + path("taken"),
      "image-quality --field " + path("LAT.af.h5") + " --ct " + path("ct.nii.gz") + " -o " +
          path("taken"),
      "error-budget --step a=" + run + " --step b=" + run + " -o " + path("taken"),
      "compare " + run + " -o " + path("taken.md"),
      "report " + run + " -o " + path("taken.html"),
      "join-studies " + path("study.toml") + " " + path("study.toml") + " -o " +
          path("taken.toml")};
  for (const std::string& arguments : commands)
    expect_refused(evaluate(arguments),
                   3,
                   "another job is writing it: process " + std::to_string(getpid()) + " on ");
}

TEST_F(EvaluateProgram, MeasuresPosesOfAnotherProgramLikeItsOwn) {
  const std::string study = "registration --study " + path("with-fiducials.toml") + " ";
  ASSERT_EQ(evaluate(study + fields() + "--intervals 2 --starts-per-interval 3 -o " + path("own"))
                .exit_code,
            0);
  const CsvTable own = CsvTable::read(path("own/registrations.csv"));
  // The run's own table as found poses must give the same errors, without X-rays or fields.
  const test::ProgramRun again =
      evaluate(study + "--starts-from " + path("own/starts.csv") + " --poses-from " +
                   path("own/registrations.csv") + " --method-name again -o " + path("again"),
               2);
  ASSERT_EQ(again.exit_code, 0) << again.output;
  const CsvTable rows = CsvTable::read(path("again/registrations.csv"));
  ASSERT_EQ(rows.row_count(), own.row_count());
  // Angles go to degrees and back: 1e-16 of 1 rad times 100 mm.
  constexpr double kRoundingMm = 1e-9;
  for (std::size_t i = 0; i < own.row_count(); ++i)
    for (const char* name : {"tre_mm", "initial_tre_mm", "mrpd_mm", "rotation_error_deg"})
      EXPECT_NEAR(rows.number(i, name), own.number(i, name), kRoundingMm) << name;
  EXPECT_TRUE(json::parse(text("again/summary.json"))["row_problems"].empty());

  // The same poses as ITK transforms. One is missing, and one belongs to a start that does not
  // exist.
  std::filesystem::create_directories(path("tfm"));
  const CsvTable starts = CsvTable::read(path("own/starts.csv"));
  for (std::size_t i = 1; i < starts.row_count() + 1; ++i) {
    RigidTransform pose;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 4; ++column)
        pose.matrix()(row, column) =
            starts.number(0, "m" + std::to_string(row) + std::to_string(column));
    pose.makeAffine();
    write_text_file(path("tfm/" + std::to_string(i) + ".tfm"), pose_to_itk_transform(pose));
  }
  const test::ProgramRun folder =
      evaluate(study + "--starts-from " + path("own/starts.csv") + " --poses-from " + path("tfm") +
                   " -o " + path("from-tfm"),
               2);
  ASSERT_EQ(folder.exit_code, 0) << folder.output;
  const CsvTable found = CsvTable::read(path("from-tfm/registrations.csv"));
  EXPECT_EQ(found.text(0, "stop_reason"), "no-pose");
  EXPECT_EQ(found.text(0, "success"), "0");
  EXPECT_NEAR(found.number(1, "tre_mm"), starts.number(0, "initial_tre_mm"), kRoundingMm);
  EXPECT_EQ(json::parse(text("from-tfm/summary.json"))["row_problems"].size(), 2u);
  EXPECT_THAT(folder.output, HasSubstr("no pose for start 0"));
  EXPECT_THAT(folder.output, HasSubstr("a pose for start 6, which does not exist"));
}

TEST_F(EvaluateProgram, RegistersFromTheStartsOfAFile) {
  const std::string study = "registration --study " + path("study.toml") + fields();
  const test::ProgramRun only =
      evaluate(study +
                   "--start-rule uniform --intervals 2 --starts-per-interval "
                   "2 --starts-only -o " +
                   path("only"),
               2);
  ASSERT_EQ(only.exit_code, 0) << only.output;
  EXPECT_FALSE(std::filesystem::exists(path("only/registrations.csv")));
  ASSERT_EQ(
      evaluate(study + "--starts-from " + path("only/starts.csv") + " -o " + path("from-file"), 2)
          .exit_code,
      0);
  const CsvTable starts = CsvTable::read(path("only/starts.csv"));
  const CsvTable rows = CsvTable::read(path("from-file/registrations.csv"));
  ASSERT_EQ(rows.row_count(), 4u);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_EQ(rows.text(i, "initial_tre_mm"), starts.text(i, "initial_tre_mm"));
  // When rank 0 alone reads a bad file, all ranks end.
  expect_refused(evaluate(study + "--starts-from " + path("missing.csv") + " -o " + path("bad"), 2),
                 4,
                 "missing.csv");
  expect_refused(evaluate(study + "--starts-from " + path("only/starts.csv") +
                              " --only-start 4 -o " + path("bad"),
                          2),
                 3,
                 "less than the number of starts, 4");
}

TEST_F(EvaluateProgram, RegistersACaseThatLooksForItsStart) {
  const std::string arguments = "registration --study " + path("study.toml") + fields() +
                                "--no-pictures --start-rule search --search-modes 2 -o ";
  for (const int ranks : {1, 2})
    ASSERT_EQ(evaluate(arguments + path("search-" + std::to_string(ranks)), ranks).exit_code, 0);
  const CsvTable rows = CsvTable::read(path("search-1/registrations.csv"));
  const CsvTable same = CsvTable::read(path("search-2/registrations.csv"));
  ASSERT_EQ(rows.row_count(), 1u);
  EXPECT_EQ(rows.text(0, "success"), "1");
  for (const char* column : {"initial_tre_mm", "tre_mm", "similarity", "verdict"})
    EXPECT_EQ(rows.text(0, column), same.text(0, column)) << column;
  // The start of the row is the nominal pose.
  EXPECT_EQ(rows.text(0, "initial_tre_mm"),
            CsvTable::read(path("search-1/starts.csv")).text(0, "initial_tre_mm"));
  EXPECT_EQ(json::parse(text("search-1/summary.json"))["start_rule"], "search");
}

TEST_F(EvaluateProgram, DrawsSimilarityAboutTheGoldPoseAlikeOnAnyRankCount) {
  const std::string arguments =
      "similarity-curves --study " + path("study.toml") + fields() +
      "--half-width-mm 2 --half-width-deg 2 --curve-step-mm 0.5 --curve-step-deg 0.5 -o ";
  for (const int ranks : {1, 2}) {
    const test::ProgramRun run =
        evaluate(arguments + path("curves-" + std::to_string(ranks)), ranks);
    ASSERT_EQ(run.exit_code, 0) << run.output;
    EXPECT_THAT(run.output, HasSubstr("broadest rotation"));
  }
  EXPECT_EQ(text("curves-1/similarity-curves.csv"), text("curves-2/similarity-curves.csv"));
  EXPECT_EQ(text("curves-1/maxima.csv"), text("curves-2/maxima.csv"));
  const CsvTable maxima = CsvTable::read(path("curves-1/maxima.csv"));
  ASSERT_EQ(maxima.row_count(), 12u);
  // The X-rays are ray-cast DRRs at the gold pose: ray casting has its maxima there, within the
  // step of the grid.
  for (std::size_t i = 6; i < 12; ++i) {
    EXPECT_EQ(maxima.text(i, "renderer"), "raycast");
    EXPECT_LT(std::abs(maxima.number(i, "offset_of_maximum")), 0.5);
  }
  EXPECT_EQ(CsvTable::read(path("curves-1/similarity-curves.csv")).row_count(), 2u * 6u * 9u);
  EXPECT_TRUE(std::filesystem::exists(path("curves-1/similarity-curves.svg")));
  expect_refused(evaluate("similarity-curves --study " + path("study.toml") + fields() +
                          "--half-width-deg 0.05 -o " + path("x")),
                 3,
                 "--curve-step-deg = 0.1");
}

TEST_F(EvaluateProgram, MeasuresErrorsAgainstFractionsOfACell) {
  const std::string arguments = "lattice-errors --study " + path("study.toml") + fields();
  // The last stage sees the X-rays' own pixels, so its optimum by ray casting is the truth.
  const test::ProgramRun run = evaluate(
      arguments + "--chain 'ncc gauss-newton level=1 pixels=2; gc gauss-newton final=0.005'" +
          " --fractions 2 --renderer both -o " + path("cells.md"),
      2);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("| field | u |"));
  EXPECT_THAT(run.output, HasSubstr("raycast: 8 of 8 converged"));
  const CsvTable cells = CsvTable::read(path("cells.csv"));
  ASSERT_EQ(cells.row_count(), 2u * 8u);
  // Some last steps of 0.005 mm, on a CT of about 60 mm.
  constexpr double kConvergedMmOrDeg = 0.05;
  for (std::size_t row = 8; row < 16; ++row) {
    EXPECT_EQ(cells.text(row, "renderer"), "raycast");
    for (const char* name : kParameterNames)
      EXPECT_LT(std::abs(cells.number(row, std::string("error_") + name)), kConvergedMmOrDeg);
  }
  expect_refused(evaluate("lattice-errors --study " + path("study.toml") + " --renderer raycast"),
                 3,
                 "must be field or both");
  expect_refused(
      evaluate(arguments + " -o " + path("cells.csv")), 3, "must name the Markdown file");
}

TEST_F(EvaluateProgram, BuildsTheFieldsOfASweepOnceAndReusesThem) {
  const std::string arguments =
      "field-parameters --study " + path("study.toml") +
      " --camera AP --max-rotation-deg 8 --max-translation-mm 8 --base-uv-nodes 8 --base-st-nodes "
      "32"
      " --base-codewords 16 --uv-nodes 4,8 --st-nodes 32,64 --codewords 64 --training-fraction 0.1"
      " --pose-count 4 --fields " +
      path("sweep-fields") + " -o ";
  const test::ProgramRun first = evaluate(arguments + path("sweep-1"));
  ASSERT_EQ(first.exit_code, 0) << first.output;
  const auto made =
      std::filesystem::last_write_time(path("sweep-fields/AP-uv8-st64-n16-t0.1.af.h5"));
  const test::ProgramRun second = evaluate(arguments + path("sweep-2"), 2);
  ASSERT_EQ(second.exit_code, 0) << second.output;
  EXPECT_EQ(std::filesystem::last_write_time(path("sweep-fields/AP-uv8-st64-n16-t0.1.af.h5")),
            made);
  // Even the creation times are the same, because they are the fields' own.
  EXPECT_EQ(text("sweep-1/field-parameters.csv"), text("sweep-2/field-parameters.csv"));
  const CsvTable table = CsvTable::read(path("sweep-1/field-parameters.csv"));
  ASSERT_EQ(table.row_count(), 4u);  // base, uv 4, st 64, 64 codewords
  EXPECT_EQ(table.number(0, "uncompressed_bytes"), 2.0 * 8 * 8 * 32 * 32);
  EXPECT_LT(table.number(1, "psnr_median_db"), table.number(0, "psnr_median_db"));
  EXPECT_GT(table.number(2, "psnr_median_db"), table.number(0, "psnr_median_db"));
  EXPECT_TRUE(std::filesystem::exists(path("sweep-1/field-parameters.svg")));
  // Fields of another range under the same names are refused, not reused.
  std::string other = arguments;
  other.replace(other.find("--max-rotation-deg 8"), 20, "--max-rotation-deg 7");
  expect_refused(evaluate(other + path("sweep-3")), 4, "options of the field to reuse");
}

TEST_F(EvaluateProgram, PoolsTheFieldsOfAllViewsOfAStudy) {
  const test::ProgramRun run = evaluate(
      "field-parameters --study " + path("study.toml") +
          " --max-rotation-deg 8 --max-translation-mm 8 --base-uv-nodes 8 --base-st-nodes 32"
          " --base-codewords 16 --uv-nodes 4,8 --st-nodes 32 --codewords 16 --training-fraction 0.1"
          " --pose-count 3 -o " +
          path("pooled"),
      2);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const CsvTable pooled = CsvTable::read(path("pooled/field-parameters.csv"));
  const CsvTable fields = CsvTable::read(path("pooled/field-parameters-fields.csv"));
  ASSERT_EQ(pooled.row_count(), 2u);
  ASSERT_EQ(fields.row_count(), 4u);  // AP's, then LAT's
  EXPECT_EQ(fields.text(2, "camera"), "LAT");
  constexpr double kRounding = 1e-9;  // of sums in another order
  for (std::size_t i = 0; i < 2; ++i)
    for (const char* column : {"psnr_mean_db", "payload_bytes"}) {
      const double mean = 0.5 * (fields.number(i, column) + fields.number(i + 2, column));
      EXPECT_NEAR(pooled.number(i, column), mean, kRounding * mean);
    }
  const CsvTable differences = CsvTable::read(path("pooled/difference-images.csv"));
  // One of two settings may be nearest to several of the paper's three levels. No DRR appears
  // twice.
  ASSERT_GE(differences.row_count(), 1u);
  ASSERT_LE(differences.row_count(), 2u);
  for (std::size_t i = 1; i < differences.row_count(); ++i) {
    EXPECT_EQ(differences.text(i, "pose_index"), differences.text(0, "pose_index"));
    EXPECT_NE(differences.text(i, "psnr_db"), differences.text(0, "psnr_db"));
  }
  EXPECT_TRUE(std::filesystem::exists(path("pooled/difference-images.png")));
}

TEST_F(EvaluateProgram, ComparesTheFieldsOfAStudyTogetherAndSplitsTheirLoss) {
  Study study = read_study(path("study.toml"));
  for (StudyView& view : study.cases.front().views) view.field = path(view.camera + ".af.h5");
  write_text_file(path("with-fields.toml"), study_to_toml(study, path("")));
  const std::string arguments = "image-quality --study " + path("with-fields.toml") +
                                " --pose-count 3 --split-loss-poses 2 -o ";
  for (const int ranks : {1, 2}) {
    const test::ProgramRun run =
        evaluate(arguments + path("together-" + std::to_string(ranks)), ranks);
    ASSERT_EQ(run.exit_code, 0) << run.output;
  }
  const std::string split = "/ellipsoids-LAT/loss-split-poses.csv";
  EXPECT_EQ(text("together-1" + split), text("together-2" + split));
  EXPECT_EQ(text("together-1/image-quality.csv"), text("together-2/image-quality.csv"));
  const CsvTable rows = CsvTable::read(path("together-1/image-quality.csv"));
  ASSERT_EQ(rows.row_count(), 6u);
  EXPECT_EQ(rows.text(5, "case"), "ellipsoids");
  EXPECT_EQ(rows.text(5, "camera"), "LAT");
  const CsvTable parts = CsvTable::read(path("together-1" + split));
  ASSERT_EQ(parts.row_count(), 2u);
  // The total must be the loss that the other table states.
  constexpr double kRoundingDb = 1e-6;
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_NEAR(parts.number(i, "total_psnr_db"), rows.number(3 + i, "psnr_db"), kRoundingDb);
  for (const char* name : {"psnr.svg", "worst-pairs.png", "ellipsoids-AP/loss-split.svg"})
    EXPECT_TRUE(std::filesystem::exists(path(std::string("together-1/") + name))) << name;
  expect_refused(evaluate("image-quality --study " + path("study.toml") + " -o " + path("x")),
                 3,
                 "view 'AP': field");
}

TEST_F(EvaluateProgram, ComparesRunsInOneTable) {
  const std::string study = "registration --study " + path("study.toml") + fields() +
                            "--preset paper --intervals 2 --starts-per-interval 2 -o ";
  ASSERT_EQ(evaluate(study + path("methods/mi")).exit_code, 0);
  ASSERT_EQ(evaluate(study + path("methods/ncc") + " --similarity ncc").exit_code, 0);
  const test::ProgramRun run =
      evaluate("compare " + path("methods") + " -o " + path("methods/table.md"));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_EQ(text("methods/table.md"), run.output);
  const CsvTable table = CsvTable::read(path("methods/table.csv"));
  ASSERT_EQ(table.row_count(), 2u);
  EXPECT_EQ(table.text(0, "method"), "paper mi best-neighbor");
  EXPECT_EQ(table.text(1, "method"), "paper ncc best-neighbor");
  EXPECT_EQ(table.text(1, "starts_0_8_mm"), "4");
  expect_refused(evaluate("compare " + path("nowhere")), 4, "nowhere");
  expect_refused(evaluate("compare " + path("methods") + " -o " + path("methods/table.csv")),
                 3,
                 "must name the Markdown file");
}

TEST_F(EvaluateProgram, CorrectsLookedUpEndsAndMeasuresHowFarMethodsEndApart) {
  const std::string study = "registration --study " + path("study.toml") + fields() +
                            "--preset fast --intervals 2 --starts-per-interval 1 -o ";
  ASSERT_EQ(evaluate(study + path("apart/plain")).exit_code, 0);
  const test::ProgramRun both =
      evaluate(study + path("apart/corrected") + " --correct --renderer both");
  ASSERT_EQ(both.exit_code, 0) << both.output;
  const CsvTable rows = CsvTable::read(path("apart/corrected/registrations.csv"));
  ASSERT_EQ(rows.row_count(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    const bool is_field = rows.text(i, "renderer") == "field";
    EXPECT_EQ(rows.text(i, "correction_casts").empty(), !is_field);
    EXPECT_EQ(rows.text(i, "correction_stood_still").empty(), !is_field);
  }
  const test::ProgramRun run =
      evaluate("compare " + path("apart") + " --pose-distances -o " + path("apart/table.md"));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("gauss-newton, quasi-newton corrected"));
  const CsvTable table = CsvTable::read(path("apart/table-pose-distances.csv"));
  ASSERT_EQ(table.row_count(), 3u);
  double corrected_mm = 0.0;
  double plain_mm = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(table.text(i, "starts"), "2");
    const std::string pair = table.text(i, "run_a") + table.text(i, "renderer_a") + " " +
                             table.text(i, "run_b") + table.text(i, "renderer_b");
    if (pair == "correctedfield correctedraycast")
      corrected_mm = table.number(i, "median_distance_mm");
    if (pair == "correctedraycast plainfield") plain_mm = table.number(i, "median_distance_mm");
  }
  EXPECT_GT(corrected_mm, 0.0);
  EXPECT_LT(corrected_mm, 0.5 * plain_mm);
  expect_refused(evaluate(study + path("x") + " --correct --renderer raycast --field AP=x"),
                 3,
                 "must not be given with --renderer raycast");
  expect_refused(evaluate(study + path("x") + " --correct --starts-from s.csv --poses-from p.csv"),
                 3,
                 "must not be given with --poses-from");
}

TEST_F(EvaluateProgram, DrawsNoPicturesWhereNoneAreWanted) {
  const std::string study = "registration --study " + path("study.toml") + fields() +
                            "--intervals 1 --starts-per-interval 2 ";
  ASSERT_EQ(evaluate(study + "-o " + path("drawn/run"), 1).exit_code, 0);
  ASSERT_EQ(evaluate(study + "--no-pictures -o " + path("plain/run"), 1).exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(path("drawn/run/slicer")));
  EXPECT_FALSE(std::filesystem::exists(path("plain/run/slicer")));
  for (const auto& entry : std::filesystem::directory_iterator(path("plain/run")))
    EXPECT_FALSE(entry.path().filename().string().starts_with("ellipsoids-")) << entry.path();
  // All else is the same, and a report leaves out what is missing.
  EXPECT_EQ(CsvTable::read(path("plain/run/registrations.csv")).row_count(), 2u);
  ASSERT_EQ(evaluate("report " + path("plain/run") + " -o " + path("plain/report.html")).exit_code,
            0);
  const std::string page = text("plain/report.html");
  EXPECT_EQ(page.find("What it looks like"), std::string::npos);
  EXPECT_EQ(page.find("Whether the study fits together"), std::string::npos);
  EXPECT_NE(page.find("Capture range"), std::string::npos);
  EXPECT_NE(page.find("were refused and drawn again"), std::string::npos);
  const nlohmann::json provenance =
      nlohmann::json::parse(text("plain/run/summary.json")).at("provenance");
  EXPECT_THAT(provenance.at("program_commit").get<std::string>(),
              testing::MatchesRegex("[0-9a-f]+\\+?|unknown"));
}

TEST_F(EvaluateProgram, DrawsTheFiguresOfEveryKindAndOnePage) {
  make_runs_of_every_kind();
  for (const char* name : {"short/success-rate",
                           "short/tre-histogram",
                           "short/tre-scatter",
                           "short/confidence",
                           "quality/psnr",
                           "curves/similarity-curves",
                           "sweep/field-parameters"})
    for (const char* extension : {".svg", ".png"})
      EXPECT_TRUE(std::filesystem::exists(path("runs/" + std::string(name) + extension))) << name;
  const std::string page = text("runs/report.html");
  EXPECT_TRUE(page.starts_with("<!DOCTYPE html>"));
  EXPECT_NE(page.find("<h1>Registration of ellipsoids</h1>"), std::string::npos);
  EXPECT_NE(page.find("camera AP: left edge R, right L, top H, bottom F"), std::string::npos);
}

TEST_F(EvaluateProgram, RepeatsAFailedStartByTheCommandInTheReport) {
  make_runs_of_every_kind();
  const std::string page = text("runs/report.html");
  const std::string opening = "<pre class=\"command\">";
  const std::size_t at = page.find(opening);
  ASSERT_NE(at, std::string::npos) << "the short searches all succeeded";
  const std::size_t first = at + opening.size();
  // The scratch folder's name needs no quotes, so && gives the only HTML entities of the command.
  std::string command = page.substr(first, page.find("</pre>", first) - first);
  for (std::size_t i = command.find("&amp;"); i != std::string::npos; i = command.find("&amp;"))
    command.replace(i, 5, "&");
  const test::ProgramRun run = test::run_command("( " + command + " )");
  ASSERT_EQ(run.exit_code, 0) << command << '\n' << run.output;

  std::filesystem::path repeat;
  for (const auto& entry : std::filesystem::directory_iterator(path("runs/short/repeats")))
    repeat = entry.path();
  const CsvTable repeated = CsvTable::read(repeat / "registrations.csv");
  ASSERT_EQ(repeated.row_count(), 1u);
  const CsvTable all = CsvTable::read(path("runs/short/registrations.csv"));
  const auto row = static_cast<std::size_t>(repeated.number(0, "start_index"));
  EXPECT_EQ(repeated.text(0, "success"), "0");
  for (const char* name : {"final_rx_deg", "final_tz_mm", "tre_mm", "similarity", "evaluations"})
    EXPECT_EQ(repeated.text(0, name), all.text(row, name)) << name;
  const std::string trace = "traces/ellipsoids-field-" + all.text(row, "start_index") + ".csv";
  EXPECT_EQ(read_text_file(repeat / trace), text("runs/short/" + trace));
  // The search ends where the row says; a trace's poses are made of its parameters, which rounds.
  const CsvTable steps = CsvTable::read(repeat / trace);
  EXPECT_NEAR(steps.number(steps.row_count() - 1, "tre_mm"), all.number(row, "tre_mm"), 1e-9);

  // A repeat is no run of its own in a report of everything.
  EXPECT_THAT(evaluate("report " + path("runs") + " -o " + path("runs/again.html")).output,
              HasSubstr("report of 5 run(s)"));
}

TEST_F(EvaluateProgram, ComputesWithoutPythonAndNamesTheCommandForFigures) {
  // A copy of the program finds no af-report: none is beside it, and PATH leads nowhere.
  std::filesystem::create_directories(path("alone"));
  std::filesystem::copy_file(AF_PROGRAM_FOLDER "/af-evaluate", path("alone/af-evaluate"));
  const std::string command = "PATH=" + path("nowhere") + " " + path("alone/af-evaluate") + " ";
  const test::ProgramRun run =
      test::run_command(command + "registration --study " + path("study.toml") + fields() +
                        "--intervals 1 --starts-per-interval 1 -o " + path("numbers"));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("they are made by: af-report " + path("numbers")));
  EXPECT_TRUE(std::filesystem::exists(path("numbers/summary.json")));
  EXPECT_FALSE(std::filesystem::exists(path("numbers/success-rate.svg")));
  expect_refused(test::run_command(command + "report " + path("numbers") + " -o " + path("n.html")),
                 4,
                 "af-report: cannot be run");
}

TEST_F(EvaluateProgram, SaysWhenTheFieldHasNoRoomForTheStarts) {
  for (const int ranks : {1, 2}) {
    const test::ProgramRun run =
        evaluate("registration --study " + path("study.toml") + fields() +
                     "--intervals 20 --starts-per-interval 1 -o " + path("too-far"),
                 ranks);
    expect_refused(run, 3, "starts_per_interval = 1: not reached in every interval");
    EXPECT_FALSE(std::filesystem::exists(path("too-far/registrations.csv")));
  }
}

TEST_F(EvaluateProgram, RefusesBadInputWithTheContractsCodes) {
  const std::string field = "image-quality --field " + path("AP.af.h5") + " ";
  expect_refused(evaluate(""), 2, "subcommand");
  expect_refused(evaluate(field + "-o " + path("x")), 2, "--ct");
  expect_refused(evaluate(field + "--ct " + path("ct.nii.gz") + " --pose-count 0 --step-mm -1 -o " +
                          path("x")),
                 3,
                 "pose_count = 0");
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
  // Without a gold pose, before a field is looked for or another case registered.
  Study second = read_study(path("study.toml"));
  second.cases.push_back(second.cases.front());
  second.cases.back().name = "second";
  second.cases.back().gold_room_from_ct.reset();
  for (StudyCase& study_case : second.cases)
    for (StudyView& view : study_case.views) view.field = path("missing.af.h5");
  write_text_file(path("without-gold.toml"), study_to_toml(second, path("")));
  expect_refused(
      evaluate("registration --study " + path("without-gold.toml") + " -o " + path("x")),
      3,
      "case 'second' has neither three fiducials that two views show nor gold_room_from_ct");
  expect_refused(
      evaluate(study + fields() + "--raycast-intervals 3 --starts-per-interval 0 -o " + path("x")),
      3,
      "--raycast-intervals = 3");
  expect_refused(evaluate(study + "--poses-from x.csv -o " + path("x")), 3, "needs --starts-from");
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
