// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "drr/field_level.h"
#include "drr/ray_cast_drr.h"
#include "drr/two_pass_af_drr.h"
#include "geometry/camera_distance.h"
#include "geometry/ray_coverage.h"
#include "image/psnr.h"
#include "support/ct_phantoms.h"
#include "support/cube_grid.h"
#include "unit/drr/small_fields.h"

namespace af {
namespace {

std::shared_ptr<const AttenuationVolume> bones_volume() {
  const CtVolume ct =
      ellipsoid_phantom(test::cube_grid(48, 2.0),
                        {{{0, 0, 0}, {38, 30, 34}, Eigen::Matrix3d::Identity(), 0},
                         {{12, -8, 10}, {9, 6, 14}, Eigen::Matrix3d::Identity(), 900},
                         {{-14, 9, -6}, {7, 12, 8}, Eigen::Matrix3d::Identity(), 700}},
                        2);
  return std::make_shared<const AttenuationVolume>(ct, AttenuationModel{});
}

/// The camera after a calibration that finds it turned by 1 degree about the isocentre and moved by
/// 5 mm.
CameraGeometry recalibrated(const CameraGeometry& camera) {
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.0 * kRadPerDeg, Eigen::Vector3d(1, -2, 3).normalized())
          .toRotationMatrix();
  const Eigen::Vector3d shift = 5.0 * Eigen::Vector3d(2, 1, -2).normalized();
  CameraGeometry moved = camera;
  moved.source_point = turn * camera.source_point + shift;
  moved.detector_origin_point = turn * camera.detector_origin_point + shift;
  moved.column_direction = turn * camera.column_direction;
  moved.row_direction = turn * camera.row_direction;
  return moved;
}

/// A field without codebook for a camera, cast node by node.
std::shared_ptr<const FieldLevel> level_for(const CameraGeometry& camera,
                                            const MotionRange& range,
                                            const AttenuationVolume& volume) {
  auto level = std::make_shared<FieldLevel>();
  LightSlabSpec spec;
  spec.uv_nodes = 20;
  spec.st_nodes = 96;
  level->coverage = make_light_slab(camera, {}, range, volume.corner_points(), spec);
  const SlabGeometry& slab = level->coverage.slabs[0];
  level->quantizer_step = static_cast<float>(volume.max_total_attenuation() / 65535.0);
  const RigidTransform ct_from_slab = level->coverage.slab_from_ct.inverse();
  const RayCaster caster(volume, {});
  std::vector<float> image(FieldLevelSlab{slab, {}}.samples_per_viewpoint());
  std::vector<std::uint16_t> samples;
  for (int u = 0; u < level->coverage.u.nodes; ++u)
    for (int v = 0; v < level->coverage.v.nodes; ++v) {
      const Eigen::Vector3d s_step = slab.s.spacing_mm() * Eigen::Vector3d::UnitX();
      const Eigen::Vector3d t_step = slab.t.spacing_mm() * Eigen::Vector3d::UnitZ();
      caster.cast(
          {ct_from_slab * level->coverage.viewpoint(u, v),
           ct_from_slab * level->coverage.st_point(slab, slab.stored_s.begin, slab.stored_t.begin),
           ct_from_slab.linear() * s_step,
           ct_from_slab.linear() * t_step,
           slab.stored_s.count,
           slab.stored_t.count},
          image);
      for (const float value : image)
        samples.push_back(static_cast<std::uint16_t>(std::lround(value / level->quantizer_step)));
    }
  samples.resize(samples.size() + kFieldLevelPadding);
  level->slabs.push_back({slab, SharedArray<std::uint16_t>(std::move(samples))});
  return level;
}

TEST(RecalibratedCamera, IsLookedUpInTheOldFieldAsWellAsInItsOwn) {
  const auto volume = bones_volume();
  const CameraGeometry nominal = small_camera();
  const CameraGeometry camera = recalibrated(nominal);
  const CameraDistance distance = camera_distance(camera, nominal);
  EXPECT_NEAR(distance.rotation_deg, 1.0, 1e-6);
  const MotionRange range{8.0 * kRadPerDeg, 20.0};
  const auto old_level = level_for(nominal, range, *volume);
  const auto own_level = level_for(camera, range, *volume);
  const MotionRange box = covered_box(old_level->coverage, camera, {}, range);
  ASSERT_GT(box.max_rotation_rad(), 4.0 * kRadPerDeg);
  const TwoPassAfDrr old_field(old_level);
  const TwoPassAfDrr own_field(own_level);
  const RayCastDrr reference(volume);
  const View view = View::whole_detector(camera);
  HashRandom random(23);
  constexpr int kRecalibratedPoses = 100;
  std::vector<double> gains;
  for (int i = 0; i < kRecalibratedPoses; ++i) {
    PoseParameters parameters;
    for (int axis = 0; axis < 3; ++axis) {
      parameters.rotation_rad[axis] = box.max_rotation_rad() * random.uniform(-1.0, 1.0);
      parameters.translation_mm[axis] = box.max_translation_mm() * random.uniform(-1.0, 1.0);
    }
    const RigidTransform pose = pose_from_parameters({}, parameters);
    ASSERT_EQ(old_field.rays_outside(pose, view), 0);
    const Image2d truth = render_image(reference, pose, view);
    const auto quality = [&](const TwoPassAfDrr& field) {
      return psnr(render_image(field, pose, view).pixels, truth.pixels)->psnr_db;
    };
    gains.push_back(quality(own_field) - quality(old_field));
  }
  double mean = 0.0;
  for (const double gain : gains) mean += gain / kRecalibratedPoses;
  double variance = 0.0;
  for (const double gain : gains)
    variance += (gain - mean) * (gain - mean) / (kRecalibratedPoses - 1);
  // Both lattices have the same nodes on planes of nearly the same size: errors of linear
  // interpolation go with the square of the spacing, whose ratio is that of the planes' sides. What
  // a pose gains beyond that is chance, where its rays fall between the nodes: two standard errors.
  const auto spacing = [](const FieldLevel& level) {
    return level.coverage.slabs[0].s.spacing_mm() * level.coverage.slabs[0].t.spacing_mm();
  };
  const double by_spacing_db = 20.0 * std::log10(spacing(*old_level) / spacing(*own_level));
  const double chance_db = 2.0 * std::sqrt(variance / kRecalibratedPoses);
  constexpr double kLargestLossDb = 0.3;
  EXPECT_LT(std::abs(by_spacing_db), 0.5 * kLargestLossDb);
  EXPECT_LT(chance_db, 0.5 * kLargestLossDb);
  EXPECT_LT(mean, kLargestLossDb) << "+- " << chance_db << " dB by chance";
}

}  // namespace
}  // namespace af
