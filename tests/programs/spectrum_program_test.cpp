// SPDX-License-Identifier: Apache-2.0
// What a user meets in DRRs of a tube's spectrum: fields of bone's part, af-drr, af-register.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "drr/field_renderer.h"
#include "drr/field_set_drr.h"
#include "drr/opened_field.h"
#include "drr/xray_beam.h"
#include "programs/small_study.h"
#include "study/pose_file.h"
#include "support/ct_phantoms.h"
#include "support/run_program.h"
#include "support/test_paths.h"
#include "xray/image_file.h"

namespace af {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTube = " --tube-kvp 70 --aluminium-mm 2.5 ";

std::string program(const std::string& name) {
  return std::string(AF_PROGRAM_FOLDER "/") + name;
}

/// The small study, whose X-rays are DRRs of a tube's spectrum here, and fields of both materials.
class SpectrumPrograms : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    study_folder = new test::ScratchFolder();
    test::write_small_study(study_folder->path());
    const Study study = read_study(path("study.toml"));
    write_text_file(path("gold.toml"), pose_to_toml(*study.cases[0].gold_room_from_ct));
    for (const char* camera : {"AP", "LAT"}) {
      run("af-drr --study " + path("study.toml") + " --camera " + camera + " --pose " +
          path("gold.toml") + kTube + "-o " + path(std::string(camera) + "-tube.mha"));
      fs::rename(path(std::string(camera) + "-tube.mha"), path(std::string(camera) + ".mha"));
      run(precompute(camera) + "-o " + path(std::string(camera) + ".af.h5"));
      run(precompute(camera) + "--material bone -o " + path(std::string(camera) + ".bone.af.h5"));
    }
  }
  static void TearDownTestSuite() { delete study_folder; }

  static std::string path(const std::string& name) { return (*study_folder / name).string(); }
  static std::string precompute(const std::string& camera) {
    return "af-precompute --study " + path("study.toml") + " --camera " + camera +
           " --max-rotation-deg 8 --max-translation-mm 12 --uv-nodes 24 --st-nodes 96"
           " --codewords 1024 ";
  }
  static test::ProgramRun started(const std::string& command) {
    return test::run_command(program(command));
  }
  static void run(const std::string& command) {
    const test::ProgramRun made = started(command);
    ASSERT_EQ(made.exit_code, 0) << made.output;
  }
  static void expect_refused(const std::string& command, int exit_code, const std::string& part) {
    const test::ProgramRun refused = started(command);
    EXPECT_EQ(refused.exit_code, exit_code) << refused.output;
    EXPECT_NE(refused.output.find(part), std::string::npos) << refused.output;
  }
  static Image2d drr(const std::string& options) {
    run("af-drr " + options + " -o " + path("drr.mha"));
    return read_image(path("drr.mha"));
  }
  static nlohmann::json result(const std::string& folder) {
    std::ifstream file(path(folder + "/result.json"));
    return nlohmann::json::parse(file);
  }

 private:
  static inline test::ScratchFolder* study_folder = nullptr;
};

double rms_difference(const Image2d& a, const Image2d& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    sum += std::pow(static_cast<double>(a.pixels[i]) - static_cast<double>(b.pixels[i]), 2);
  return std::sqrt(sum / static_cast<double>(a.pixels.size()));
}

TEST_F(SpectrumPrograms, FieldsOfTwoMaterialsAgreeWithRayCasting) {
  const std::string by_field = "--field " + path("AP.af.h5") + " ";
  const std::string by_casting = "--study " + path("study.toml") + " --camera AP ";
  const double of_one_energy = rms_difference(drr(by_field), drr(by_casting));
  const Image2d cast = drr(by_casting + kTube);
  const double of_the_tube = rms_difference(drr(by_field + kTube), cast);
  // Here the slope by all material is up to 1.3, that by bone up to 0.6, and both fields err.
  EXPECT_LT(of_the_tube, 2.0 * of_one_energy);
  // What the spectrum does to a DRR is far more than what the fields lose.
  EXPECT_GT(rms_difference(cast, drr(by_casting)), 5.0 * of_the_tube);
}

TEST_F(SpectrumPrograms, ATubeOfZeroKilovoltsIsTheOrdinaryDrr) {
  const std::string by_field = "--field " + path("AP.af.h5") + " ";
  EXPECT_EQ(drr(by_field + "--tube-kvp 0").pixels, drr(by_field).pixels);
}

TEST_F(SpectrumPrograms, ScatterNeedsNoFieldOfBone) {
  fs::copy_file(path("AP.af.h5"), path("alone.af.h5"));
  const Image2d without = drr("--field " + path("alone.af.h5"));
  const Image2d with = drr("--field " + path("alone.af.h5") + " --scatter-to-primary 0.5");
  for (std::size_t i = 0; i < with.pixels.size(); ++i) EXPECT_LT(with.pixels[i], without.pixels[i]);
}

TEST_F(SpectrumPrograms, RegisterByFieldsAndByRayCasting) {
  const std::string start = "af-register --study " + path("study.toml") + kTube +
                            " --start-rotation-deg -1,0.5,2.5 --start-translation-mm 0.5,1,4 ";
  const std::string fields = "--field AP=" + path("AP.af.h5") + " --field LAT=" + path("LAT.af.h5");
  run(start + fields + " --correct -o " + path("by-field"));
  run(start + "--renderer raycast -o " + path("by-casting"));
  // As in register_program_test.cpp.
  EXPECT_LT(result("by-field").at("tre_mm").get<double>(), 1.0);
  EXPECT_LT(result("by-casting").at("tre_mm").get<double>(), 0.5);
  // Study, its case, CT, two fields of all, two of bone, two X-rays.
  EXPECT_EQ(result("by-field").at("provenance").at("input_sha256").size(), 9U);
}

TEST_F(SpectrumPrograms, AtlasesGiveTheDrrsOfTheirMembersFields) {
  const std::string orbit = precompute("AP") + "--orbit axis=z,from=-8,to=8,step=8 ";
  run(orbit + "-o " + path("turn.af.h5"));
  run(orbit + "--material bone -o " + path("turn.bone.af.h5"));
  expect_refused("af-drr --field " + path("turn.bone.af.h5") + " -o " + path("refused.mha"),
                 4,
                 "of its bone alone");
  const Communicator alone = Communicator::alone();
  const OpenedField all(path("turn.af.h5"), alone);
  const OpenedField bone = all.bone(alone);
  const View view = View::whole_detector(all.identity().camera);
  const RigidTransform nominal = all.identity().frame.nominal_room_from_ct();
  const std::vector<double> weights = FieldSetDrr(all.renderers("")).weights(nominal, view);
  const auto middle =
      static_cast<std::size_t>(std::max_element(weights.begin(), weights.end()) - weights.begin());
  ASSERT_EQ(weights[middle], 1.0);
  XrayBeamOptions options;
  options.spectrum = {70.0, 2.5};
  const auto renderer =
      XrayBeam(options, {all.identity().mu_water_per_mm, all.identity().air_below_hu})
          .renderer(make_field_renderer(all.member(middle, alone), all.info().look_up),
                    make_field_renderer(bone.member(middle, alone), all.info().look_up));
  const std::string by_atlas = "--field " + path("turn.af.h5") + " ";
  EXPECT_EQ(drr(by_atlas + kTube).pixels, render_image(*renderer, nominal, view).pixels);
  EXPECT_NE(drr(by_atlas + kTube).pixels, drr(by_atlas).pixels);
  run("af-register --study " + path("study.toml") + kTube + "--field AP=" + path("turn.af.h5") +
      " --field LAT=" + path("LAT.af.h5") +
      " --start-rotation-deg -1,0.5,2.5 --start-translation-mm 0.5,1,4 -o " + path("by-atlas"));
  EXPECT_LT(result("by-atlas").at("tre_mm").get<double>(), 1.0);
}

TEST_F(SpectrumPrograms, RefuseWhatDoesNotFit) {
  const std::string out = " -o " + path("refused.mha");
  const std::string field = "af-drr --field " + path("AP.af.h5");
  expect_refused(field + " --tube-kvp 10" + out, 3, "tube_kvp = 10");
  expect_refused(field + " --scatter-to-primary -1" + out, 3, "scatter_to_primary = -1");
  expect_refused("af-drr --field " + path("AP.bone.af.h5") + out, 4, "of its bone alone");
  expect_refused("af-register --study " + path("study.toml") +
                     " --field AP=" + path("AP.bone.af.h5") + " --field LAT=" + path("LAT.af.h5") +
                     " -o " + path("refused"),
                 4,
                 "of its bone alone");
  fs::copy_file(path("AP.af.h5"), path("lonely.af.h5"));
  const std::string lonely = "af-drr --field " + path("lonely.af.h5");
  expect_refused(lonely + kTube + out, 4, "lonely.bone.af.h5");
  fs::copy_file(path("AP.af.h5"), path("lonely.bone.af.h5"));
  expect_refused(lonely + kTube + out, 4, "one of all of it");
  write_ct(box_phantom(test::five_ellipsoids().grid, {8, 8, 8}, {24, 24, 24}, 40),
           path("water.nii.gz"));
  expect_refused("af-precompute --ct " + path("water.nii.gz") + " --rig " + path("rig.toml") +
                     " --camera AP --material bone -o " + path("refused.af.h5"),
                 3,
                 "has no bone");
  expect_refused("af-precompute --ct " + path("water.nii.gz") + " --rig " + path("rig.toml") +
                     " --camera AP --material steel -o " + path("refused.af.h5"),
                 3,
                 "material = steel");
  EXPECT_FALSE(fs::exists(path("refused.mha")));
}

TEST_F(SpectrumPrograms, RefuseBoneOfAnotherCt) {
  fs::create_directory(path("other"));
  test::write_small_study(path("other"), test::bones_in_a_corner());
  fs::copy_file(path("AP.af.h5"), path("mixed.af.h5"));
  run("af-precompute --study " + path("other/study.toml") +
      " --camera AP --max-rotation-deg 8 --max-translation-mm 12 --uv-nodes 8 --st-nodes 32"
      " --codewords 64 --material bone -o " +
      path("mixed.bone.af.h5"));
  expect_refused("af-drr --field " + path("mixed.af.h5") + kTube + " -o " + path("refused.mha"),
                 4,
                 "CT of the field: expected that of the field beside it");
}

TEST_F(SpectrumPrograms, EvaluationTakesTheTubeToo) {
  run("af-evaluate image-quality --field " + path("AP.af.h5") + " --ct " + path("ct.nii.gz") +
      kTube + "--pose-count 3 -o " + path("quality"));
  std::ifstream file(path("quality/summary.json"));
  const nlohmann::json summary = nlohmann::json::parse(file);
  EXPECT_GT(summary.at("psnr_db").at("min").get<double>(), 25.0);
  expect_refused("af-evaluate image-quality --field " + path("AP.af.h5") + " --ct " +
                     path("ct.nii.gz") + kTube + "--split-loss-poses 1 -o " + path("refused"),
                 3,
                 "must be 0 with --tube-kvp");
}

}  // namespace
}  // namespace af
