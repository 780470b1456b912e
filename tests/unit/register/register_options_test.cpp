// SPDX-License-Identifier: Apache-2.0
#include "register/register_options.h"

#include <fstream>
#include <limits>

#include <gtest/gtest.h>

#include "base/error.h"
#include "files/options_toml.h"
#include "register/registration_run.h"
#include "support/test_paths.h"

namespace af::registration {
namespace {

TEST(RegisterOptions, ListsEveryBrokenConstraint) {
  RegisterOptions options;
  options.fields.texts = {"A", "=a.h5", "B=b.h5", "B=c.h5"};
  options.start_rotation_deg = {{0.0, 0.0, std::numeric_limits<double>::infinity()}};
  options.start_pose = "pose.toml";
  options.starts = "starts.csv";
  options.renderer = "raycast";
  options.skip_ct_check = true;
  options.attenuation.mu_water_per_mm = -1.0;
  options.ray_caster.step_mm = 0.0;
  std::string all;
  for (const std::string& text : problems(options)) all += text + "\n";
  for (const char* part : {"--field = 'A': must be CAMERA=PATH",
                           "--field = '=a.h5'",
                           "camera 'B' is given twice",
                           "start = given in several ways",
                           "start = not finite",
                           "--skip-ct-check",
                           "water_mu_per_mm = -1",
                           "step_mm"})
    EXPECT_NE(all.find(part), std::string::npos) << part << "\nin\n" << all;
  EXPECT_TRUE(problems(RegisterOptions()).empty());
}

TEST(RegisterOptions, FieldsAreSplitAtTheFirstEqualsSign) {
  RegisterOptions options;
  options.fields.texts = {"A=x=y.h5"};
  EXPECT_EQ(case_load_options(options).field_paths.at("A"), "x=y.h5");
}

TEST(RegisterOptions, RaysAreCastWhereNothingNamesOrNeedsAField) {
  StudyCase study_case;
  study_case.views.resize(2);
  RegisterOptions options;
  EXPECT_EQ(renderer_of(options, study_case), "raycast");
  options.renderer = "field";
  EXPECT_EQ(renderer_of(options, study_case), "field");
  options.renderer = "auto";
  options.correction.is_wanted = true;
  EXPECT_EQ(renderer_of(options, study_case), "field");
  options.correction.is_wanted = false;
  options.skip_ct_check = true;
  EXPECT_EQ(renderer_of(options, study_case), "field");
  options.skip_ct_check = false;
  options.fields.texts = {"A=a.h5"};
  EXPECT_EQ(renderer_of(options, study_case), "field");
  options.fields.texts.clear();
  study_case.views[1].field = "b.h5";
  EXPECT_EQ(renderer_of(options, study_case), "field");
  options.renderer = "raycast";
  EXPECT_EQ(renderer_of(options, study_case), "raycast");
}

TEST(RegisterOptions, InForceAreToml) {
  RegisterOptions options;
  options.study = "a\tb\n\x7f\"\\.toml";
  options.fields.texts = {"A=line\nbreak.h5"};
  const std::string text = to_toml(options);
  for (const char* line :
       {R"(study = "a\u0009b\u000A\u007F\"\\.toml")", "field = [\"A=line\\u000Abreak.h5\"]\n"})
    EXPECT_NE(text.find(line), std::string::npos) << line << " in " << text;
}

TEST(RegisterOptions, InputsDecideByTheirContentAlone) {
  RegisterOptions options;
  const OptionTexts before = deciding_options(options);
  options.study = "other.toml";
  options.fields.texts = {"A=a.h5"};
  options.starts = "starts.csv";
  options.method.threads = 3;
  EXPECT_EQ(deciding_options(options), before);
  options.ray_caster.step_mm = 0.7;
  EXPECT_NE(deciding_options(options), before);
}

PoseFrame some_frame() {
  RigidTransform nominal = RigidTransform::Identity();
  nominal.translation() = Eigen::Vector3d(10, 20, 30);
  return PoseFrame::about(nominal, {1, 2, 3});
}

std::vector<RigidTransform> poses_of(const RegisterOptions& options) {
  std::vector<std::string> notes;
  return start_poses(options, {some_frame()}, notes);
}

TEST(StartPoses, AreNominalUnlessToldOtherwise) {
  const std::vector<RigidTransform> starts = poses_of(RegisterOptions());
  ASSERT_EQ(starts.size(), 1U);
  EXPECT_TRUE(starts[0].isApprox(some_frame().nominal_room_from_ct(), 1e-12));
}

TEST(StartPoses, OfParametersAreRelativeToNominal) {
  RegisterOptions options;
  options.start_rotation_deg = {{1.0, -2.0, 3.0}};
  options.start_translation_mm = {{4.0, 5.0, -6.0}};
  const RigidTransform start = poses_of(options).at(0);
  const std::array<double, 6> expected = {1, -2, 3, 4, 5, -6};
  const std::array<double, 6> found = parameters_from_pose(some_frame(), start).deg_and_mm();
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(found[i], expected[i], 1e-9) << i;
}

TEST(StartPoses, OfAFileAreItsRowsInOrder) {
  const test::ScratchFolder folder;
  RegisterOptions options;
  options.starts = folder / "starts.csv";
  std::ofstream(options.starts) << "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n0,0,0,0,0,0\n"
                                   "0,0,0,7,0,0\n";
  const std::vector<RigidTransform> starts = poses_of(options);
  ASSERT_EQ(starts.size(), 2U);
  EXPECT_NEAR((starts[1].translation() - starts[0].translation()).x(), 7.0, 1e-12);
  std::ofstream(options.starts) << "rx_deg,ry_deg\n0,0\n";
  EXPECT_THROW(poses_of(options), InputError);
  std::ofstream(options.starts) << "";
  EXPECT_THROW(poses_of(options), FileError);
  options.starts = folder / "absent.csv";
  EXPECT_THROW(poses_of(options), FileError);
}

}  // namespace
}  // namespace af::registration
