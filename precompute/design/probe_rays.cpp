// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/probe_rays.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/hash_random.h"
#include "ct/ray_caster.h"
#include "geometry/motion_range.h"

namespace af {

namespace {

constexpr std::uint64_t kPoseStream = 0x70726F6265;  // "probe"
constexpr int kMostDraws = 1000;
/// Poses with less foreground say nothing about a field.
constexpr double kLeastForeground = 0.01;
/// Width of a patch at the CT: about ten (s,t) nodes.
constexpr double kPatchMm = 12.0;
/// Share of the patches drawn evenly over the foreground, independent of the roughness.
constexpr double kEvenShare = 0.3;

/// The detector cut into squares, each a possible patch.
struct PatchGrid {
  int step_px = 1;  ///< from ray to ray
  int columns = 0;
  int rows = 0;

  PatchGrid(const CameraGeometry& camera, const PoseFrame& frame) {
    const double pixel_mm = camera.pixel_spacing_mm.minCoeff() *
                            camera.depth_mm(frame.center_room_mm) /
                            camera.source_detector_distance_mm();
    const int most = camera.size_px.minCoeff() / (RayPatch::kSide * 2);
    step_px = std::clamp(static_cast<int>(std::lround(kPatchMm / (RayPatch::kSide * pixel_mm))),
                         1,
                         std::max(1, most));
    columns = std::max(1, camera.size_px.x() / side_px());
    rows = std::max(1, camera.size_px.y() / side_px());
  }
  [[nodiscard]] int side_px() const { return RayPatch::kSide * step_px; }
  [[nodiscard]] std::size_t count() const {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  }
};

/// Rays of a lattice of pixels at a pose, cast.
class PixelRays {
 public:
  PixelRays(const ProbeScene& scene, const RigidTransform& room_from_ct)
      : camera_(scene.camera),
        ct_from_room_(room_from_ct.inverse()),
        caster_(scene.volume, RayCasterOptions{}) {}

  [[nodiscard]] std::vector<float> cast(
      double column, double row, double step, int columns, int rows) const {
    const Eigen::Vector3d first = camera_.detector_point(column, row);
    RayFan fan;
    fan.source_point = ct_from_room_ * camera_.source_point;
    fan.first_point = ct_from_room_ * first;
    fan.column_step = ct_from_room_.linear() * (camera_.detector_point(column + step, row) - first);
    fan.row_step = ct_from_room_.linear() * (camera_.detector_point(column, row + step) - first);
    fan.columns = columns;
    fan.rows = rows;
    std::vector<float> values(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    caster_.cast(fan, values);
    return values;
  }

 private:
  const CameraGeometry& camera_;
  RigidTransform ct_from_room_;
  RayCaster caster_;
};

/// Probability of each patch of the grid, from a coarse DRR with one ray, or four, per patch.
std::vector<double> patch_probabilities(const std::vector<float>& coarse, int columns, int rows) {
  const auto at = [&](int column, int row) {
    const auto y = static_cast<std::size_t>(std::clamp(row, 0, rows - 1));
    const auto x = static_cast<std::size_t>(std::clamp(column, 0, columns - 1));
    return static_cast<double>(coarse[y * static_cast<std::size_t>(columns) + x]);
  };
  std::vector<double> rough;
  std::vector<double> even;
  for (int row = 0; row < rows; row += 2)
    for (int column = 0; column < columns; column += 2) {
      double sum = 0.0;
      double largest = 0.0;
      for (int r = row; r < row + 2; ++r)
        for (int c = column; c < column + 2; ++c) {
          const double across = at(c - 1, r) - 2.0 * at(c, r) + at(c + 1, r);
          const double along = at(c, r - 1) - 2.0 * at(c, r) + at(c, r + 1);
          sum += std::abs(across) + std::abs(along);
          for (const double near :
               {at(c - 1, r), at(c, r), at(c + 1, r), at(c, r - 1), at(c, r + 1)})
            largest = std::max(largest, near);
        }
      rough.push_back(sum);
      even.push_back(largest > 0.0 ? 1.0 : 0.0);
    }
  const double all_rough = std::accumulate(rough.begin(), rough.end(), 0.0);
  const double all_even = std::accumulate(even.begin(), even.end(), 0.0);
  for (std::size_t i = 0; i < rough.size(); ++i)
    rough[i] = all_rough > 0.0
                   ? kEvenShare * even[i] / all_even + (1.0 - kEvenShare) * rough[i] / all_rough
                   : even[i] / std::max(1.0, all_even);
  return rough;
}

class PoseSampler {
 public:
  PoseSampler(const ProbeScene& scene, const ProbeRayCount& count)
      : scene_(scene),
        count_(count),
        grid_(scene.camera, scene.frame),
        slab_from_ct_(slab_from_ct_at_nominal(scene.camera, scene.frame)) {}

  void sample(std::size_t pose, std::uint64_t seed, ProbeRays& rays) const {
    HashRandom random(seed, kPoseStream, pose);
    for (int draw = 0; draw < kMostDraws; ++draw) {
      const RigidTransform room_from_ct =
          pose_from_parameters(scene_.frame, random_pose(scene_.range, random));
      const PixelRays pixels(scene_, room_from_ct);
      const double quarter = 0.25 * grid_.side_px();
      const std::vector<float> coarse =
          pixels.cast(quarter, quarter, 2.0 * quarter, 2 * grid_.columns, 2 * grid_.rows);
      const auto foreground = std::ranges::count_if(coarse, [](float value) { return value > 0; });
      if (static_cast<double>(foreground) < kLeastForeground * static_cast<double>(coarse.size()))
        continue;
      rays.of_pose[pose].maximum = static_cast<double>(*std::ranges::max_element(coarse));
      draw_patches(pose, room_from_ct, pixels, coarse, random, rays);
      return;
    }
    throw InputError("camera",
                     scene_.camera.name,
                     "its detector misses the CT at almost every pose of the range");
  }

 private:
  void draw_patches(std::size_t pose,
                    const RigidTransform& room_from_ct,
                    const PixelRays& pixels,
                    const std::vector<float>& coarse,
                    HashRandom& random,
                    ProbeRays& rays) const {
    const std::vector<double> probability =
        patch_probabilities(coarse, 2 * grid_.columns, 2 * grid_.rows);
    // Systematic sampling puts evenly spaced marks on the line of summed probabilities.
    const double first_mark = random.uniform();
    double sum = 0.0;
    int next = 0;
    double foreground = 0.0;
    for (std::size_t i = 0; i < grid_.count(); ++i) {
      sum += probability[i] * count_.patches_per_pose;
      while (next < count_.patches_per_pose && first_mark + next < sum) {
        RayPatch patch = patch_at(static_cast<int>(i) % grid_.columns,
                                  static_cast<int>(i) / grid_.columns,
                                  room_from_ct,
                                  pixels);
        patch.pose = pose;
        patch.weight = 1.0 / probability[i];
        foreground += patch.weight * patch.foreground();
        rays.patches.push_back(patch);
        ++next;
      }
    }
    rays.of_pose[pose].foreground = foreground;
  }

  [[nodiscard]] RayPatch patch_at(int column,
                                  int row,
                                  const RigidTransform& room_from_ct,
                                  const PixelRays& pixels) const {
    RayPatch patch;
    const double first_column = column * grid_.side_px();
    const double first_row = row * grid_.side_px();
    const std::vector<float> values =
        pixels.cast(first_column, first_row, grid_.step_px, RayPatch::kSide, RayPatch::kSide);
    std::ranges::copy(values, patch.reference.begin());
    const RigidTransform slab_from_room = slab_from_ct_ * room_from_ct.inverse();
    patch.source_point = slab_from_room * scene_.camera.source_point;
    auto direction = patch.directions.begin();
    for (int r = 0; r < RayPatch::kSide; ++r)
      for (int c = 0; c < RayPatch::kSide; ++c)
        *direction++ = slab_from_room.linear() *
                       (scene_.camera.detector_point(first_column + c * grid_.step_px,
                                                     first_row + r * grid_.step_px) -
                        scene_.camera.source_point);
    return patch;
  }

  const ProbeScene& scene_;
  ProbeRayCount count_;
  PatchGrid grid_;
  RigidTransform slab_from_ct_;
};

}  // namespace

int RayPatch::foreground() const {
  return static_cast<int>(std::ranges::count_if(reference, [](float value) { return value > 0; }));
}

ProbeRays draw_probe_rays(const ProbeScene& scene,
                          const ProbeRayCount& count,
                          std::uint64_t seed,
                          const ProbeShare& share) {
  ProbeRays rays;
  rays.poses = static_cast<std::size_t>(count.poses);
  rays.of_pose.resize(rays.poses);
  const PoseSampler sampler(scene, count);
  for (std::size_t pose = 0; pose < rays.poses; ++pose)
    if (share.has(pose)) sampler.sample(pose, seed, rays);
  return rays;
}

}  // namespace af
