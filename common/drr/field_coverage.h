// SPDX-License-Identifier: Apache-2.0
// Which rays a file's fields hold: one field, or the members of an atlas together.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "drr/drr_renderer.h"
#include "field/attenuation_atlas.h"

namespace af {

/// How many of a view's rays the fields hold.
struct ViewReach {
  std::string distance;   ///< FieldCoverage::distance_text()
  std::int64_t rays = 0;  ///< of the view
  std::int64_t held = 0;  ///< at the nominal pose
  MotionRange box;        ///< FieldCoverage::box()
  /// "field covers 100 % of camera A's rays within 6.2 deg / 18 mm of nominal".
  [[nodiscard]] std::string text(const std::string& camera) const;
};

/// The cameras and planes of a file's fields, without samples.
struct FieldCoverage {
  std::vector<CameraGeometry> cameras;  ///< that each was made for
  std::vector<std::shared_ptr<const LightSlab>> planes;

  FieldCoverage() = default;
  explicit FieldCoverage(const std::shared_ptr<const CompressedAttenuationField>& field);
  explicit FieldCoverage(const std::shared_ptr<const AttenuationAtlas>& atlas);

  /// Rays of a view that the best field misses, which is the field that misses fewest.
  [[nodiscard]] std::int64_t rays_outside(const RigidTransform& room_from_ct,
                                          const View& view) const;
  /// 1 for each ray of a view that the best field holds, and 0 for the others.
  [[nodiscard]] std::vector<float> held_rays(const RigidTransform& room_from_ct,
                                             const View& view) const;
  [[nodiscard]] ViewReach reach(const View& view,
                                const PoseFrame& nominal,
                                const MotionRange& proportion) const;
  /// The largest box about the nominal pose of `frame`, in the proportion of `proportion`, in which
  /// every pose is held by one field or another. For one field it is covered_box(). For several,
  /// kBoxPoses poses are tested, the box's corners first, so a missed ray between them may go
  /// unnoticed.
  [[nodiscard]] MotionRange box(const View& view,
                                const PoseFrame& frame,
                                const MotionRange& proportion) const;
  static constexpr int kBoxPoses = 512;
  /// How far a camera is from the field's camera, or from that of the nearest member, which is
  /// named.
  [[nodiscard]] std::string distance_text(const CameraGeometry& camera) const;
};

/// What a file's field or atlas was made from, and which rays it holds. For one rank alone, and
/// quick to read. Throws FileError.
struct HeldRays {
  FieldIdentity identity;
  FieldCoverage coverage;
};
HeldRays read_held_rays(const std::filesystem::path& path);

}  // namespace af
