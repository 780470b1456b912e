// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/design_probe.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "drr/ray_cast_drr.h"
#include "drr/two_pass_af_drr.h"
#include "precompute/casting/unit_planner.h"
#include "precompute/codebook/codebook_training.h"
#include "precompute/codebook/unit_encoding.h"
#include "precompute/design/patch_nodes.h"
#include "support/c_arm_camera.h"
#include "support/ct_phantoms.h"
#include "support/cube_grid.h"
#include "unit/precompute/codebook/selected_tiles.h"
#include "xray/psnr.h"

namespace af {
namespace {

using Eigen::Vector3d;

/// 64 x 64 pixels of 3 mm on a C-arm, beam along +y.
CameraGeometry c_arm() {
  return test::c_arm_camera(64, 64, 3.0);
}

CtVolume bones() {
  return ellipsoid_phantom(test::cube_grid(48, 2.0),
                           {{{0, 0, 0}, {38, 30, 34}, Eigen::Matrix3d::Identity(), 0},
                            {{12, -8, 10}, {9, 6, 14}, Eigen::Matrix3d::Identity(), 900},
                            {{-14, 9, -6}, {7, 12, 8}, Eigen::Matrix3d::Identity(), 700}},
                           2);
}

class DesignProbeTest : public testing::Test {
 protected:
  /// A field of the design with so many codewords. With 0, every tile that occurs is a codeword.
  std::shared_ptr<const CompressedAttenuationField> field_of(const FieldDesign& design,
                                                             int codewords) const {
    auto field = std::make_shared<CompressedAttenuationField>();
    field->light_slab = scene_.planes(design);
    field->quantizer_step = scene_.quantizer.step();
    const FieldLattice lattice = field->light_slab.lattice();
    const auto caster = scene_.make_caster(field->light_slab);
    // One unit per slab.
    std::vector<WorkUnit> units;
    std::vector<UnitTiles> tiles;
    for (std::size_t k = 0; k < lattice.slabs.size(); ++k) {
      const SlabLattice& slab = lattice.slabs[k];
      const WorkUnit unit{static_cast<std::uint32_t>(k),
                          k,
                          slab.u.stored,
                          slab.v.stored,
                          slab.s.stored,
                          slab.t.stored};
      std::vector<std::uint16_t> samples(unit.sample_count());
      caster->cast(unit, samples);
      units.push_back(unit);
      tiles.push_back(make_unit_tiles(unit, samples));
    }
    if (codewords == 0) {
      std::vector<Tile>& all = field->codebook.codewords;
      all.push_back(Tile{});
      for (const UnitTiles& of_unit : tiles)
        all.insert(all.end(), of_unit.tiles.begin(), of_unit.tiles.end());
      std::sort(all.begin(), all.end(), codeword_less);
      all.erase(std::unique(all.begin(), all.end()), all.end());
    } else {
      CodebookOptions options;
      options.codewords = codewords;
      field->codebook =
          train_codebook(
              test::select_training_tiles(tiles, units, lattice, {}), options, serial_reduction())
              .codebook;
    }
    const NearestCodeword search(field->codebook);
    for (std::size_t k = 0; k < units.size(); ++k)
      field->slabs.push_back(
          {SharedArray<std::uint16_t>(encode_unit(search, units[k], tiles[k]).indices)});
    return field;
  }

  /// The median PSNR over random poses of the range.
  [[nodiscard]] double measured_db(const std::shared_ptr<const CompressedAttenuationField>& field,
                                   const TwoPassOptions& look_up) const {
    const TwoPassAfDrr tested(field, look_up);
    const RayCastDrr reference(volume_, RayCasterOptions{});
    const View view = View::whole_detector(scene_.camera);
    HashRandom random(77);
    std::vector<double> decibels;
    constexpr int kPoses = 41;
    for (int i = 0; i < kPoses; ++i) {
      PoseParameters parameters;
      for (double& angle : parameters.rotation_rad)
        angle = random.uniform(-scene_.range.max_rotation_rad(), scene_.range.max_rotation_rad());
      for (double& shift : parameters.translation_mm)
        shift =
            random.uniform(-scene_.range.max_translation_mm(), scene_.range.max_translation_mm());
      const RigidTransform pose = pose_from_parameters(scene_.frame, parameters);
      decibels.push_back(
          psnr(render_image(tested, pose, view).pixels, render_image(reference, pose, view).pixels)
              .value()
              .psnr_db);
    }
    std::nth_element(decibels.begin(), decibels.begin() + kPoses / 2, decibels.end());
    return decibels[kPoses / 2];
  }

  [[nodiscard]] DesignMeasurement measured(const FieldDesign& design) const {
    const std::array<int, 1> codewords = {design.codewords};
    ProbeRays rays = draw_probe_rays(scene_, {48, 6}, 1, {});
    return DesignProbe(scene_, {}, std::move(rays), reduction_, 1).measure(design, codewords);
  }

  std::shared_ptr<const AttenuationVolume> volume_ =
      std::make_shared<const AttenuationVolume>(bones(), AttenuationModel{});
  PoseFrame frame_{};
  SlabAlignedVolume resampled_{*volume_, slab_from_ct_at_nominal(c_arm(), frame_)};
  ProbeScene scene_{*volume_,
                    resampled_,
                    resampled_.slice_sums(),
                    c_arm(),
                    frame_,
                    {0.1, 10.0},
                    AttenuationQuantizer::for_maximum(volume_->max_total_attenuation()),
                    std::nullopt,
                    "shear-warp",
                    {},
                    {}};
  CodebookReduction reduction_ = serial_reduction();
};

/// Medians of 41 and of 48 poses of about 1.5 dB of spread each err by 1.25 * 1.5 / sqrt(40) = 0.3
/// dB; the six patches of a pose add as much.
constexpr double kSamplingDb = 1.0;

TEST_F(DesignProbeTest, LooksPatchesOfOneSlabUpAsTwoPassAfDrrDoes) {
  const FieldDesign design{1, 6, 40, 512, "cubic"};
  const auto field = field_of(design, 0);
  ASSERT_LE(field->codebook.size(), kMaxCodewords);
  const auto caster = scene_.make_caster(field->light_slab);
  const NearestCodeword search(field->codebook);
  const PoseParameters parameters =
      PoseParameters::from_deg_and_mm({3.0, -4.0, 2.0, 7.0, -9.0, 4.0});
  const RigidTransform room_from_ct = pose_from_parameters(scene_.frame, parameters);
  const RigidTransform slab_from_room = field->light_slab.slab_from_ct * room_from_ct.inverse();
  RayPatch patch;
  patch.source_point = slab_from_room * scene_.camera.source_point;
  constexpr int kFirst = 24;
  for (int r = 0; r < RayPatch::kSide; ++r)
    for (int c = 0; c < RayPatch::kSide; ++c)
      patch.directions[static_cast<std::size_t>(r * RayPatch::kSide + c)] =
          slab_from_room.linear() *
          (scene_.camera.detector_point(kFirst + c, kFirst + r) - scene_.camera.source_point);
  const PatchNodes nodes(*caster, field->light_slab, field->quantizer_step, patch);
  const View view{scene_.camera, {kFirst, kFirst, RayPatch::kSide, RayPatch::kSide}};
  const Image2d linear = render_image(TwoPassAfDrr(field), room_from_ct, view);
  const Image2d cubic =
      render_image(TwoPassAfDrr(field, {AxisInterpolation::Cubic}), room_from_ct, view);
  const PatchValues cast = nodes.values();
  const PatchValues coded = nodes.values(search, field->codebook);
  // TwoPassAfDrr blends and warps in single precision, with values up to some 5.
  constexpr double kSinglePrecision = 2e-4;
  for (std::size_t i = 0; i < linear.pixels.size(); ++i) {
    EXPECT_NEAR(cast.linear[i], static_cast<double>(linear.pixels[i]), kSinglePrecision) << i;
    EXPECT_NEAR(cast.cubic[i], static_cast<double>(cubic.pixels[i]), kSinglePrecision) << i;
    EXPECT_DOUBLE_EQ(coded.linear[i], cast.linear[i]) << i;
  }
}

TEST_F(DesignProbeTest, TellsTheLossByInterpolation) {
  for (const FieldDesign& design :
       {FieldDesign{1, 12, 32, 512, "linear"}, FieldDesign{3, 6, 40, 512, "linear"}}) {
    const auto field = field_of(design, 0);
    const DesignMeasurement probe = measured(design);
    EXPECT_NEAR(probe.forecast(512, "linear").interpolation_db, measured_db(field, {}), kSamplingDb)
        << to_text(design);
    EXPECT_NEAR(probe.forecast(512, "cubic").interpolation_db,
                measured_db(field, {AxisInterpolation::Cubic}),
                kSamplingDb)
        << to_text(design);
  }
}

TEST_F(DesignProbeTest, TellsTheLossOfACompressedField) {
  for (const FieldDesign& design :
       {FieldDesign{2, 16, 64, 4096, "cubic"}, FieldDesign{3, 12, 80, 4096, "cubic"}}) {
    const auto field = field_of(design, design.codewords);
    const DesignMeasurement probe = measured(design);
    EXPECT_NEAR(probe.forecast(design.codewords, "cubic").psnr_db,
                measured_db(field, {AxisInterpolation::Cubic}),
                kSamplingDb)
        << to_text(design);
  }
}

TEST_F(DesignProbeTest, CountsTheTilesOfTheField) {
  const FieldDesign design{2, 16, 64, 1024, "cubic"};
  const auto field = field_of(design, design.codewords);
  double occupied = 0.0;
  for (const CompressedSlab& slab : field->slabs)
    for (const std::uint16_t index : slab.indices.view()) occupied += index != 0 ? 1.0 : 0.0;
  // Few tiles are coded by the zero codeword, so three views know the mean over all to some
  // percent.
  constexpr double kShare = 0.06;
  EXPECT_NEAR(measured(design).occupied_tiles, occupied, kShare * occupied);
}

TEST_F(DesignProbeTest, DrawsTheSameRaysOnAnyNumberOfRanks) {
  const ProbeRays alone = draw_probe_rays(scene_, {7, 3}, 5, {});
  std::size_t found = 0;
  for (std::size_t rank = 0; rank < 3; ++rank)
    for (const RayPatch& patch : draw_probe_rays(scene_, {7, 3}, 5, {rank, 3}).patches) {
      EXPECT_EQ(patch.pose % 3, rank);
      found +=
          static_cast<std::size_t>(std::ranges::count_if(alone.patches, [&](const RayPatch& other) {
            return other.pose == patch.pose && other.weight == patch.weight &&
                   other.reference == patch.reference && other.directions == patch.directions;
          }));
    }
  EXPECT_EQ(found, alone.patches.size());
}

}  // namespace
}  // namespace af
