// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "field/compressed_attenuation_field.h"

namespace af {

using FieldFunction = std::function<double(const RayNodes&)>;

/// 31 x 24 pixels of 6 mm on a C-arm.
CameraGeometry small_camera();

/// Smooth on the scale of the nodes, so that interpolations differ little from it; scaled up, since
/// small fields hold integers.
double waves(const RayNodes& n);

/// An uncompressed field in compressed form: one codeword per tile of a function of (u, v, s, t) in
/// node units, times a quantiser step of 0.25. The function must be integer at the nodes, so that
/// nothing is lost.
std::shared_ptr<CompressedAttenuationField> small_field(const FieldFunction& function,
                                                        int slab_count,
                                                        int uv_nodes = 5,
                                                        int st_nodes = 9);

/// The same field with mean-removed tiles. Nothing is lost where no level differs from its tile's
/// mean by 32767 or more.
std::shared_ptr<CompressedAttenuationField> mean_removed(const CompressedAttenuationField& field,
                                                         int mean_step);

/// Crops a one-slab field, which stores its whole lattice, to the even-aligned nodes s x t.
void crop_stored(CompressedAttenuationField& field, const NodeRange& s, const NodeRange& t);

/// Crops a one-slab field of plain tiles to its first viewpoints along u and v. Each number is
/// even, or all there are.
void crop_viewpoints(CompressedAttenuationField& field, int u_nodes, int v_nodes);

/// Pose `index` of a fixed random series within the small fields' range.
PoseParameters small_pose(std::uint64_t index);

/// A pose at which some, but not all, of small_camera()'s rays miss the small fields.
RigidTransform pose_partly_outside();

}  // namespace af
