// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <tuple>
#include <vector>

#include "base/described_fields.h"
#include "ct/ct_volume.h"
#include "geometry/ct_box.h"

namespace af {

/// HU to linear attenuation: mu = mu_water * max(0, 1 + HU/1000). HU < air_below_hu counts as 0.
struct AttenuationModel {
  double mu_water_per_mm = 0.0200;
  int air_below_hu = -900;

  /// mu in units of mu_water / 1000, an exact integer: 0, or 1000 + air_below_hu to 33767.
  [[nodiscard]] std::uint16_t relative_attenuation(std::int16_t hu) const {
    return hu < air_below_hu || hu < -1000 ? std::uint16_t{0}
                                           : static_cast<std::uint16_t>(1000 + hu);
  }
  [[nodiscard]] double mu_per_mm_per_unit() const { return mu_water_per_mm / 1000.0; }

  void describe(Fields& field);
};

std::vector<std::string> problems(const AttenuationModel& model);

/// Throws InputError when a grid has 2^31 voxels or more, which casters could not address.
void require_castable(const CtGrid& bordered_grid);

/// The attenuating part of a CT, ready for casting. Voxels are integers in units of mu_water/1000,
/// so the HU model is exact. The volume is cropped to the box of voxels that attenuate, and
/// surrounded by a border of one zero voxel. Trilinear interpolation thereby falls to zero over one
/// voxel, and never needs a bounds check. Memory: 2 bytes per voxel. Throws InputError for a volume
/// with no attenuating voxel.
class AttenuationVolume {
 public:
  AttenuationVolume(const CtVolume& ct, const AttenuationModel& model);
  /// Takes voxels that already exist (in memory shared by the ranks of a node), laid out as
  /// voxels() of an equal volume.
  AttenuationVolume(const CtGrid& bordered_grid,
                    const AttenuationModel& model,
                    SharedArray<std::uint16_t> voxels);

  /// Writes the voxels of the volume that is made from a CT, into memory for
  /// bordered_grid.voxel_count() of them.
  static void fill_voxels(const CtVolume& ct,
                          const AttenuationModel& model,
                          const CtGrid& bordered_grid,
                          std::span<std::uint16_t> voxels);

  /// Grid with border: voxel (0, 0, 0) is a border voxel.
  [[nodiscard]] const CtGrid& grid() const { return grid_; }
  [[nodiscard]] CtGrid grid_without_border() const;
  [[nodiscard]] const AttenuationModel& model() const { return model_; }
  [[nodiscard]] std::span<const std::uint16_t> voxels() const { return voxels_.view(); }
  /// Largest mu in the volume, 1/mm.
  [[nodiscard]] double max_mu_per_mm() const { return max_mu_per_mm_; }
  /// Corners (ct frame, mm) outside which interpolated attenuation is exactly 0: the centres of the
  /// border's corner voxels.
  [[nodiscard]] std::array<Eigen::Vector3d, 8> corner_points() const;
  /// An upper bound of any line integral: the largest mu times the diagonal.
  [[nodiscard]] double max_total_attenuation() const;

 private:
  CtGrid grid_;
  AttenuationModel model_;
  SharedArray<std::uint16_t> voxels_;
  double max_mu_per_mm_ = 0.0;
};

/// Some of a volume's voxels, with a border of zeros.
struct VolumePart {
  CtGrid grid;
  std::vector<std::uint16_t> voxels;  ///< none: the part is empty

  auto members() {
    return std::tie(grid.size, grid.origin_mm, grid.spacing_mm, grid.direction, voxels);
  }
};

/// The voxels that a box of the ct frame reaches, between the first and the last index along each
/// axis of the grid. They are the same for a CT and for its attenuation. \test
/// AttenuationVolume.APartHoldsTheVoxelsOfItsBox
VolumePart part_within(const AttenuationVolume& volume, const CtBox& box_ct);
VolumePart part_within(const CtVolume& ct, const AttenuationModel& model, const CtBox& box_ct);

/// The voxels of a CT that attenuate lie within these indices, inclusive.
struct AttenuatingBox {
  std::array<int, 3> low;
  std::array<int, 3> high;
};

/// The smallest such box, found in one pass over the CT. Throws InputError when no voxel
/// attenuates.
AttenuatingBox attenuating_box(const CtVolume& ct, const AttenuationModel& model);

/// The bordered grid of the AttenuationVolume of a CT with that box.
CtGrid bordered_grid(const CtGrid& ct_grid, const AttenuatingBox& box);

}  // namespace af
