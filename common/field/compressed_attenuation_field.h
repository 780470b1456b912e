// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/shared_array.h"
#include "field/attenuation_quantizer.h"
#include "field/codebook.h"
#include "geometry/light_slab.h"
#include "geometry/slab_sizing.h"

namespace af {

/// What a field was made from and for; travels with it.
struct FieldIdentity {
  CameraGeometry camera;  ///< the camera it was sized for
  PoseFrame frame;        ///< (R0, c, r)
  MotionRange range;
  std::string ct_content_sha256;  ///< over size and int16 HU voxels
  double mu_water_per_mm = 0.0200;
  int air_below_hu = -900;
};

/// Codeword indices of one slab, [Tu][Tv][Ts][Tt] with Tt fastest; tile (a, b, c, d) holds nodes
/// (2a.., 2b.., stored_s.begin + 2c.., stored_t.begin + 2d..). Odd ends are padded by edge
/// replication.
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
  LightSlab light_slab;
  float quantizer_step = 0.0f;  ///< one for all slabs
  Codebook codebook;
  std::vector<CompressedSlab> slabs;  ///< in the order of light_slab.slabs

  [[nodiscard]] int tiles_u() const { return (light_slab.u.nodes + 1) / 2; }
  [[nodiscard]] int tiles_v() const { return (light_slab.v.nodes + 1) / 2; }
  [[nodiscard]] std::size_t tile_count(std::size_t slab) const;
  /// Decoded total attenuation at a stored or unstored lattice node of one slab (0 outside the
  /// stored range).
  [[nodiscard]] float node_value(std::size_t slab, const NodeIndex& node) const;
};

/// Every inconsistency between geometry, codebook and index arrays (sizes, indices out of range);
/// empty when sound.
std::vector<std::string> problems(const CompressedAttenuationField& field);

}  // namespace af
