// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "ct/ct_reader.h"
#include "physics/caster_accuracy.h"
#include "study/rig_file.h"

namespace af {
namespace {

// A caster may cost a field 0.1 dB. Its squared error may then be 0.1 dB * ln(10) / 10 = 2.3 %
// (-16.4 dB) of the field's own. So 75 dB are enough for fields of up to 58 dB, and those of the
// skull reach some 50.
constexpr double kLeastDb = 75.0;
// caster_accuracy takes as many.
constexpr int kRows = 400;

CtVolume skull() {
  return read_ct(AF_DEFAULT_CT_PATH);
}

void expect_accurate(const std::string& rig_name,
                     const std::string& camera,
                     const Eigen::Vector3d& angles_deg,
                     double max_translation_mm) {
  const CtVolume ct = skull();
  const CameraRig rig = read_rig(rig_name);
  const PoseFrame frame{
      rotation_from_angles(angles_deg * kRadPerDeg), ct.grid.center_mm(), rig.isocenter_point};
  const test::CasterAccuracy found =
      test::measure_caster_accuracy(AttenuationVolume(ct, AttenuationModel{}),
                                    rig.camera(camera),
                                    frame,
                                    {10.0 * kRadPerDeg, max_translation_mm},
                                    kRows);
  EXPECT_GT(found.rays, 5000);
  EXPECT_GT(found.reference_psnr_db, kLeastDb + 15.0);  // the reference is converged
  EXPECT_GT(found.psnr_db, kLeastDb);
}

TEST(ShearWarpAccuracy, IsAtLeast75DbAlongTheAxesOfARealCt) {
  expect_accurate("c-arm-12in", "AP", {0.0, 0.0, 0.0}, 100.0);
  expect_accurate("c-arm-12in", "LAT", {0.0, 0.0, 0.0}, 100.0);
}

TEST(ShearWarpAccuracy, IsAtLeast75DbFromObliqueCameras) {
  expect_accurate("treatment-room", "A", {0.0, 0.0, 0.0}, 30.0);
  expect_accurate("c-arm-12in", "AP", {0.0, 0.0, 45.0}, 100.0);
}

TEST(ShearWarpAccuracy, IsAtLeast75DbFromTiltedCameras) {
  expect_accurate("c-arm-12in", "AP", {20.0, -12.0, 30.0}, 100.0);
  expect_accurate("c-arm-12in", "AP", {-15.0, 10.0, 5.0}, 100.0);
  expect_accurate("c-arm-12in", "LAT", {20.0, -12.0, 30.0}, 100.0);
  expect_accurate("treatment-room", "A", {20.0, -12.0, 30.0}, 30.0);
}

}  // namespace
}  // namespace af
