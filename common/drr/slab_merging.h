// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "drr/field_level.h"

namespace af {

/// Weights of consecutive nodes of one axis of a slab's image.
struct MergingTaps {
  static constexpr int kCount = 7;
  int first = 0;  ///< node of the first weight; may lie outside the stored range
  float weights[kCount] = {};
};

/// Neighbouring slabs of a level seen as one slab of the level above.
///
/// Slabs keep parallax small: what lies `d` in front of its (s,t) plane moves by a share of d
/// against the plane from one viewpoint to the next. Nodes twice as far apart bear twice the
/// parallax, so each level needs half the slabs of the one below. The merged plane lies at the
/// slabs' centroid of attenuation (FieldLevelSlab::weight).
/// From one viewpoint, its nodes are scaled and shifted against those of each slab, along s and t
/// separately. A merged sample is the sum over the slabs of what halving takes there: (1 3 3 1)/8
/// along each axis. Between nodes, Lagrange's cubic through four nodes interpolates, which to
/// second order adds no blur of its own. Where planes coincide the result is exactly the sum of the
/// halved slabs. \test SlabMerging.OfSlabsInOnePlaneIsTheSumOfTheHalves
class SlabMerging {
 public:
  /// `slabs`: neighbours in depth, of the same level. They must outlive this.
  SlabMerging(const LightSlab& field_geometry, std::span<const FieldLevelSlab> slabs);

  [[nodiscard]] const SlabGeometry& geometry() const { return merged_; }
  /// The merged slab's samples of viewpoint (u, v), [t][s].
  void merge(int u, int v, std::span<std::uint16_t> samples) const;

 private:
  /// What merging needs of one slab: [viewpoint][merged stored node].
  struct Source {
    const FieldLevelSlab* slab;
    std::vector<std::vector<MergingTaps>> s;  ///< per viewpoint along u
    std::vector<std::vector<MergingTaps>> t;  ///< per viewpoint along v
  };

  SlabGeometry merged_;
  std::vector<Source> sources_;
};

}  // namespace af
