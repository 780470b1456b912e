// SPDX-License-Identifier: Apache-2.0
#include "drr/field_coverage.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "base/hash_random.h"
#include "drr/slab_rays.h"
#include "field/field_reading.h"
#include "geometry/camera_distance.h"
#include "geometry/motion_range.h"
#include "geometry/ray_coverage.h"

namespace af {

namespace {

/// Pose number `index` of those that test a box: its corners, then points on its faces and inside.
PoseParameters pose_in_box(const MotionRange& box, int index) {
  constexpr int kCorners = 64;
  HashRandom random(29, static_cast<std::uint64_t>(index));
  std::array<double, 6> shares{};
  for (std::size_t p = 0; p < shares.size(); ++p) {
    double& share = shares[p];
    share = (index >> p & 1) != 0 ? 1.0 : 0.0;
    if (index >= kCorners) {
      share = random.uniform();
      if (random.uniform() < 0.5) share = share < 0.5 ? 0.0 : 1.0;
    }
  }
  return pose_at(box, shares);
}

bool holds_box(const FieldCoverage& coverage,
               const View& view,
               const PoseFrame& frame,
               const MotionRange& box) {
  for (int i = 0; i < FieldCoverage::kBoxPoses; ++i) {
    const RigidTransform pose = pose_from_parameters(frame, pose_in_box(box, i));
    if (!std::any_of(coverage.planes.begin(), coverage.planes.end(), [&](const auto& planes) {
          return SlabRays(*planes, pose, view).share_to_edges() >= 0.0;
        }))
      return false;
  }
  return true;
}

}  // namespace

std::string ViewReach::text(const std::string& camera) const {
  return coverage_text(camera, held, rays, box);
}

FieldCoverage::FieldCoverage(const std::shared_ptr<const CompressedAttenuationField>& field)
    : cameras({field->identity.camera}), planes({{field, &field->light_slab}}) {}

FieldCoverage::FieldCoverage(const std::shared_ptr<const AttenuationAtlas>& atlas) {
  for (const AtlasMember& member : atlas->members) {
    cameras.push_back(member.identity.camera);
    planes.emplace_back(atlas, &member.light_slab);
  }
}

std::int64_t FieldCoverage::rays_outside(const RigidTransform& room_from_ct,
                                         const View& view) const {
  std::int64_t fewest = std::numeric_limits<std::int64_t>::max();
  for (const auto& of_field : planes) {
    fewest = std::min(fewest, SlabRays(*of_field, room_from_ct, view).count_outside());
    if (fewest == 0) break;
  }
  return fewest;
}

std::vector<float> FieldCoverage::held_rays(const RigidTransform& room_from_ct,
                                            const View& view) const {
  std::vector<float> best;
  std::int64_t fewest = std::numeric_limits<std::int64_t>::max();
  for (const auto& of_field : planes) {
    std::vector<float> held(view.pixel_count(), 1.0f);
    const std::int64_t outside = SlabRays(*of_field, room_from_ct, view).blank_outside(held);
    if (outside >= fewest) continue;
    fewest = outside;
    best = std::move(held);
  }
  return best;
}

ViewReach FieldCoverage::reach(const View& view,
                               const PoseFrame& nominal,
                               const MotionRange& proportion) const {
  const auto rays = static_cast<std::int64_t>(view.pixel_count());
  return {distance_text(view.camera),
          rays,
          rays - rays_outside(nominal.nominal_room_from_ct(), view),
          box(view, nominal, proportion)};
}

MotionRange FieldCoverage::box(const View& view,
                               const PoseFrame& frame,
                               const MotionRange& proportion) const {
  if (planes.size() == 1)
    return covered_box(*planes.front(), view.coarser(1).camera, frame, proportion);
  constexpr double kMost = 8.0;  // times what it was made for
  constexpr int kHalvings = 10;
  const MotionRange unit(proportion.max_rotation_rad(), proportion.max_translation_mm());
  const auto is_held = [&](double factor) {
    return holds_box(*this, view, frame, unit.scaled(factor));
  };
  const bool is_own_held = is_held(1.0);
  double held = is_own_held ? 1.0 : 0.0;
  double missed = is_own_held ? kMost : 1.0;
  for (int i = 0; i < kHalvings; ++i) {
    const double next = 0.5 * (held + missed);
    (is_held(next) ? held : missed) = next;
  }
  return unit.scaled(held);
}

std::string FieldCoverage::distance_text(const CameraGeometry& camera) const {
  if (cameras.size() == 1) return camera_distance(camera, cameras.front()).text();
  const auto nearest = std::min_element(
      cameras.begin(), cameras.end(), [&](const CameraGeometry& a, const CameraGeometry& b) {
        return (a.source_point - camera.source_point).norm() <
               (b.source_point - camera.source_point).norm();
      });
  return "atlas of " + std::to_string(cameras.size()) + " fields, the nearest of " + nearest->name +
         ": " + camera_distance(camera, *nearest).text();
}

HeldRays read_held_rays(const std::filesystem::path& path) {
  if (is_atlas_file(path)) {
    const auto atlas = std::make_shared<const AttenuationAtlas>(read_atlas_header(path));
    return {atlas->identity, FieldCoverage(atlas)};
  }
  const auto field = std::make_shared<const CompressedAttenuationField>(read_field_header(path));
  return {field->identity, FieldCoverage(field)};
}

}  // namespace af
