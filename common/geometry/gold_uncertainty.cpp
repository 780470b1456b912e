// SPDX-License-Identifier: Apache-2.0
#include "geometry/gold_uncertainty.h"

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/sample_summary.h"
#include "geometry/point_projector.h"
#include "geometry/tre.h"

namespace af {
namespace {

using Eigen::Vector3d;

constexpr std::uint64_t kGoldStream = 0x676F6C64;  // "gold"
constexpr std::size_t kPoseParameters = 6;

/// The fiducials as the gold pose itself projects them. Hidden stay those that a view hides, and
/// those that only one view shows.
std::vector<FiducialView> projected_views(const FiducialGold& gold,
                                          std::span<const FiducialView> views,
                                          std::span<const Vector3d> fiducials_ct_mm) {
  std::vector<FiducialView> projected(views.begin(), views.end());
  for (FiducialView& view : projected) {
    const PointProjector projector(view.camera);
    std::vector<Eigen::Vector2d> shown(fiducials_ct_mm.size(), hidden_fiducial_px());
    for (const std::size_t i : gold.used)
      if (is_seen(view.fiducials_px[i]))
        shown[i] = projector.project(gold.room_from_ct * fiducials_ct_mm[i]);
    view.fiducials_px = std::move(shown);
  }
  return projected;
}

/// Distances between the detections and the projections.
struct PixelResiduals {
  double squares_px2 = 0.0;
  std::size_t detections = 0;
};

PixelResiduals pixel_residuals(std::span<const FiducialView> seen,
                               std::span<const FiducialView> projected) {
  PixelResiduals residuals;
  for (std::size_t view = 0; view < seen.size(); ++view)
    for (std::size_t i = 0; i < seen[view].fiducials_px.size(); ++i) {
      if (!is_seen(projected[view].fiducials_px[i])) continue;
      residuals.squares_px2 +=
          (seen[view].fiducials_px[i] - projected[view].fiducials_px[i]).squaredNorm();
      ++residuals.detections;
    }
  return residuals;
}

/// TRE between the gold pose and the pose from one set of noisy detections.
double replicate_tre_mm(const FiducialGold& gold,
                        std::vector<FiducialView> views,
                        std::span<const Vector3d> fiducials_ct_mm,
                        std::span<const Vector3d> target_points_ct_mm,
                        double sigma_px,
                        HashRandom random) {
  for (FiducialView& view : views)
    for (Eigen::Vector2d& detection : view.fiducials_px) {
      detection.x() += sigma_px * random.normal();
      detection.y() += sigma_px * random.normal();
    }
  try {
    return mean_tre_mm(gold_from_fiducials(views, fiducials_ct_mm).room_from_ct,
                       gold.room_from_ct,
                       target_points_ct_mm);
  } catch (const InputError&) {
    // This noise leaves no pose at all.
    return std::numeric_limits<double>::infinity();
  }
}

}  // namespace

GoldUncertainty gold_uncertainty(const FiducialGold& gold,
                                 std::span<const FiducialView> views,
                                 std::span<const Vector3d> fiducials_ct_mm,
                                 std::span<const Vector3d> target_points_ct_mm,
                                 std::uint64_t seed,
                                 std::size_t replicates) {
  check(replicates > 0, "a Monte Carlo estimate has replicates");
  if (target_points_ct_mm.empty()) throw InputError("target points: there must be at least one");
  const std::vector<FiducialView> projected = projected_views(gold, views, fiducials_ct_mm);
  GoldUncertainty result;
  const PixelResiduals residuals = pixel_residuals(views, projected);
  // Three fiducials in two views each, the fewest that give a pose, leave six.
  result.degrees_of_freedom = 2 * residuals.detections - kPoseParameters;
  result.detection_sigma_px =
      std::sqrt(residuals.squares_px2 / static_cast<double>(result.degrees_of_freedom));
  result.replicates = replicates;
  std::vector<double> tre_mm(replicates);
  double squares = 0.0;
  for (std::size_t i = 0; i < replicates; ++i) {
    tre_mm[i] = replicate_tre_mm(gold,
                                 projected,
                                 fiducials_ct_mm,
                                 target_points_ct_mm,
                                 result.detection_sigma_px,
                                 HashRandom(seed, kGoldStream, i));
    squares += tre_mm[i] * tre_mm[i];
  }
  const SampleSummary summary = summarize(tre_mm);
  result.mean_tre_mm = summary.mean;
  result.rms_tre_mm = std::sqrt(squares / static_cast<double>(replicates));
  result.p95_tre_mm = summary.percentile_95;
  return result;
}

}  // namespace af
