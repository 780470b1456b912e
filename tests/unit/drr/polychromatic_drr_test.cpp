// SPDX-License-Identifier: Apache-2.0
#include "drr/polychromatic_drr.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ct/blurred_volume.h"
#include "drr/bone_volume.h"
#include "drr/field_renderer.h"
#include "drr/material_tables.h"
#include "drr/ray_cast_drr.h"
#include "support/central_differences.h"
#include "support/ct_phantoms.h"
#include "support/cube_grid.h"
#include "unit/drr/small_fields.h"

namespace af {
namespace {

std::shared_ptr<const PolychromaticAttenuation> attenuation_of(const SpectrumOptions& options,
                                                               const AttenuationModel& model = {}) {
  return std::make_shared<const PolychromaticAttenuation>(options, TissueModel(model));
}

/// Rays cast through both materials of a volume.
PolychromaticDrr cast_through(const std::shared_ptr<const AttenuationVolume>& volume,
                              const SpectrumOptions& options) {
  return {std::make_shared<const RayCastDrr>(volume),
          std::make_shared<const RayCastDrr>(bone_volume(*volume)),
          attenuation_of(options, volume->model())};
}

/// A head of soft tissue with a bone in it.
std::shared_ptr<const AttenuationVolume> body() {
  const AttenuationVolume sharp(
      ellipsoid_phantom(test::cube_grid(72, 1.25),
                        {{{0, 0, 0}, {38, 30, 34}, Eigen::Matrix3d::Identity(), 20},
                         {{12, -8, 10}, {9, 6, 14}, Eigen::Matrix3d::Identity(), 1300}}),
      {});
  return blurred_volume(sharp, 4.0);
}

/// mu of the table at an energy, relative to that at the effective energy.
double relative_mu(Material material, double energy_kev) {
  return linear_attenuation_per_mm(material, energy_kev) /
         linear_attenuation_per_mm(material,
                                   effective_energy_kev(AttenuationModel{}.mu_water_per_mm));
}

/// A box between faces at y = -22 and 22 mm, seen along y.
double slab_attenuation(int hu, double share_of_bone, double energy_kev) {
  constexpr double kThicknessMm = 44.0;
  const double all = AttenuationModel{}.mu_water_per_mm * (1.0 + hu / 1000.0) * kThicknessMm;
  return all * ((1.0 - share_of_bone) * relative_mu(Material::Water, energy_kev) +
                share_of_bone * relative_mu(Material::CorticalBone, energy_kev));
}

TEST(PolychromaticDrr, OfASlabIsTheSumOverTheSpectrum) {
  const SpectrumOptions options{80.0, 2.5};
  for (const int hu : {0, 100, 700, 1500}) {
    const auto volume = std::make_shared<const AttenuationVolume>(
        box_phantom(test::cube_grid(15, 4.0), {2, 2, 2}, {12, 12, 12}, hu), AttenuationModel{});
    const PolychromaticDrr renderer = cast_through(volume, options);
    const View view{small_camera(), {15, 11, 1, 1}};  // nearly along y
    const TissueModel tissue{AttenuationModel{}};
    const double share =
        static_cast<double>(tissue.bone_part(static_cast<std::uint16_t>(1000 + hu))) / (1000 + hu);
    // A DRR at one energy gives the chord of this ray through the box.
    const float chord =
        render_image(RayCastDrr(volume), RigidTransform::Identity(), view).pixels.front() /
        static_cast<float>(slab_attenuation(hu, 0.0, tissue.effective_energy_kev()));
    double transmission = 0.0;
    for (const SpectrumBin& bin : tube_spectrum(options, tissue.effective_energy_kev()))
      transmission += bin.weight * std::exp(-static_cast<double>(chord) *
                                            slab_attenuation(hu, share, bin.energy_kev));
    // The interpolated sum, and 0.5 / 1000 of a unit of bone in 44 mm that rounding voxels leaves.
    const double tolerance = PolychromaticAttenuation::kTolerance + 0.0005 * 0.02 * 44.0;
    EXPECT_NEAR(render_image(renderer, RigidTransform::Identity(), view).pixels.front(),
                -std::log(transmission),
                tolerance)
        << hu << " HU";
  }
}

TEST(PolychromaticDrr, OfOneEnergyIsTheOrdinaryDrr) {
  const auto volume = body();
  const View view{small_camera(), {0, 0, 31, 24}};
  const RigidTransform pose = pose_from_parameters({}, small_pose(3));
  const Image2d ordinary = render_image(RayCastDrr(volume), pose, view);
  const Image2d found =
      render_image(cast_through(volume, SpectrumOptions::one_energy()), pose, view);
  for (std::size_t i = 0; i < ordinary.pixels.size(); ++i)
    EXPECT_NEAR(found.pixels[i], ordinary.pixels[i], 1e-6f + 1e-6f * ordinary.pixels[i]);
}

TEST(PolychromaticDrr, GradientsAgreeWithCentralDifferences) {
  const PolychromaticDrr renderer = cast_through(body(), SpectrumOptions{70.0, 2.5});
  const View view{small_camera(), {3, 2, 20, 15}};
  const RigidTransform pose = pose_from_parameters({}, small_pose(6));
  // As in ray casting, differences cross kinks of the interpolant.
  EXPECT_THAT(test::gradient_distances(renderer, pose, view, {10.0, -20.0, 30.0}),
              testing::Each(testing::Lt(0.01)));
}

TEST(PolychromaticDrr, OfTwoFieldsHasTheGradientsOfItsValues) {
  // Integers at the nodes, as small_field() wants them: body and bone that lean differently.
  const auto all = small_field(
      [](const RayNodes& at) { return 12.0 + 2.0 * at.u + at.v + 2.0 * at.s + 3.0 * at.t; }, 1);
  const auto bone = small_field([](const RayNodes& at) { return 2.0 + at.v + at.s + at.t; }, 1);
  const PolychromaticDrr renderer(make_field_renderer(all, "linear"),
                                  make_field_renderer(bone, "linear"),
                                  attenuation_of({70.0, 2.5}));
  const View view{small_camera(), {3, 2, 20, 15}};
  const RigidTransform pose = pose_from_parameters({}, small_pose(4));
  // In multilinear fields only the differences' rounding is left.
  EXPECT_THAT(test::gradient_distances(renderer, pose, view, {5.0, 3.0, -8.0}),
              testing::Each(testing::Lt(0.01)));
}

TEST(PolychromaticDrr, CountsTheRaysThatMissEitherField) {
  const auto field = small_field([](const RayNodes&) { return 1.0; }, 1);
  const auto all = make_field_renderer(field, "linear");
  const PolychromaticDrr renderer(all, all, attenuation_of({}));
  const View view = View::whole_detector(small_camera());
  std::int64_t outside = 0;
  render_image(renderer, pose_partly_outside(), view, &outside);
  EXPECT_GT(outside, 0);
  EXPECT_EQ(outside, renderer.rays_outside(pose_partly_outside(), view));
  EXPECT_EQ(outside, all->rays_outside(pose_partly_outside(), view));
}

}  // namespace
}  // namespace af
