// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/shared_array.h"
#include "ct/ct_identity.h"
#include "field/attenuation_quantizer.h"
#include "field/codebook.h"
#include "geometry/light_slab.h"
#include "geometry/motion_range.h"

namespace af {

/// Which part of a CT's attenuation a field holds: all of it, or that of bone alone (TissueModel).
/// A bone field accompanies a field of all attenuation, for DRRs of polychromatic X-rays.
enum class FieldMaterial { All, Bone };

/// What a field was made from and for. It travels with the field.
struct FieldIdentity {
  CameraGeometry camera;  ///< the camera it was sized for
  PoseFrame frame;        ///< (R0, c, r)
  MotionRange range;
  CtIdentity ct;
  double mu_water_per_mm = 0.0200;
  int air_below_hu = -900;
  FieldMaterial material = FieldMaterial::All;
};

/// Codeword indices (and means, in levels) of one slab, stored as Codebook says, t fastest. Tile
/// (a, b, c, d) holds nodes 2a.., 2b.., 2c.., 2d.. of the stored nodes along each axis. Edge
/// replication pads odd ends.
struct CompressedSlab {
  SharedArray<std::uint16_t> indices;
};

/// A lattice node; s and t count over the uncropped lattice.
struct NodeIndex {
  int u = 0;
  int v = 0;
  int s = 0;
  int t = 0;
};

/// A vector-quantised attenuation field: sum over slabs of decoded tiles times the quantiser step.
struct CompressedAttenuationField {
  FieldIdentity identity;
  LightSlab light_slab;         ///< for code that asks where nodes lie; other code uses lattice()
  float quantizer_step = 0.0f;  ///< one for all slabs
  Codebook codebook;
  std::vector<CompressedSlab> slabs;  ///< in the order of light_slab.slabs

  [[nodiscard]] SlabLattice lattice(std::size_t slab) const { return light_slab.lattice(slab); }
  [[nodiscard]] FieldLattice lattice() const { return light_slab.lattice(); }
  /// Decoded total attenuation at a lattice node of one slab; 0 outside the stored range.
  [[nodiscard]] float node_value(std::size_t slab, const NodeIndex& node) const;
};

/// Why rows of indices cannot belong to a field with this codebook; empty when they can. Where the
/// codebook has means, a row of them follows each row. `row`: tiles per row.
std::vector<std::string> index_problems(std::span<const std::uint16_t> values,
                                        std::size_t row,
                                        const Codebook& codebook,
                                        const std::string& name);

/// Every inconsistency between geometry, codebook and index arrays (sizes, indices out of range);
/// empty when sound.
std::vector<std::string> problems(const CompressedAttenuationField& field);

}  // namespace af
