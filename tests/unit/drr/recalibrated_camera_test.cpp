// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "drr/field_level.h"
#include "drr/field_set_drr.h"
#include "drr/ray_cast_drr.h"
#include "drr/two_pass_af_drr.h"
#include "geometry/camera_distance.h"
#include "geometry/ray_coverage.h"
#include "geometry/slab_sizing.h"
#include "support/c_arm_camera.h"
#include "support/ct_phantoms.h"
#include "support/cube_grid.h"
#include "unit/drr/small_fields.h"
#include "xray/psnr.h"

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
  return test::moved_camera(camera, turn, shift);
}

/// A field without codebook for a camera, cast node by node.
std::shared_ptr<const FieldLevel> level_for(const CameraGeometry& camera,
                                            const MotionRange& range,
                                            const AttenuationVolume& volume) {
  auto level = std::make_shared<FieldLevel>();
  LightSlabSpec spec;
  spec.uv_nodes = 20;
  spec.st_nodes = 96;
  level->field_geometry = make_light_slab(camera, {}, range, volume.corner_points(), spec);
  const SlabGeometry& slab = level->field_geometry.slabs[0];
  level->quantizer_step = static_cast<float>(volume.max_total_attenuation() / 65535.0);
  const RigidTransform ct_from_slab = level->field_geometry.slab_from_ct.inverse();
  const RayCaster caster(volume, {});
  std::vector<float> image(FieldLevelSlab{slab, {}}.samples_per_viewpoint());
  std::vector<std::uint16_t> samples;
  for (int u = 0; u < level->field_geometry.u.nodes; ++u)
    for (int v = 0; v < level->field_geometry.v.nodes; ++v) {
      const Eigen::Vector3d s_step = slab.s.spacing_mm() * Eigen::Vector3d::UnitX();
      const Eigen::Vector3d t_step = slab.t.spacing_mm() * Eigen::Vector3d::UnitZ();
      caster.cast({ct_from_slab * level->field_geometry.viewpoint(u, v),
                   ct_from_slab * level->field_geometry.st_point(
                                      slab, slab.stored_s.begin, slab.stored_t.begin),
                   ct_from_slab.linear() * s_step,
                   ct_from_slab.linear() * t_step,
                   slab.stored_s.count,
                   slab.stored_t.count},
                  image);
      for (const float value : image)
        samples.push_back(static_cast<std::uint16_t>(std::lround(value / level->quantizer_step)));
    }
  samples.resize(samples.size() + kFieldLevelPadding);
  const SampleExtent extent{
      level->field_geometry.u.nodes, level->field_geometry.v.nodes, image.size()};
  level->slabs.push_back({slab, LevelSamples(extent, std::move(samples))});
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
  const MotionRange box = covered_box(old_level->field_geometry, camera, {}, range);
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
  // Both lattices have the same nodes on planes of nearly the same size. Errors of linear
  // interpolation go with the square of the spacing, whose ratio is that of the planes' sides. What
  // a pose gains beyond that is chance: where its rays fall between the nodes. Two standard errors
  // bound it.
  const auto spacing = [](const FieldLevel& level) {
    return level.field_geometry.slabs[0].s.spacing_mm() *
           level.field_geometry.slabs[0].t.spacing_mm();
  };
  const double by_spacing_db = 20.0 * std::log10(spacing(*old_level) / spacing(*own_level));
  const double chance_db = 2.0 * std::sqrt(variance / kRecalibratedPoses);
  constexpr double kLargestLossDb = 0.3;
  EXPECT_LT(std::abs(by_spacing_db), 0.5 * kLargestLossDb);
  EXPECT_LT(chance_db, 0.5 * kLargestLossDb);
  EXPECT_LT(mean, kLargestLossDb) << "+- " << chance_db << " dB by chance";
}

/// The camera turned about the long axis through the isocentre, as an orbit turns it.
CameraGeometry at_angle(double angle_deg) {
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(angle_deg * kRadPerDeg, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return test::moved_camera(small_camera(), turn, Eigen::Vector3d::Zero());
}

/// Fields of two angles of an orbit, 12 degrees apart, each good for 8 degrees and more.
class FieldSetDrrTest : public testing::Test {
 protected:
  static constexpr double kHalfDeg = 6.0;

  static void SetUpTestSuite() {
    volume = bones_volume();
    const MotionRange range{10.0 * kRadPerDeg, 10.0};
    levels = {level_for(at_angle(-kHalfDeg), range, *volume),
              level_for(at_angle(kHalfDeg), range, *volume)};
  }
  static void TearDownTestSuite() {
    levels.clear();
    volume.reset();
  }

  static FieldSetDrr set() {
    std::vector<FieldSetMember> members;
    for (const auto& level : levels)
      members.push_back({std::shared_ptr<const LightSlab>(level, &level->field_geometry),
                         std::make_shared<const TwoPassAfDrr>(level)});
    return FieldSetDrr(std::move(members));
  }

  static inline std::shared_ptr<const AttenuationVolume> volume;
  static inline std::vector<std::shared_ptr<const FieldLevel>> levels;
};

TEST_F(FieldSetDrrTest, LooksUpInTheFieldThatHoldsThePoseBest) {
  const FieldSetDrr fields = set();
  const RigidTransform pose = pose_from_parameters({}, {});
  for (const std::size_t own : {0U, 1U}) {
    const View view = View::whole_detector(at_angle(own == 0 ? -kHalfDeg : kHalfDeg));
    EXPECT_EQ(fields.weights(pose, view)[own], 1.0);
    EXPECT_EQ(render_image(fields, pose, view).pixels,
              render_image(TwoPassAfDrr(levels[own]), pose, view).pixels);
  }
  // One field still serves alone where another axis comes nearer to the planes' edges than the
  // angle does.
  PoseParameters tilted;
  tilted.rotation_rad.x() = 8.0 * kRadPerDeg;
  EXPECT_EQ(fields.weights(pose_from_parameters({}, tilted),
                           View::whole_detector(at_angle(-kHalfDeg)))[0],
            1.0);
  // Half way, both are as good.
  const std::vector<double> middle = fields.weights(pose, View::whole_detector(at_angle(0.0)));
  EXPECT_NEAR(middle[0], 0.5, 1e-6);
  EXPECT_NEAR(middle[1], 0.5, 1e-6);
}

TEST_F(FieldSetDrrTest, HasNoJumpAtASeam) {
  const FieldSetDrr fields = set();
  const RayCastDrr reference(volume);
  const RigidTransform pose = pose_from_parameters({}, {});
  // Steps like an optimiser's last ones. A weight falls from 1 to 0 while the logarithms of the
  // rays' distances from the edges come to differ by kSeam = 0.4. They differ by some 0.3 per
  // degree, so a weight changes by far less than 0.2 per step. The DRR changes by that part of the
  // difference of two fields.
  constexpr double kStepDeg = 0.05;
  constexpr double kLargestWeightStep = 0.2;
  constexpr double kLargestJumpDb = 0.5;
  std::vector<double> last;
  double last_db = 0.0;
  bool is_any_blended = false;
  for (double angle = -2.0; angle <= 2.0; angle += kStepDeg) {
    const View view = View::whole_detector(at_angle(angle));
    ASSERT_EQ(fields.rays_outside(pose, view), 0);
    const std::vector<double> weights = fields.weights(pose, view);
    ASSERT_NEAR(weights[0] + weights[1], 1.0, 1e-12);
    is_any_blended = is_any_blended || (weights[0] > 0.1 && weights[1] > 0.1);
    const double db =
        psnr(render_image(fields, pose, view).pixels, render_image(reference, pose, view).pixels)
            ->psnr_db;
    if (!last.empty()) {
      EXPECT_LT(std::abs(weights[0] - last[0]), kLargestWeightStep) << angle << " deg";
      EXPECT_LT(std::abs(db - last_db), kLargestJumpDb) << angle << " deg";
    }
    last = weights;
    last_db = db;
  }
  EXPECT_TRUE(is_any_blended);
}

TEST_F(FieldSetDrrTest, CountsRaysThatNoFieldHolds) {
  const FieldSetDrr fields = set();
  const View view = View::whole_detector(at_angle(40.0));
  const RigidTransform pose = pose_from_parameters({}, {});
  std::int64_t outside = 0;
  render_image(fields, pose, view, &outside);
  EXPECT_GT(outside, 0);
  EXPECT_EQ(fields.rays_outside(pose, view), outside);
}

TEST_F(FieldSetDrrTest, GradientsAreTheAverageOfTheFields) {
  const FieldSetDrr fields = set();
  const View view = View::whole_detector(at_angle(0.3));
  const RigidTransform pose = pose_from_parameters({}, {});
  const std::vector<double> weights = fields.weights(pose, view);
  ASSERT_GT(weights[0], 0.05);
  ASSERT_GT(weights[1], 0.05);
  const auto planes_of = [&](const DrrRenderer& renderer) {
    std::vector<float> values(view.pixel_count());
    std::vector<float> planes(6 * view.pixel_count());
    const auto workspace = renderer.make_workspace();
    renderer.render(pose, view, *workspace, values, PoseGradients{Eigen::Vector3d::Zero(), planes});
    return planes;
  };
  const std::vector<float> together = planes_of(fields);
  const std::vector<float> first = planes_of(TwoPassAfDrr(levels[0]));
  const std::vector<float> second = planes_of(TwoPassAfDrr(levels[1]));
  // Three roundings of float.
  constexpr double kRounding = 4e-7;
  for (std::size_t i = 0; i < together.size(); ++i) {
    const double a = weights[0] * static_cast<double>(first[i]);
    const double b = weights[1] * static_cast<double>(second[i]);
    EXPECT_NEAR(together[i], a + b, kRounding * (std::abs(a) + std::abs(b)) + 1e-12);
  }
}

}  // namespace
}  // namespace af
