// SPDX-License-Identifier: Apache-2.0
// What a user meets in af-register and af-drr: files, exit codes, messages.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "files/csv_table.h"
#include "geometry/target_box.h"
#include "geometry/tre.h"
#include "programs/small_study.h"
#include "study/pose_file.h"
#include "study/rig_file.h"
#include "support/own_cache.h"
#include "support/run_program.h"
#include "support/test_paths.h"
#include "xray/image_file.h"

namespace af {
namespace {

namespace fs = std::filesystem;

std::string program(const std::string& name) {
  return std::string(AF_PROGRAM_FOLDER "/") + name;
}

/// One study and its fields for all tests of this file.
class ProgramTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    study_folder = new test::ScratchFolder();
    test::prepare_once(study_folder->path(), [] {
      test::write_small_study(study_folder->path());
      make_fields("", "--uv-nodes 24");
    });
  }
  static void TearDownTestSuite() { delete study_folder; }

  static std::string path(const std::string& name) { return (*study_folder / name).string(); }
  /// Both cameras' fields of a design, and the options that name them.
  static std::string make_fields(const std::string& name, const std::string& design) {
    for (const std::string camera : {"AP", "LAT"}) {
      const test::ProgramRun run = test::run_command(
          program("af-precompute") + " --study " + path("study.toml") + " --camera " + camera +
          " --max-rotation-deg 8 --max-translation-mm 12 --st-nodes 96 --codewords 1024 " + design +
          " -o " + path(camera + name + ".af.h5"));
      EXPECT_EQ(run.exit_code, 0) << run.output;
    }
    return fields(name);
  }
  static std::string fields(const std::string& name = "") {
    return " --field AP=" + path("AP" + name + ".af.h5") +
           " --field LAT=" + path("LAT" + name + ".af.h5");
  }
  static test::ProgramRun run_register(const std::string& arguments) {
    return test::run_command(program("af-register") + " --study " + path("study.toml") + " " +
                             arguments);
  }
  static test::ProgramRun run_drr(const std::string& arguments) {
    return test::run_command(program("af-drr") + " " + arguments);
  }
  static nlohmann::json result(const std::string& folder) {
    std::ifstream file(path(folder + "/result.json"));
    return nlohmann::json::parse(file);
  }
  static void expect_refused(const test::ProgramRun& run, int exit_code, const std::string& part) {
    EXPECT_EQ(run.exit_code, exit_code) << run.output;
    EXPECT_NE(run.output.find(part), std::string::npos) << "no '" << part << "' in\n" << run.output;
  }

 private:
  static inline test::ScratchFolder* study_folder = nullptr;
};

/// Through a small field, 36 x 36 pixels of 2 mm at the isocentre tell half a millimetre at best.
constexpr double kFieldTreMm = 1.0;
/// See registration_test.cpp: the X-rays are this very ray caster's DRRs.
constexpr double kRayCastTreMm = 0.5;

TEST_F(ProgramTest, IsPrepared) {
  for (const char* name : {"study.toml", "AP.af.h5", "LAT.af.h5"})
    EXPECT_TRUE(fs::exists(path(name))) << name;
}

class RegisterProgram : public ProgramTest {};

TEST_F(RegisterProgram, RegistersByFieldAndByRayCasting) {
  const std::string start = " --start-rotation-deg -1,0.5,2.5 --start-translation-mm 0.5,1,4 ";
  const test::ProgramRun by_field = run_register(fields() + start + "-o " + path("by-field"));
  ASSERT_EQ(by_field.exit_code, 0) << by_field.output;
  EXPECT_GT(result("by-field").at("initial_tre_mm").get<double>(), 3.0);
  EXPECT_LT(result("by-field").at("tre_mm").get<double>(), kFieldTreMm);
  const test::ProgramRun by_casting =
      run_register("--renderer raycast" + start + "-o " + path("by-casting"));
  ASSERT_EQ(by_casting.exit_code, 0) << by_casting.output;
  EXPECT_LT(result("by-casting").at("tre_mm").get<double>(), kRayCastTreMm);
  for (const std::string preset : {"fast", "robust"}) {
    const test::ProgramRun coarse =
        run_register("--renderer raycast --preset " + preset + start + "-o " + path(preset));
    ASSERT_EQ(coarse.exit_code, 0) << coarse.output;
    EXPECT_LT(result(preset).at("tre_mm").get<double>(), kRayCastTreMm) << preset;
  }
  for (const char* name :
       {"pose.toml", "result.tfm", "AP-overlay.png", "LAT-overlay.png", "reproduce.sh"})
    EXPECT_TRUE(fs::exists(path("by-field/" + std::string(name)))) << name;
  const nlohmann::json provenance = result("by-field").at("provenance");
  // Study, its case, CT, two fields, two X-rays.
  EXPECT_EQ(provenance.at("input_sha256").size(), 7U) << provenance;
  EXPECT_EQ(provenance.at("input_grids").at("ct").at("size_voxels"),
            nlohmann::json(test::five_ellipsoids().grid.size));
  EXPECT_NE(provenance.at("input_notes").at("xray AP"), "");
}

TEST_F(RegisterProgram, SearchesWhereNoStartIsKnown) {
  const std::string search =
      "--renderer raycast --no-pictures --start search --search-modes 2 --search-rotation-deg "
      "15,15,15 --search-translation-mm 30,30,30 -o ";
  const test::ProgramRun alone = run_register(search + path("searched"));
  ASSERT_EQ(alone.exit_code, 0) << alone.output;
  EXPECT_NE(alone.output.find("search      "), std::string::npos) << alone.output;
  const nlohmann::json found = result("searched");
  EXPECT_LT(found.at("tre_mm").get<double>(), kRayCastTreMm);
  // A small patient has few separate places that look alike.
  const std::size_t starts = found.at("start_search").at("likeness_per_start").size();
  EXPECT_TRUE(starts == 1 || starts == 2) << starts;
  EXPECT_GT(found.at("start_search").at("rotations").get<int>(), 1);
  EXPECT_TRUE(found.contains("rival"));

  const test::ProgramRun two =
      test::run_command(AF_MPIEXEC " -n 2 " + program("af-register") + " --study " +
                        path("study.toml") + " " + search + path("searched-2"));
  ASSERT_EQ(two.exit_code, 0) << two.output;
  const nlohmann::json same = result("searched-2");
  for (const char* key : {"room_from_ct", "start_room_from_ct", "similarity", "verdict", "rival"})
    EXPECT_EQ(same.at(key), found.at(key)) << key;
  EXPECT_EQ(same.at("start_search").at("likeness_per_start"),
            found.at("start_search").at("likeness_per_start"));
}

TEST_F(RegisterProgram, SaysWhereTheRangeOfASearchEnds) {
  // The gold pose is at 2.5, -1.5, 2 mm.
  const std::string search =
      "--renderer raycast --no-pictures --preset fast --start search --search-modes 1 "
      "--search-rotation-deg 4,4,4 --search-translation-mm 2,6,6 -o ";
  const std::string said =
      "the likeliest pose lies at the end of the searched range (tx): search further with "
      "--search-translation-mm 4,6,6\n";
  expect_refused(run_register(search + path("searched-short") + " --max-evaluations 14"), 0, said);
  const test::ProgramRun found = run_register(search + path("searched-found"));
  EXPECT_EQ(found.output.find(said), std::string::npos) << found.output;
  EXPECT_EQ(result("searched-found").at("verdict"), "found");
  for (const char* folder : {"searched-short", "searched-found"})
    EXPECT_EQ(result(folder).at("start_search").at("range_ends_along"), "tx") << folder;
}

TEST_F(RegisterProgram, SearchesForABodyInAirAsForACroppedOne) {
  const test::ScratchFolder folder;
  std::vector<nlohmann::json> likenesses;
  for (const int voxels : {0, 16}) {
    const fs::path here = folder / std::to_string(voxels);
    fs::create_directory(here);
    test::write_small_study(here, test::in_air(test::five_ellipsoids(), voxels));
    const test::ProgramRun run = test::run_command(
        program("af-register") + " --study " + (here / "study.toml").string() +
        " --renderer raycast --preset bone --no-pictures --start search --search-rotation-deg "
        "15,15,15 --search-translation-mm 20,20,20 -o " +
        (here / "result").string());
    // Preset bone finds no bone's silhouette in ellipsoids. The search shows what it looked at.
    ASSERT_EQ(run.exit_code, 7) << run.output;
    std::ifstream file(here / "result/result.json");
    likenesses.push_back(nlohmann::json::parse(file).at("start_search").at("likeness_per_start"));
  }
  EXPECT_EQ(likenesses[1], likenesses[0]);
}

TEST_F(RegisterProgram, SearchesTheRangeOfItsFieldsAndNoFarther) {
  const test::ProgramRun within =
      run_register(fields() + " --no-pictures --start search -o " + path("searched-fields"));
  ASSERT_EQ(within.exit_code, 0) << within.output;
  EXPECT_NE(within.output.find("+-8 degrees, +-12 mm"), std::string::npos) << within.output;
  EXPECT_LT(result("searched-fields").at("tre_mm").get<double>(), kFieldTreMm);
  for (const char* beyond : {"--search-orientations any",
                             "--search-orientations flips",
                             "--search-rotation-deg 9,1,1",
                             "--search-translation-mm 1,1,13"})
    expect_refused(run_register(fields() + " --start search " + beyond + " -o " + path("beyond")),
                   3,
                   "--renderer raycast searches everywhere");
  expect_refused(run_register("--renderer raycast --start search --start-rotation-deg 1,1,1 -o " +
                              path("beyond")),
                 3,
                 "must be left out when another start is given");
}

TEST_F(RegisterProgram, DrawsNoPicturesWhereNoneAreWanted) {
  const std::string command =
      "--renderer raycast --preset fast --start-rotation-deg -1,0.5,2.5 -o " + path("pictures");
  const auto rest_of = [&] {
    nlohmann::json found = result("pictures");
    found.erase("provenance");
    found.erase("seconds");
    return found;
  };
  ASSERT_EQ(run_register(command).exit_code, 0);
  const std::vector<std::string> drawn = {"AP-overlay.png", "LAT-overlay.png", "slicer"};
  for (const std::string& name : drawn) EXPECT_TRUE(fs::exists(path("pictures/" + name))) << name;
  const nlohmann::json with_pictures = rest_of();
  ASSERT_EQ(run_register("--no-pictures " + command).exit_code, 0);
  for (const std::string& name : drawn) EXPECT_FALSE(fs::exists(path("pictures/" + name))) << name;
  for (const char* name : {"pose.toml", "result.tfm", "reproduce.sh"})
    EXPECT_TRUE(fs::exists(path("pictures/" + std::string(name)))) << name;
  EXPECT_EQ(rest_of(), with_pictures);
}

TEST_F(RegisterProgram, LooksAFieldUpAsItIsMeantToBe) {
  const std::string cubic_fields = make_fields("-cubic", "--uv-nodes 24 --look-up cubic");
  // The fields hold the same samples. Levels above 0 are looked up linearly.
  for (const int level : {0, 1}) {
    const std::string chain = " --chain 'gc gauss-newton level=" + std::to_string(level) +
                              " final=0.01' --start-rotation-deg 1,0,0"
                              " --start-translation-mm 1,0,0 -o ";
    const auto end_by = [&](const std::string& by, const std::string& folder) {
      const test::ProgramRun run = run_register(by + chain + path(folder));
      EXPECT_EQ(run.exit_code, 0) << run.output;
      return read_pose(path(folder + "/result.json")).matrix();
    };
    const std::string name = std::to_string(level);
    EXPECT_EQ(end_by(fields(), "linear-" + name) == end_by(cubic_fields, "cubic-" + name),
              level == 1);
  }
}

TEST_F(RegisterProgram, LooksSlabsThatAreMeantForCubicLookUpUpByTheirSum) {
  const std::string of_slabs = make_fields("-slabs", "--slabs 2 --uv-nodes 12 --look-up cubic");
  const test::ProgramRun run = run_register(of_slabs + " --preset fast -o " + path("by-sum"));
  EXPECT_EQ(run.exit_code, 0) << run.output;
  const test::ProgramRun of_one = run_register(fields() + " --preset fast -o " + path("by-one"));
  EXPECT_EQ(of_one.exit_code, 0) << of_one.output;
  const auto look_up_of = [&](const std::string& folder, const std::string& camera) {
    const std::string note =
        result(folder).at("provenance").at("input_notes").at("field " + camera).get<std::string>();
    return note.substr(note.find(';'));
  };
  for (const char* camera : {"AP", "LAT"}) {
    EXPECT_EQ(look_up_of("by-sum", camera), "; level 0 is looked up by cubic-sum");
    EXPECT_EQ(look_up_of("by-one", camera), "; level 0 is looked up by linear");
  }
}

TEST_F(RegisterProgram, CorrectsALookedUpEndByRayCasting) {
  const std::string start =
      " --preset robust --start-rotation-deg -1,0.5,2.5 --start-translation-mm 0.5,1,4 ";
  const auto pose_of = [&](const std::string& folder) {
    return read_pose(path(folder + "/result.json"));
  };
  ASSERT_EQ(run_register(fields() + start + "-o " + path("looked-up")).exit_code, 0);
  ASSERT_EQ(run_register("--renderer raycast" + start + "-o " + path("cast")).exit_code, 0);
  const test::ProgramRun run = run_register(fields() + start + "--correct -o " + path("corrected"));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_NE(run.output.find("corrected   by "), std::string::npos) << run.output;
  const std::vector<Eigen::Vector3d> points = target_points({{-20, -20, -20}, {20, 20, 20}});
  const double before_mm = mean_tre_mm(pose_of("looked-up"), pose_of("cast"), points);
  const double after_mm = mean_tre_mm(pose_of("corrected"), pose_of("cast"), points);
  // Both searches end when steps fall below 0.02 mm, in each of six parameters.
  constexpr double kTwoSearchesMm = 2.0 * 2.45 * 0.02;
  EXPECT_LT(after_mm, kTwoSearchesMm);
  EXPECT_LT(after_mm, 0.5 * before_mm);
  EXPECT_FALSE(result("looked-up").contains("correction"));
  const nlohmann::json correction = result("corrected").at("correction");
  EXPECT_GE(correction.at("casts_per_view"), 1);
  EXPECT_GT(correction.at("moved_mm"), 0.0);
}

TEST_F(RegisterProgram, CorrectsEveryStartOfATableOnAnyRankCount) {
  write_text_file(path("two-starts.csv"),
                  "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n0,0,0,0,0,0\n1,0,1,2,0,1\n");
  const std::string run =
      " --preset fast --correct --correct-max-casts 1 --starts " + path("two-starts.csv") + " -o ";
  ASSERT_EQ(run_register(fields() + run + path("each-1")).exit_code, 0);
  const CsvTable rows = CsvTable::read(path("each-1/registrations.csv"));
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(rows.text(i, "correction_casts"), "1");
    EXPECT_EQ(rows.number(i, "correction_moved_mm"), rows.number(i, "correction_last_mm"));
  }
  const test::ProgramRun together =
      test::run_command(AF_MPIEXEC " -n 2 " + program("af-register") + " --study " +
                        path("study.toml") + " " + fields() + run + path("each-2"));
  ASSERT_EQ(together.exit_code, 0) << together.output;
  const CsvTable shared = CsvTable::read(path("each-2/registrations.csv"));
  for (const std::string& column : rows.columns())
    for (std::size_t i = 0; i < 2 && column != "seconds"; ++i)
      EXPECT_EQ(shared.text(i, column), rows.text(i, column)) << column;
}

TEST_F(RegisterProgram, CastsRaysWhereNoViewHasAField) {
  const std::string start = " --preset fast --start-rotation-deg -1,0.5,2.5 --no-pictures -o ";
  const test::ProgramRun asked = run_register("--renderer raycast" + start + path("asked"));
  ASSERT_EQ(asked.exit_code, 0) << asked.output;
  EXPECT_EQ(asked.output.find("af-precompute"), std::string::npos) << asked.output;
  const test::ProgramRun found = test::run_command(program("af-register") + " " +
                                                   path("study.toml") + start + path("unasked"));
  ASSERT_EQ(found.exit_code, 0) << found.output;
  EXPECT_NE(found.output.find("renderer: raycast, as neither the study nor --field"),
            std::string::npos)
      << found.output;
  EXPECT_EQ(result("unasked").at("renderer"), "raycast");
  for (const char* key : {"room_from_ct", "similarity", "evaluations"})
    EXPECT_EQ(result("unasked").at(key), result("asked").at(key)) << key;
}

TEST_F(RegisterProgram, RefusesACorrectionThatCannotBe) {
  const std::string wanted = fields() + " --correct -o " + path("x");
  expect_refused(run_register(wanted + " --skip-ct-check"), 3, "--skip-ct-check");
  expect_refused(run_register("--renderer raycast --correct -o " + path("x")),
                 3,
                 "must not be given with --renderer raycast");
  expect_refused(run_register(wanted + " --water-mu-per-mm 0.019"), 3, "it must be the field's");
  expect_refused(run_register(wanted + " --correct-max-casts 0"), 3, "correct_max_casts = 0");
  expect_refused(run_register(wanted + " --correct-tolerance-mm 0"), 3, "correct_tolerance_mm = 0");
  std::filesystem::rename(path("ct.nii.gz"), path("hidden.nii.gz"));
  expect_refused(run_register(wanted), 4, "ct.nii.gz");
  std::filesystem::rename(path("hidden.nii.gz"), path("ct.nii.gz"));
  EXPECT_FALSE(std::filesystem::exists(path("x")));
}

TEST_F(RegisterProgram, ManyStartsGiveTheSameRowsOnAnyRankCount) {
  std::ofstream(path("starts.csv")) << "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n0,0,0,0,0,0\n"
                                       "1,1,1,1,1,1\n-1,2,0,3,0,2\n40,0,0,0,0,0\n0,0,2,0,-3,0\n";
  const std::string arguments = fields() + " --max-evaluations 80 --starts " + path("starts.csv");
  ASSERT_EQ(run_register(arguments + " -o " + path("serial")).exit_code, 0);
  const test::ProgramRun shared =
      test::run_command(AF_MPIEXEC " -n 3 " + program("af-register") + " --study " +
                        path("study.toml") + arguments + " -o " + path("shared"));
  ASSERT_EQ(shared.exit_code, 0) << shared.output;
  const CsvTable a = CsvTable::read(path("serial/registrations.csv"));
  const CsvTable b = CsvTable::read(path("shared/registrations.csv"));
  ASSERT_EQ(a.row_count(), 5U);
  ASSERT_EQ(b.row_count(), 5U);
  for (std::size_t row = 0; row < 5; ++row)
    for (const std::string& column : a.columns())
      if (column != "seconds") {
        EXPECT_EQ(a.text(row, column), b.text(row, column)) << row << ' ' << column;
      }
  EXPECT_NE(a.text(3, "stop_reason"), "start-inadmissible");
  EXPECT_NE(shared.output.find("1 of 5 starts lay outside the field's range (start 3 along rx)"),
            std::string::npos)
      << shared.output;
}

TEST_F(RegisterProgram, ManyStartsGoOnAfterAStop) {
  std::ofstream starts(path("starts.csv"));
  starts << "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n";
  for (int i = 0; i < 60; ++i) starts << "0,0," << 0.1 * (i % 20) << ",1,0," << 0.05 * i << '\n';
  starts.close();
  const std::string arguments = fields() + " --preset paper --starts " + path("starts.csv");
  ASSERT_EQ(run_register(arguments + " -o " + path("whole")).exit_code, 0);
  const std::string output = " -o " + path("stopped");
  const test::ProgramRun first = run_register(arguments + output + test::kStopAtOnce);
  expect_refused(first, 75, " of 60 saved: run the same command again");
  EXPECT_FALSE(fs::exists(path("stopped/result.json")));
  expect_refused(run_register(arguments + output + " --max-evaluations 99"), 3, "begun with");
  Study changed = read_study(path("study.toml"));
  changed.cases.front().views.front().roi.width -= 1;
  write_text_file(path("changed.toml"), study_to_toml(changed, path("")));
  expect_refused(test::run_command(program("af-register") + " --study " + path("changed.toml") +
                                   arguments + output),
                 3,
                 "SHA-256 of case");
  const test::ProgramRun last = test::run_until_done(program("af-register") + " --study " +
                                                     path("study.toml") + arguments + output);
  ASSERT_EQ(last.exit_code, 0) << last.output;
  EXPECT_FALSE(fs::exists(path("stopped.progress")));
  const CsvTable whole = CsvTable::read(path("whole/registrations.csv"));
  const CsvTable resumed = CsvTable::read(path("stopped/registrations.csv"));
  ASSERT_EQ(resumed.row_count(), 60U);
  for (std::size_t row = 0; row < 60; ++row)
    for (const std::string& column : whole.columns())
      if (column != "seconds") {
        EXPECT_EQ(resumed.text(row, column), whole.text(row, column)) << row << ' ' << column;
      }
  EXPECT_EQ(result("stopped").at("trace"), result("whole").at("trace"));
}

/// Writes the study with fiducials as NAME.toml. Each adds `marker` to the X-rays' pixel at its
/// middle.
void write_study_with_fiducials(const fs::path& folder, const std::string& name, float marker) {
  Study study = read_study(folder / "study.toml");
  StudyCase& study_case = study.cases.front();
  study_case.fiducials_ct_mm = {{15, 0, 0}, {-12, 10, 4}, {0, -9, 14}, {3, 6, -13}};
  for (StudyView& view : study_case.views) {
    Image2d xray = read_image(view.xray);
    for (const Eigen::Vector3d& point : study_case.fiducials_ct_mm) {
      const Eigen::Vector2d pixel =
          study.rig.camera(view.camera).project(*study_case.gold_room_from_ct * point);
      view.fiducials_px.push_back(pixel);
      xray.at(static_cast<int>(std::lround(pixel.x())), static_cast<int>(std::lround(pixel.y()))) +=
          marker;
    }
    view.xray = folder / (name + "-" + view.camera + ".mha");
    write_image(xray, view.xray, 3.0, 3.0);
  }
  write_text_file(folder / (name + ".toml"), study_to_toml(study, folder));
}

TEST_F(RegisterProgram, DoesNotSeeTheMarkersOfTheGoldStandard) {
  write_study_with_fiducials(path(""), "bare", 0.0f);
  write_study_with_fiducials(path(""), "marked", 5.0f);
  const auto tre_mm = [&](const std::string& study, const std::string& options) {
    const std::string folder = path(study + "-result" + std::to_string(options.size()));
    const test::ProgramRun run = test::run_command(
        program("af-register") + " --study " + path(study + ".toml") + fields() +
        " --chain 'gc gauss-newton' --start-rotation-deg 1,-1,1 " + options + " -o " + folder);
    EXPECT_EQ(run.exit_code, 0) << run.output;
    std::ifstream file(folder + "/result.json");
    return nlohmann::json::parse(file).at("tre_mm").get<double>();
  };
  EXPECT_EQ(tre_mm("marked", ""), tre_mm("bare", ""));
  EXPECT_NE(tre_mm("marked", "--fiducial-mask-mm 0"), tre_mm("bare", "--fiducial-mask-mm 0"));
}

TEST_F(RegisterProgram, RefusesAFieldOfAnotherCamera) {
  const test::ProgramRun run =
      run_register("--field AP=" + path("LAT.af.h5") + " --field LAT=" + path("LAT.af.h5") +
                   " -o " + path("refused"));
  expect_refused(run, 4, "LAT.af.h5: this is the field of camera 'LAT', not of camera 'AP'");
  EXPECT_FALSE(fs::exists(path("refused")));
}

TEST_F(RegisterProgram, LooksThroughARecalibratedCameraIntoTheOldField) {
  const test::ScratchFolder other;
  for (const char* name : {"study.toml", "ct.nii.gz", "AP.mha", "LAT.mha"})
    fs::copy_file(path(name), other / name);
  CameraRig rig = read_rig(path("rig.toml"));
  for (CameraGeometry& camera : rig.cameras) camera.source_point.x() += 0.5;
  std::ofstream(other / "rig.toml") << rig_to_toml(rig);
  const test::ProgramRun run =
      test::run_command(program("af-register") + " --study " + (other / "study.toml").string() +
                        fields() + " --max-evaluations 40 -o " + (other / "out").string());
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_NE(run.output.find("source 0.50 mm"), std::string::npos) << run.output;
  EXPECT_NE(run.output.find("field covers 100 % of camera AP's rays within"), std::string::npos)
      << run.output;
  expect_refused(
      test::run_command(program("af-register") + " --study " + (other / "study.toml").string() +
                        " --field AP=" + path("LAT.af.h5") + " --field LAT=" + path("LAT.af.h5") +
                        " -o " + (other / "refused").string()),
      4,
      "camera 'AP' of the field: expected one that holds all rays");
}

TEST_F(RegisterProgram, RefusesAFieldOfAnotherCtAndNamesBothHashes) {
  const test::ScratchFolder other;
  for (const char* name : {"study.toml", "rig.toml", "AP.mha", "LAT.mha"})
    fs::copy_file(path(name), other / name);
  CtVolume ct = test::five_ellipsoids();
  std::vector<std::int16_t> hu(ct.hu.view().begin(), ct.hu.view().end());
  hu[100] = 7;
  ct.hu = SharedArray<std::int16_t>(hu);
  write_ct(ct, other / "ct.nii.gz");
  const std::string command = program("af-register") + " --study " +
                              (other / "study.toml").string() + fields() + " --max-evaluations 20" +
                              " -o " + (other / "out").string();
  const test::ProgramRun run = test::run_command(command);
  expect_refused(run, 4, identity_of(ct).content_sha256);
  EXPECT_NE(run.output.find(identity_of(test::five_ellipsoids()).content_sha256),
            std::string::npos);
  // With --skip-ct-check it does not look, and the CT may be missing.
  fs::remove(other / "ct.nii.gz");
  const test::ProgramRun unchecked = test::run_command(command + " --skip-ct-check");
  EXPECT_EQ(unchecked.exit_code, 0) << unchecked.output;
  EXPECT_NE(unchecked.output.find("warning"), std::string::npos) << unchecked.output;
}

TEST_F(RegisterProgram, EndsTheSameAndRefusesTheSameWhereItKnowsTheCtFromBefore) {
  const test::OwnCache cache;
  const test::ScratchFolder other;
  for (const char* name : {"study.toml", "rig.toml", "ct.nii.gz", "AP.mha", "LAT.mha"})
    fs::copy_file(path(name), other / name);
  const auto run = [&] {
    return test::run_command(program("af-register") + " --study " +
                             (other / "study.toml").string() + fields() +
                             " --max-evaluations 20 -o " + (other / "out").string());
  };
  /// The result of the same command, without times.
  const auto ended = [&] {
    fs::remove_all(other / "out");
    const test::ProgramRun registered = run();
    EXPECT_EQ(registered.exit_code, 0) << registered.output;
    nlohmann::json json = nlohmann::json::parse(read_text_file(other / "out/result.json"));
    json.erase("seconds");
    json["provenance"].erase("started_utc");
    return json;
  };
  const nlohmann::json first = ended();
  const auto entries = cache.entries();
  EXPECT_EQ(entries.size(), 2U) << "its facts and its target";
  EXPECT_EQ(ended(), first);
  EXPECT_EQ(cache.entries(), entries) << "the CT was read again";
  CtVolume moved = test::five_ellipsoids();
  moved.grid.origin_mm.x() += 7.0;
  CtVolume scaled = test::five_ellipsoids();
  scaled.grid.spacing_mm *= 1.1;
  for (const CtVolume& ct : {moved, scaled}) {
    fs::remove_all(other / "out");
    write_ct(ct, other / "ct.nii.gz");
    for (int time = 0; time < 2; ++time) expect_refused(run(), 4, "mm off");
  }
  EXPECT_EQ(cache.entries().size(), 6U);
}

TEST_F(RegisterProgram, RefusesAFieldOfACtThatLiesElsewhereButNotOfOneInAnotherFormat) {
  const test::ScratchFolder other;
  for (const char* name : {"rig.toml", "AP.mha", "LAT.mha"})
    fs::copy_file(path(name), other / name);
  const CtVolume ct = test::five_ellipsoids();
  CtVolume moved = ct;
  moved.grid.origin_mm.x() += 7.0;
  CtVolume scaled = ct;
  scaled.grid.spacing_mm *= 1.1;
  const std::string study = read_text_file(path("study.toml"));
  const std::string named = "ct.nii.gz";
  ASSERT_NE(study.find(named), std::string::npos) << study;
  const std::string field = path("AP.af.h5");
  const auto registered = [&](const CtVolume& other_ct, const std::string& name) {
    write_ct(other_ct, other / name);
    write_text_file(other / "study.toml",
                    std::string(study).replace(study.find(named), named.size(), name));
    return test::run_command(program("af-register") + " --study " +
                             (other / "study.toml").string() + fields() +
                             " --max-evaluations 20 -o " + (other / (name + ".results")).string());
  };
  const auto compared = [&](const std::string& name) {
    return run_drr("--field " + field + " --ct " + (other / name).string() + " --compare -o " +
                   (other / "compared.png").string());
  };
  const test::ProgramRun same = registered(ct, "ct.nrrd");
  EXPECT_EQ(same.exit_code, 0) << same.output;
  EXPECT_EQ(compared("ct.nrrd").exit_code, 0);
  for (const auto& [name, other_ct] :
       {std::pair("moved.mha", moved), std::pair("scaled.mha", scaled)}) {
    expect_refused(registered(other_ct, name), 4, "AP.af.h5: CT of the field: expected");
    expect_refused(compared(name), 4, "mm off");
  }
}

TEST_F(RegisterProgram, ListsWhatThereIsToChooseFromWithoutACase) {
  const std::string name = program("af-register");
  const test::ProgramRun measures = test::run_command(name + " --list measures");
  EXPECT_EQ(measures.exit_code, 0);
  EXPECT_EQ(measures.output.find("\n\n"), std::string::npos) << measures.output;
  EXPECT_NE(measures.output.find("ncc\tgradient\tnormal-equations\tcross-correlation\n"),
            std::string::npos)
      << measures.output;
  const test::ProgramRun optimizers = test::run_command(name + " --list optimizers");
  EXPECT_NE(optimizers.output.find("gauss-newton\tnormal-equations\t"), std::string::npos)
      << optimizers.output;
  expect_refused(test::run_command(name + " --list presses"), 2, "measures");
}

TEST_F(RegisterProgram, RefusesWhatDoesNotExist) {
  const std::string out = " -o " + path("refused");
  expect_refused(run_register(fields() + " --similarity psnr" + out), 2, "mi");
  expect_refused(run_register(fields() + " --optimizer newton" + out), 2, "best-neighbor");
  expect_refused(run_register(fields() + " --preset swift" + out), 2, "paper");
  expect_refused(run_register(fields() + " --no-such-option" + out), 2, "no-such-option");
  expect_refused(run_register(fields()), 2, "--output");
  expect_refused(run_register(fields() + " --case nobody" + out), 3, "ellipsoids");
  expect_refused(run_register("--renderer field" + out), 3, "--field AP=");
  expect_refused(run_register("--field AP=" + path("AP.af.h5") + out), 3, "--field LAT=");
  expect_refused(run_register("--skip-ct-check" + out), 3, "--field AP=");
  expect_refused(run_register("--field X=a.h5" + out), 3, "AP, LAT");
  expect_refused(run_register("--field AP" + out), 3, "CAMERA=PATH");
  expect_refused(
      run_register(fields() + " --chain 'mi best-neighbor bins=1'" + out), 3, "bins = 1");
  expect_refused(
      run_register(fields() + " --start-pose a --starts b" + out), 3, "given in several ways");
  expect_refused(run_register(fields() + " --starts " + path("absent.csv") + out), 4, "absent.csv");
  expect_refused(
      run_register("--field AP=" + path("ct.nii.gz") + " --field LAT=" + path("LAT.af.h5") + out),
      4,
      "ct.nii.gz");
  EXPECT_FALSE(fs::exists(path("refused")));
}

TEST_F(RegisterProgram, AStartOutsideTheFieldsRangeIsClippedIntoIt) {
  const test::ProgramRun run =
      run_register(fields() + " --start-translation-mm 0,0,13 -o " + path("clipped"));
  const std::string said = "the start lay outside the field's range along tz";
  expect_refused(run, 0, said);
  EXPECT_NE(result("clipped").at("verdict_reason").get<std::string>().find(said),
            std::string::npos);
  EXPECT_LT(result("clipped").at("tre_mm").get<double>(), kFieldTreMm);
}

TEST_F(RegisterProgram, AnEndWhereTheFieldsRangeEndsIsDoubtfulAndSaysAlongWhat) {
  // The gold pose is at 1.5, -2, 1 degrees and 2.5, -1.5, 2 mm.
  for (const std::string camera : {"AP", "LAT"}) {
    const test::ProgramRun made = test::run_command(
        program("af-precompute") + " --study " + path("study.toml") + " --camera " + camera +
        " --max-rotation-deg 8 --translation-range-mm tx=-8:1 --max-translation-mm 8" +
        " --uv-nodes 24 --st-nodes 96 --codewords 1024 -o " + path(camera + "-short.af.h5"));
    ASSERT_EQ(made.exit_code, 0) << made.output;
  }
  const test::ProgramRun run = run_register(fields("-short") + " -o " + path("pinned"));
  const std::string said = "the field's range ends here along tx";
  EXPECT_NE(run.output.find(said), std::string::npos) << run.output;
  const nlohmann::json found = result("pinned");
  EXPECT_EQ(found.at("stop_reason"), "pinned-at-limit");
  EXPECT_NE(found.at("verdict"), "found");
  EXPECT_NE(found.at("verdict_reason").get<std::string>().find(said), std::string::npos) << found;
  const std::string further = "--renderer raycast --start search";
  EXPECT_NE(run.output.find(further), std::string::npos) << run.output;
  const test::ProgramRun search =
      run_register(fields("-short") + " --start search -o " + path("pinned-search"));
  for (const std::string& part : {std::string("the end of the searched range (tx)\n"), further})
    EXPECT_NE(search.output.find(part), std::string::npos) << search.output;
}

TEST_F(RegisterProgram, RequireFoundDoesNotAcceptADoubtfulPose) {
  const std::string arguments = fields() + " --preset fast --start-rotation-deg -1,0.5,2.5 ";
  const std::string cut_short = arguments + "--max-evaluations 14 -o " + path("cut-short");
  expect_refused(run_register(cut_short), 0, "verdict     doubtful: the search was not finished");
  expect_refused(run_register(cut_short + " --require-found"), 7, "the pose is doubtful");
  EXPECT_EQ(result("cut-short").at("verdict"), "doubtful");
  EXPECT_TRUE(fs::exists(path("cut-short/pose.toml")));
  const std::string whole = arguments + "--require-found -o " + path("required");
  expect_refused(run_register(whole), 0, "verdict     found: right with ");
}

TEST_F(RegisterProgram, WithoutTheCtSaysThatTheTargetWasNotChecked) {
  const std::string arguments = fields() + " --preset fast --start-rotation-deg -1,0.5,2.5 -o ";
  const std::string missing = "not checked: whether the target has moved against the rest";
  const test::ProgramRun unread = run_register(arguments + path("ct-unread") + " --skip-ct-check");
  expect_refused(unread, 0, missing);
  const nlohmann::json alone = result("ct-unread");
  EXPECT_EQ(alone.at("verdict"), "found");
  EXPECT_TRUE(alone.at("uncertainty").at("target_share").is_null());
  EXPECT_NE(alone.at("verdict_reason").get<std::string>().find(missing), std::string::npos);
  const test::ProgramRun read = run_register(arguments + path("ct-read"));
  EXPECT_EQ(read.output.find(missing), std::string::npos) << read.output;
  EXPECT_TRUE(result("ct-read").at("uncertainty").at("target_share").is_number());
}

TEST_F(RegisterProgram, AStartThatCannotBeSearchedIsNotFound) {
  const std::string start = " --renderer raycast --start-translation-mm 0,0,500 -o ";
  const test::ProgramRun run = run_register(start + path("outside"));
  expect_refused(run, 7, "verdict     not found: nothing was searched");
  EXPECT_NE(run.output.find("ct-outside-roi"), std::string::npos) << run.output;
  EXPECT_TRUE(result("outside").at("similarity").is_null());
  EXPECT_EQ(result("outside").at("verdict"), "not found");
  for (const char* name : {"outside/result.tfm", "outside/pose.toml", "outside/slicer"})
    EXPECT_FALSE(fs::exists(path(name))) << name;
  EXPECT_TRUE(fs::exists(path("outside/AP-overlay.png")));
  const test::ProgramRun by_ranks =
      test::run_command(AF_MPIEXEC " -n 2 " + program("af-register") + " --study " +
                        path("study.toml") + start + path("outside-2"));
  EXPECT_EQ(by_ranks.exit_code, 7) << by_ranks.output;
}

/// The study with one X-ray changed, as NAME.toml.
void write_study_with_defect(const fs::path& folder,
                             const std::string& name,
                             const std::function<void(Image2d&)>& harm) {
  Study study = read_study(folder / "study.toml");
  StudyView& view = study.cases.front().views.back();
  Image2d xray = read_image(view.xray);
  harm(xray);
  view.xray = folder / (name + ".mha");
  write_image(xray, view.xray, 3.0, 3.0);
  write_text_file(folder / (name + ".toml"), study_to_toml(study, folder));
}

TEST_F(RegisterProgram, NamesAnXrayThatDisagreesAndWhatWouldMendIt) {
  const test::ScratchFolder folder;
  test::write_small_study(folder.path(), test::bones_in_a_corner());
  write_study_with_defect(folder.path(), "turned", [](Image2d& xray) {
    std::reverse(xray.pixels.begin(), xray.pixels.end());
  });
  write_study_with_defect(folder.path(), "inverted", [](Image2d& xray) {
    for (float& value : xray.pixels) value = 3.0f - value;
  });
  const std::string command =
      program("af-register") + " --renderer raycast --preset robust --study ";
  for (const auto& [study, remedy] :
       {std::pair("turned", "turned by 180 degrees"), std::pair("inverted", "inverted")}) {
    const fs::path input = folder / (std::string(study) + ".toml");
    const test::ProgramRun run = test::run_command(command + input.string() + " -o " + path(study));
    EXPECT_NE(run.output.find("the X-ray of view 'LAT' " + std::string(remedy)), std::string::npos)
        << run.output;
    EXPECT_NE(result(study).at("verdict"), "found");
    EXPECT_EQ(result(study).at("views").at("verdict"), "suspicious");
  }
  const test::ProgramRun sound =
      test::run_command(command + (folder / "study.toml").string() + " -o " + path("sound"));
  EXPECT_EQ(sound.exit_code, 0) << sound.output;
  EXPECT_EQ(result("sound").at("verdict"), "found") << sound.output;
  EXPECT_EQ(sound.output.find("warning: "), std::string::npos) << sound.output;
}

class DrrProgram : public ProgramTest {};

TEST_F(DrrProgram, WritesTheSameDrrInEveryFormat) {
  const std::string source = "--ct " + path("ct.nii.gz") + " --rig " + path("rig.toml") +
                             " --camera AP --rotation-deg -5,3,2 --translation-mm 1,-2,3 -o ";
  ASSERT_EQ(run_drr(source + path("drr.mha")).exit_code, 0);
  const Image2d reference = read_image(path("drr.mha"));
  EXPECT_EQ(reference.width, 48);
  for (const char* name : {"drr.nii.gz", "drr.nrrd", "drr.tif"}) {
    const test::ProgramRun run = run_drr(source + path(name));
    ASSERT_EQ(run.exit_code, 0) << run.output;
    EXPECT_EQ(read_image(path(name)).pixels, reference.pixels) << name;
  }
}

TEST_F(DrrProgram, PngIsBrightWhereTheBodyIs) {
  const std::string source =
      "--ct " + path("ct.nii.gz") + " --rig " + path("rig.toml") + " --camera AP -o ";
  ASSERT_EQ(run_drr(source + path("drr.png")).exit_code, 0);
  const Image2d bright = read_image(path("drr.png"));
  EXPECT_EQ(bright.at(0, 0), 0.0f);
  EXPECT_GT(bright.at(24, 24), 100.0f);
}

TEST_F(DrrProgram, StacksPosesInOrder) {
  std::ofstream(path("poses.csv")) << "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n0,0,0,0,0,0\n"
                                      "0,0,0,6,0,0\n2,0,0,0,0,0\n";
  const test::ProgramRun run = run_drr("--field " + path("AP.af.h5") + " --poses " +
                                       path("poses.csv") + " -o " + path("stack.mha"));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_NE(run.output.find("48 x 48 x 3"), std::string::npos) << run.output;
  EXPECT_GE(fs::file_size(path("stack.mha")), 3U * 48U * 48U * 4U);
}

TEST_F(DrrProgram, ComparesFieldAndRayCast) {
  const test::ProgramRun run = run_drr("--compare --field " + path("AP.af.h5") + " --ct " +
                                       path("ct.nii.gz") + " -o " + path("compare.png"));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_NE(run.output.find("PSNR "), std::string::npos) << run.output;
  EXPECT_TRUE(fs::exists(path("compare.png")));
}

TEST_F(DrrProgram, CastsRaysForACaseOfAStudy) {
  const std::string study = "--study " + path("study.toml") + " --camera AP";
  const Study read = read_study(path("study.toml"));
  write_text_file(path("nominal.toml"), pose_to_toml(read.cases[0].nominal_room_from_ct));
  const std::string ct =
      "--ct " + path("ct.nii.gz") + " --rig " + path("rig.toml") + " --camera AP";
  ASSERT_EQ(run_drr(study + " --case ellipsoids -o " + path("case.mha")).exit_code, 0);
  ASSERT_EQ(run_drr(ct + " --pose " + path("nominal.toml") + " -o " + path("ct.mha")).exit_code, 0);
  EXPECT_EQ(read_image(path("case.mha")).pixels, read_image(path("ct.mha")).pixels);
  const std::string out = " -o " + path("refused.mha");
  expect_refused(run_drr(study + " --case bones" + out), 3, "ellipsoids");
  expect_refused(run_drr(study + " --ct " + path("ct.nii.gz") + out), 3, "leave these out");
  expect_refused(run_drr("--study " + path("study.toml") + out), 3, "needs --camera");
  expect_refused(run_drr(ct + " --case ellipsoids" + out), 3, "applies to --study only");
}

TEST_F(DrrProgram, RefusesAPoseOutsideTheFieldWithTheRayCount) {
  const test::ProgramRun run = run_drr("--field " + path("AP.af.h5") +
                                       " --translation-mm 0,0,200 -o " + path("outside.mha"));
  expect_refused(run, 3, "of 2304 rays miss its planes");
  EXPECT_FALSE(fs::exists(path("outside.mha")));
}

TEST_F(DrrProgram, RefusesASourceBehindOrWithinTheCt) {
  const std::string field = "--field " + path("AP.af.h5") + " ";
  const std::string out = " -o " + path("behind.mha");
  const std::string said =
      "2304 of 2304 rays miss its planes, or attenuation lies behind or around";
  // The CT is moved onto the source, and behind it.
  for (const char* y : {"-650", "-700"})
    expect_refused(run_drr(field + "--translation-mm=0," + y + ",0" + out), 3, said);
  // The source is behind, within and on the (s,t) plane, and the lines of all its rays lie within
  // the field's planes.
  CameraRig rig = read_rig(path("rig.toml"));
  CameraGeometry& camera = rig.cameras.front();
  camera.pixel_spacing_mm *= 0.2;
  camera.detector_origin_point.x() *= 0.2;
  camera.detector_origin_point.z() *= 0.2;
  for (const double y_mm : {150.0, 20.0, 0.0, -20.0}) {
    camera.source_point.y() = y_mm;
    write_text_file(path("moved.toml"), rig_to_toml(rig));
    expect_refused(run_drr(field + "--rig " + path("moved.toml") + " --camera AP" + out), 3, said);
  }
  EXPECT_FALSE(fs::exists(path("behind.mha")));
}

TEST_F(DrrProgram, SaysThatAPoseIsBeyondTheRangeThatTheFieldStates) {
  const std::string field = "--field " + path("AP.af.h5") + " -o " + path("towards-source.mha");
  // The CT moves towards the source, where the field holds rays of more than its 12 mm.
  const test::ProgramRun beyond = run_drr(field + " --translation-mm=0,13,0");
  EXPECT_EQ(beyond.exit_code, 0) << beyond.output;
  EXPECT_NE(
      beyond.output.find("1 of 1 poses lie beyond the motion range that the field states, +-8 "
                         "degrees, +-12 mm (pose 0 along ty)"),
      std::string::npos)
      << beyond.output;
  const test::ProgramRun within = run_drr(field + " --translation-mm=0,12,0");
  EXPECT_EQ(within.output.find("beyond"), std::string::npos) << within.output;
}

/// 14 degrees about the long axis are outside a field of +-8 degrees. A second field about that
/// angle holds them.
TEST_F(ProgramTest, DrrTakesTheFieldThatHoldsAPose) {
  const std::string turned = path("AP-turned.af.h5");
  const test::ProgramRun made = test::run_command(
      program("af-precompute") + " --study " + path("study.toml") +
      " --camera AP --max-rotation-deg 8 --max-translation-mm 12 --uv-nodes 24" +
      " --st-nodes 96 --codewords 1024 --rotation-range-deg rz=6:22 -o " + turned);
  ASSERT_EQ(made.exit_code, 0) << made.output;
  const std::string field = "--field " + path("AP.af.h5") + " ";
  const std::string pose = "--rotation-deg 0,0,14 -o ";
  expect_refused(run_drr(field + pose + path("alone.mha")), 3, "outside the field");
  ASSERT_EQ(run_drr(field + "--also-field " + turned + " " + pose + path("both.mha")).exit_code, 0);
  ASSERT_EQ(run_drr("--field " + turned + " " + pose + path("turned.mha")).exit_code, 0);
  EXPECT_EQ(read_image(path("both.mha")).pixels, read_image(path("turned.mha")).pixels);
  const std::string rig = " --rig " + path("rig.toml") + " --camera ";
  const test::ProgramRun own = run_drr(field + rig + "AP -o " + path("own.mha"));
  EXPECT_EQ(own.exit_code, 0) << own.output;
  EXPECT_EQ(own.output.find("camera"), std::string::npos) << own.output;
  expect_refused(run_drr(field + "--also-field " + turned + rig + "LAT " + pose + path("a.mha")),
                 3,
                 "from the nominal camera, that of --field");
  expect_refused(run_drr("--ct " + path("ct.nii.gz") + " --rig " + path("rig.toml") +
                         " --camera AP --also-field " + turned + " -o " + path("a.mha")),
                 3,
                 "--also-field");
}

TEST_F(DrrProgram, RefusesWhatDoesNotFit) {
  const std::string field = "--field " + path("AP.af.h5");
  const std::string ct = "--ct " + path("ct.nii.gz");
  const std::string out = " -o " + path("refused.mha");
  expect_refused(run_drr("-o a.mha"), 3, "give --field");
  expect_refused(run_drr(field + " " + ct + out), 3, "only for --compare");
  expect_refused(run_drr(ct + out), 3, "needs --rig and --camera");
  expect_refused(run_drr(field + " --interpolation sinc" + out), 2, "nearest");
  expect_refused(run_drr(field + " -o " + path("a.jpg")), 3, "must end in");
  expect_refused(run_drr(field + " --compare" + out), 3, "needs --field, and --ct or --study");
  expect_refused(run_drr(field + " --rotation-deg 1,2" + out), 2, "--rotation-deg");
  expect_refused(run_drr(field + " --pose " + path("absent.toml") + out), 4, "absent.toml");
  expect_refused(run_drr(ct + " --rig treatment-room --camera Z" + out), 3, "A, B");
  EXPECT_FALSE(fs::exists(path("refused.mha")));
}

}  // namespace
}  // namespace af
