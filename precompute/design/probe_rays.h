// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "precompute/design/probe_scene.h"

namespace af {

/// Rays of a small square of the detector at one pose, on a regular lattice, in the field's frame.
struct RayPatch {
  static constexpr int kSide = 8;
  static constexpr int kRays = kSide * kSide;

  std::size_t pose = 0;
  double weight = 0.0;  ///< of its squared errors in the sum over the detector
  Eigen::Vector3d source_point = Eigen::Vector3d::Zero();
  std::array<Eigen::Vector3d, kRays> directions;
  std::array<float, kRays> reference{};  ///< ray cast; 0: background

  [[nodiscard]] int foreground() const;
};

/// One of the poses at which DRRs are judged.
struct ProbePose {
  double maximum = 0.0;     ///< of its DRR
  double foreground = 0.0;  ///< sum of the weights of its patches' rays that are foreground
};

/// How many rays are drawn.
struct ProbeRayCount {
  int poses = 32;
  int patches_per_pose = 6;
};

/// Rays over which DRRs are judged, with what ray casting gives for them. Poses are uniform in the
/// motion box, as af-evaluate image-quality draws them. At each pose, patches are drawn with a
/// probability that grows with the roughness of the DRR, and are weighted by its inverse, because
/// errors are large where a DRR has edges. A rank makes only those of poses `rank`, rank + ranks,
/// ... The values depend on the seed alone.
struct ProbeRays {
  std::vector<RayPatch> patches;   ///< this rank's, poses in order
  std::size_t poses = 0;           ///< over all ranks
  std::vector<ProbePose> of_pose;  ///< over all ranks; only this rank's are set
};

/// Which share of independent tasks a rank does.
struct ProbeShare {
  std::size_t rank = 0;
  std::size_t ranks = 1;

  [[nodiscard]] bool has(std::size_t task) const { return task % ranks == rank; }
};

ProbeRays draw_probe_rays(const ProbeScene& scene,
                          const ProbeRayCount& count,
                          std::uint64_t seed,
                          const ProbeShare& share);

}  // namespace af
