// SPDX-License-Identifier: Apache-2.0
// caster_accuracy CT RIG CAMERA MAX_TRANSLATION_MM [RX RY RZ]: accuracy of the shear-warp caster
// with the CT turned by RX, RY, RZ degrees about the isocentre.
#include <cstdio>
#include <string>

#include "ct/ct_reader.h"
#include "physics/caster_accuracy.h"
#include "study/rig_file.h"

int main(int argc, char** argv) {
  using namespace af;
  if (argc != 5 && argc != 8) {
    std::fprintf(stderr, "usage: %s CT RIG CAMERA MAX_TRANSLATION_MM [RX RY RZ]\n", argv[0]);
    return 2;
  }
  try {
    const CtVolume ct = read_ct(argv[1]);
    const CameraRig rig = read_rig(argv[2]);
    Eigen::Vector3d angles = Eigen::Vector3d::Zero();
    for (int axis = 0; axis < argc - 5; ++axis) angles[axis] = std::stod(argv[5 + axis]);
    const PoseFrame frame{
        rotation_from_angles(angles * kRadPerDeg), ct.grid.center_mm(), rig.isocenter_point};
    constexpr int kRows = 400;
    const auto found = test::measure_caster_accuracy(AttenuationVolume(ct, AttenuationModel{}),
                                                     rig.camera(argv[3]),
                                                     frame,
                                                     {10.0 * kRadPerDeg, std::stod(argv[4])},
                                                     kRows);
    std::printf(
        "%.1f dB over %d rays (reference against itself at twice the step %.1f dB), grid %.0f MB\n",
        found.psnr_db,
        found.rays,
        found.reference_psnr_db,
        static_cast<double>(found.grid_bytes) * 1e-6);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
