// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/shear_warp_caster.h"

#include <gtest/gtest.h>

#include "base/vector_width.h"
#include "precompute/casting/trilinear_caster.h"
#include "support/cast_plan.h"
#include "support/ct_phantoms.h"
#include "unit/precompute/casting/shear_warp_cases.h"

namespace af {
namespace {

/// One of each kind, for tests that cast many plans.
std::vector<Eigen::Matrix3d> two_rotations() {
  return {test::aligned_rotations()[1], test::oblique_rotations()[0]};
}

/// A caster with all that it refers to.
struct CastCase {
  CastCase(const CtVolume& ct, const LightSlab& light_slab_in)
      : volume(ct, AttenuationModel{}),
        light_slab(light_slab_in),
        resampled(volume, light_slab.slab_from_ct) {}

  [[nodiscard]] ShearWarpFieldCaster caster() const { return {resampled, light_slab, quantizer}; }
  [[nodiscard]] Eigen::Vector3d ct_viewpoint(const Node& node) const {
    return light_slab.slab_from_ct.inverse() * light_slab.viewpoint(node[0], node[1]);
  }
  [[nodiscard]] Eigen::Vector3d ct_st_point(const Node& node) const {
    return light_slab.slab_from_ct.inverse() *
           light_slab.st_point(light_slab.slabs[0], node[2], node[3]);
  }

  AttenuationVolume volume;
  LightSlab light_slab;
  SlabAlignedVolume resampled;
  AttenuationQuantizer quantizer =
      AttenuationQuantizer::for_maximum(volume.max_total_attenuation());
};

double mu_per_mm(int hu) {
  return AttenuationModel{}.mu_per_mm_per_unit() * (1000.0 + hu);
}

TEST(ShearWarpFieldCaster, UniformBoxGivesMuTimesThePathThroughIt) {
  // The slab frame's y runs along the CT's y: rays enter and leave through two faces.
  constexpr int kHu = 340;
  const CtVolume ct =
      box_phantom(test::centered_grid({60, 30, 50}, {1.1, 1.7, 1.3}), {4, 6, 5}, {55, 21, 44}, kHu);
  const CastCase box(ct, test::small_light_slab(test::aligned_rotations()[0]));
  const double low_y = (6 - 14.5 - 1.0) * 1.7;  // one voxel beyond the faces
  const double high_y = (21 - 14.5 + 1.0) * 1.7;
  const double thickness_mm = 16 * 1.7;
  // A level is stored rounded to half of one in more than 20000, and sums are exact.
  constexpr double kRelative = 0.5 / 20000.0 + 1e-6;
  int inside = 0;
  for (const auto& [node, sample] : cast_plan(box.caster(), box.light_slab)) {
    const Eigen::Vector3d from = box.ct_viewpoint(node);
    const Eigen::Vector3d direction = box.ct_st_point(node) - from;
    const auto is_within = [&](double y) {
      const Eigen::Vector3d point = from + (y - from.y()) / direction.y() * direction;
      return std::abs(point.x() + 0.0) < 24.0 * 1.1 && std::abs(point.z()) < 18.0 * 1.3;
    };
    if (!is_within(low_y) || !is_within(high_y)) continue;
    ++inside;
    const double expected =
        mu_per_mm(kHu) * thickness_mm * direction.norm() / std::abs(direction.y());
    ASSERT_NEAR(box.quantizer.dequantize(sample),
                expected,
                0.5 * static_cast<double>(box.quantizer.step()) + kRelative * expected);
  }
  EXPECT_GT(inside, 2000);
}

TEST(ShearWarpFieldCaster, EllipsoidGivesMuTimesChordLength) {
  Ellipsoid body;
  body.center_mm = Eigen::Vector3d(2.0, -3.0, 1.0);
  body.semi_axes_mm = Eigen::Vector3d(24.0, 17.0, 20.0);
  body.rotation = rotation_from_angles({0.3, 0.2, -0.4});
  body.hu = 500;
  const CtVolume ct = ellipsoid_phantom(test::centered_grid({64, 63, 65}, {1.0, 1.0, 1.0}), {body});
  // Where a ray enters and leaves, the surface is known to half a voxel; chords beyond the mean
  // semi-axis keep rays steeper than 45 degrees to it.
  const double end_error_mm = 2.0 * 0.5 * std::sqrt(2.0);
  for (const Eigen::Matrix3d& rotation : test::all_rotations()) {
    const CastCase ellipsoid(ct, test::small_light_slab(rotation));
    int compared = 0;
    double error_sum = 0.0;
    for (const auto& [node, sample] : cast_plan(ellipsoid.caster(), ellipsoid.light_slab)) {
      const double chord_mm =
          body.chord_length_mm(ellipsoid.ct_viewpoint(node), ellipsoid.ct_st_point(node));
      if (chord_mm < 25.0) continue;
      const double error = static_cast<double>(ellipsoid.quantizer.dequantize(sample)) -
                           mu_per_mm(body.hu) * chord_mm;
      ASSERT_LT(std::abs(error), mu_per_mm(body.hu) * end_error_mm);
      error_sum += error;
      ++compared;
    }
    ASSERT_GT(compared, 2000);
    // The mean must be much better: voxels of 27 samples keep the volume to well under 1 %.
    EXPECT_LT(std::abs(error_sum / compared), 0.002 * mu_per_mm(body.hu) * 40.0);
  }
}

/// PSNR (dB) of the caster's samples against the reference caster, as eq. (12).
double psnr_against_reference(const CastCase& cast_case, const NodeSamples& samples) {
  const RayCaster reference(cast_case.volume, {0.25});
  double largest = 0.0;
  double squared_error = 0.0;
  int foreground = 0;
  for (const auto& [node, sample] : samples) {
    const double expected = static_cast<double>(
        reference.total_attenuation(cast_case.ct_viewpoint(node), cast_case.ct_st_point(node)));
    if (expected == 0.0) continue;
    const double error = static_cast<double>(cast_case.quantizer.dequantize(sample)) - expected;
    largest = std::max(largest, expected);
    squared_error += error * error;
    ++foreground;
  }
  return 20.0 * std::log10(largest / std::sqrt(squared_error / foreground));
}

TEST(ShearWarpFieldCaster, AgreesWithTheReferenceOnSmoothBodies) {
  // 75 dB: what the caster must reach on real CTs, 1.8e-4 of the largest sample. On these bodies
  // (sigma 7 mm = some 6 voxels) one linear interpolation is off by h^2/8 mu'' <= 1/8 * (1/6)^2 =
  // 3.5e-3 of mu at most; alternating over some 40 slices it averages to below 1e-4 of their sum.
  constexpr double kRequiredDb = 75.0;
  for (const Eigen::Matrix3d& rotation : test::all_rotations()) {
    const CastCase smooth(test::smooth_ct(), test::small_light_slab(rotation));
    EXPECT_GT(psnr_against_reference(smooth, cast_plan(smooth.caster(), smooth.light_slab)),
              kRequiredDb)
        << rotation;
  }
}

TEST(ShearWarpFieldCaster, AgreesWithTheReferenceWhereTheLatticeCutsTheBody) {
  for (const Eigen::Matrix3d& rotation : test::all_rotations()) {
    LightSlab light_slab = test::small_light_slab(rotation);
    SlabGeometry& slab = light_slab.slabs[0];
    slab.s = {-7.0, 6.0, 15};
    slab.t = {-5.0, 4.0, 9};
    slab.stored_s = {0, 15};
    slab.stored_t = {0, 9};
    const CastCase cut(test::smooth_ct(), light_slab);
    EXPECT_GT(psnr_against_reference(cut, cast_plan(cut.caster(), cut.light_slab)), 75.0);
  }
}

TEST(ShearWarpFieldCaster, RaysBesideTheBodyAreExactlyZero) {
  const CtVolume ct = box_phantom(
      test::centered_grid({30, 31, 32}, {1.0, 1.2, 1.4}), {8, 9, 10}, {20, 19, 22}, 3000);
  for (const Eigen::Matrix3d& rotation : test::all_rotations()) {
    const CastCase box(ct, test::small_light_slab(rotation));
    const RayCaster reference(box.volume, {0.25});
    int beside = 0;
    int through = 0;
    for (const auto& [node, sample] : cast_plan(box.caster(), box.light_slab)) {
      const Eigen::Vector3d from = box.ct_viewpoint(node);
      const Eigen::Vector3d to = box.ct_st_point(node);
      // The border cell is as wide as a voxel, and the resampled grid blurs by half of one.
      bool is_near = false;
      for (const double x : {-0.7, 0.7})
        for (const double y : {-0.7, 0.7})
          for (const double z : {-0.7, 0.7})
            is_near = is_near || reference.total_attenuation(from + Eigen::Vector3d(x, y, z),
                                                             to + Eigen::Vector3d(x, y, z)) > 0.0f;
      if (is_near) {
        through += sample > 0 ? 1 : 0;
        continue;
      }
      ASSERT_EQ(sample, 0);
      ++beside;
    }
    EXPECT_GT(beside, 1000);
    EXPECT_GT(through, 1000);
  }
}

TEST(ShearWarpFieldCaster, NeverLosesASingleVoxel) {
  // Summed over a fine lattice, samples without their obliquity hold the voxel's whole attenuation,
  // wherever it lies between the nodes of the resampled grid.
  const double voxel_mm3 = 1.1 * 1.2 * 1.3;
  constexpr int kHu = 3000;
  for (const Eigen::Matrix3d& rotation : test::all_rotations())
    for (int i = 0; i < 5; ++i) {
      LightSlab light_slab = test::small_light_slab(rotation);
      light_slab.slab_from_ct.translation() = Eigen::Vector3d(0.21 * i, 0.17 * i, 0.13 * i);
      light_slab.u = {-20.0, 20.0, 2};
      light_slab.v = {-20.0, 20.0, 2};
      SlabGeometry& slab = light_slab.slabs[0];
      slab.st_plane_y_mm = 0.0;
      slab.s = {-6.0, 6.0, 61};
      slab.t = {-6.0, 6.0, 61};
      slab.stored_s = {0, 61};
      slab.stored_t = {0, 61};
      const CtVolume ct =
          box_phantom(test::centered_grid({9, 9, 9}, {1.1, 1.2, 1.3}), {4, 4, 4}, {4, 4, 4}, kHu);
      const CastCase spike(ct, light_slab);
      double mass = 0.0;
      for (const auto& [node, sample] : cast_plan(spike.caster(), light_slab)) {
        if (node[0] != 0 || node[1] != 1) continue;
        const Eigen::Vector3d ray = spike.ct_st_point(node) - spike.ct_viewpoint(node);
        const double obliquity = ray.norm() / light_slab.uv_plane_y_mm;
        mass += static_cast<double>(spike.quantizer.dequantize(sample)) / obliquity *
                slab.s.spacing_mm() * slab.t.spacing_mm();
      }
      // The plane lies up to 1 mm off the voxel 500 mm away (0.4 %); the lattice's sum of a hat is
      // good to (0.2 / 1.1)^2 / 12 (0.3 %); clipped negative samples around a sharpened spike add
      // up to 4 %.
      EXPECT_NEAR(mass, mu_per_mm(kHu) * voxel_mm3, 0.05 * mu_per_mm(kHu) * voxel_mm3);
    }
}

TEST(ShearWarpFieldCaster, SamplesDoNotDependOnThePlanOrTheVectorWidth) {
  for (const Eigen::Matrix3d& rotation : two_rotations()) {
    const LightSlab light_slab = test::cut_at(test::small_light_slab(rotation), {-6.0, 2.5});
    const CastCase cut(test::smooth_ct(), light_slab);
    for (std::size_t slab = 0; slab < light_slab.slabs.size(); ++slab) {
      const NodeSamples expected = cast_plan(cut.caster(), light_slab, kShearWarpPlan, slab);
      for (const VectorWidth width : supported_vector_widths()) {
        force_vector_width(width);
        for (const std::int64_t rays_per_unit : {600, 30000})
          EXPECT_EQ(cast_plan(cut.caster(), light_slab, {rays_per_unit}, slab), expected)
              << "width " << to_string(width) << ", " << rays_per_unit << " rays per unit";
      }
      force_vector_width(std::nullopt);
    }
  }
}

TEST(ShearWarpFieldCaster, SlabsSumToTheWhole) {
  for (const Eigen::Matrix3d& rotation : two_rotations()) {
    const LightSlab light_slab = test::small_light_slab(rotation);
    const std::vector<double> boundaries_y_mm = {-15.0, -6.0, 0.0, 2.5, 9.0};
    const CastCase whole(test::smooth_ct(), light_slab);
    const CastCase cut(test::smooth_ct(), test::cut_at(light_slab, boundaries_y_mm));
    const NodeSamples expected = cast_plan(whole.caster(), light_slab);
    NodeSamples sums;
    std::map<Node, int> in_slabs;
    for (std::size_t slab = 0; slab <= boundaries_y_mm.size(); ++slab)
      for (const auto& [node, sample] :
           cast_plan(cut.caster(), cut.light_slab, kShearWarpPlan, slab)) {
        sums[node] = static_cast<std::uint16_t>(sums[node] + sample);
        in_slabs[node] += sample > 0 ? 1 : 0;
      }
    ASSERT_EQ(sums.size(), expected.size());
    // Every slab is rounded to half a level, and so is the whole. Beside the body's rim, where mu
    // jumps to 10 % of water's, sharpened slices overshoot by 23/180 of that; where a slab sums to
    // less than 0 over the some 4 mm that its rays graze the rim, it counts as 0.
    const double rounding = (static_cast<double>(boundaries_y_mm.size()) + 2.0) / 2.0;
    const double overshoot = 23.0 / 180.0 * 0.1 * mu_per_mm(0) * 4.0;
    const double tolerance =
        rounding + (whole.resampled.grid().is_oblique()
                        ? overshoot / static_cast<double>(whole.quantizer.step())
                        : 0.0);
    int most_slabs = 0;
    for (const auto& [node, sample] : expected) {
      ASSERT_LE(std::abs(int{sums[node]} - int{sample}), tolerance);
      most_slabs = std::max(most_slabs, in_slabs[node]);
    }
    EXPECT_GT(most_slabs, 4);
  }
}

TEST(ShearWarpFieldCaster, AgreesWithTheReferenceInEverySlab) {
  constexpr double kShiftMm = 0.2113 * 1.2;  // of slices beside the CT's planes
  const LightSlab light_slab = test::cut_at(test::small_light_slab(test::aligned_rotations()[0]),
                                            {-6.6 - 2.1 - kShiftMm, 6.6 - 2.1 - kShiftMm});
  const CastCase cut(test::smooth_ct(), light_slab);
  const TrilinearFieldCaster reference(cut.volume, light_slab, cut.quantizer, {0.25});
  // Boundaries lie midway between slices. There the reference ends sharply where the trapezoidal
  // rule ends with a weight of 1: on a slope mu' the two differ by dy^2 / 8 mu' per boundary. Here
  // mu' <= 0.6 * 2.5 mu_water / 7 mm and dy = 1.2 mm: 0.0008, obliquity included 0.0009.
  constexpr double kTolerance = 2 * 0.0009;
  int occupied = 0;
  for (std::size_t slab = 0; slab < 3; ++slab) {
    const NodeSamples samples = cast_plan(cut.caster(), light_slab, kShearWarpPlan, slab);
    for (const auto& [node, expected] : cast_plan(reference, light_slab, {262144}, slab)) {
      ASSERT_NEAR(cut.quantizer.dequantize(samples.at(node)),
                  cut.quantizer.dequantize(expected),
                  kTolerance);
      occupied += expected > 0 ? 1 : 0;
    }
  }
  EXPECT_GT(occupied, 50000);
}

TEST(ShearWarpFieldCaster, DoesNotOverflowOnTheDensestCtThereCanBe) {
  // Every voxel at the top of the HU scale, 400 slices.
  const CtVolume ct = box_phantom(
      test::centered_grid({40, 400, 40}, {1.0, 0.9, 1.0}), {0, 0, 0}, {39, 399, 39}, 32767);
  for (const double tilt : {0.0, 0.05}) {
    LightSlab light_slab = test::small_light_slab(rotation_from_angles({tilt, tilt, 0.0}));
    light_slab.u = {-5.0, 5.0, 2};
    light_slab.v = {-5.0, 5.0, 2};
    const CastCase dense(ct, light_slab);
    const RayCaster reference(dense.volume, {0.25});
    double largest = 0.0;
    for (const auto& [node, sample] : cast_plan(dense.caster(), light_slab)) {
      const auto expected = static_cast<double>(
          reference.total_attenuation(dense.ct_viewpoint(node), dense.ct_st_point(node)));
      largest = std::max(largest, expected);
      // Rays that graze a face see the two casters' different blur of it: a whole voxel's width.
      if (expected < 200.0) continue;
      ASSERT_NEAR(dense.quantizer.dequantize(sample), expected, 0.01 * mu_per_mm(32767) * 360.0);
    }
    EXPECT_GT(largest, 0.95 * mu_per_mm(32767) * 400 * 0.9);
  }
}

TEST(ShearWarpFieldCaster, PartialTilesLoseNoColumn) {
  // Stored t ranges of every length up to more than two vectors.
  for (int count = 1; count <= 67; count += 3) {
    LightSlab light_slab = test::small_light_slab(test::aligned_rotations()[0]);
    light_slab.slabs[0].stored_t = {10, count};
    light_slab.slabs[0].stored_s = {40, 2};
    light_slab.slabs[0].st_plane_y_mm = 0.0;
    const CtVolume ct =
        box_phantom(test::centered_grid({90, 9, 260}, {1.0, 1.0, 1.0}), {1, 1, 1}, {88, 7, 258}, 0);
    const CastCase plate(ct, light_slab);
    const NodeSamples samples = cast_plan(plate.caster(), light_slab);
    EXPECT_EQ(samples.size(), static_cast<std::size_t>(5 * 4 * 2 * count));
    for (const auto& [node, sample] : samples)
      ASSERT_GE(plate.quantizer.dequantize(sample), static_cast<float>(0.99 * mu_per_mm(0) * 7.0));
  }
}

}  // namespace
}  // namespace af
