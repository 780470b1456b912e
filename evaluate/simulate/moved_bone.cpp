// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/moved_bone.h"

#include <algorithm>
#include <limits>
#include <ranges>

#include "base/hash_random.h"

namespace af {

namespace {

using Eigen::Vector3d;

Vector3d drawn_direction(HashRandom& random) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return Vector3d(x, y, z).normalized();
}

/// Points within the bodies of a bone.
std::vector<Vector3d> points_of(const Phantom& phantom, std::string_view bone, HashRandom& random) {
  constexpr int kDrawsPerBody = 8;
  std::vector<Vector3d> points;
  for (const Solid& solid : phantom.solids) {
    if (solid.bone != bone) continue;
    for (int i = 0; i < kDrawsPerBody; ++i) {
      const double x = random.uniform(-1.0, 1.0);
      const double y = random.uniform(-1.0, 1.0);
      const double z = random.uniform(-1.0, 1.0);
      const Vector3d local = solid.reach_mm().cwiseProduct(Vector3d(x, y, z));
      const Vector3d point = solid.center_mm + solid.rotation * local;
      if (solid.contains(point)) points.push_back(point);
    }
  }
  return points;
}

/// Whether everything but the bone has soft tissue at a point.
bool has_room(const Phantom& phantom, std::string_view bone, const Vector3d& ct_point_mm) {
  constexpr int kLowestHu = -200;
  constexpr int kHighestHu = 100;  // below thin cancellous bone
  for (const Solid& solid : std::views::reverse(phantom.solids))
    if (solid.bone != bone && solid.contains(ct_point_mm))
      return solid.hu > kLowestHu && solid.hu < kHighestHu;
  return false;
}

}  // namespace

RigidTransform drawn_rest_from_bone(const Phantom& phantom,
                                    std::string_view bone,
                                    const Vector3d& center_ct_mm,
                                    std::uint64_t seed,
                                    std::uint64_t key) {
  constexpr int kDraws = 64;
  HashRandom random(seed, key);
  const double angle_rad = random.uniform(2.0, 5.0) * kRadPerDeg;
  const double shift_mm = random.uniform(2.0, 6.0);
  const std::vector<Vector3d> points = points_of(phantom, bone, random);
  RigidTransform best = RigidTransform::Identity();
  auto fewest = std::numeric_limits<std::ptrdiff_t>::max();
  for (int i = 0; i < kDraws; ++i) {
    const Vector3d axis = drawn_direction(random);
    const Vector3d shift = shift_mm * drawn_direction(random);
    RigidTransform rest_from_bone = RigidTransform::Identity();
    rest_from_bone.linear() = Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix();
    rest_from_bone.translation() = center_ct_mm + shift - rest_from_bone.linear() * center_ct_mm;
    const std::ptrdiff_t blocked = std::ranges::count_if(points, [&](const Vector3d& point) {
      return !has_room(phantom, bone, rest_from_bone * point);
    });
    if (blocked >= fewest) continue;
    fewest = blocked;
    best = rest_from_bone;
  }
  return best;
}

Phantom with_moved_bone(Phantom phantom,
                        std::string_view bone,
                        const RigidTransform& rest_from_bone) {
  // The body painted last is what is there: nothing is added or removed. Where a moved body was,
  // the bodies painted before it therefore show, and those of other bones, discs and sockets are
  // whole. But soft tissue may be missing below: a jaw reaches out of the face, a lung into a
  // vertebra. Soft tissue is painted before all bone. Between the two, the bone leaves its shape in
  // muscle, which takes nothing from other bones.
  std::vector<Solid> left_behind;
  for (Solid& solid : phantom.solids) {
    if (solid.bone != bone) continue;
    left_behind.push_back(solid);
    left_behind.back().hu = kMuscleHu;
    left_behind.back().texture_hu = 0;
    left_behind.back().bone = {};
    solid = moved(solid, rest_from_bone);
  }
  const auto first_bone =
      std::ranges::find_if(phantom.solids, [](const Solid& solid) { return solid.hu >= kBoneHu; });
  phantom.solids.insert(first_bone, left_behind.begin(), left_behind.end());
  return phantom;
}

}  // namespace af
