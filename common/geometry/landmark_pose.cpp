// SPDX-License-Identifier: Apache-2.0
#include "geometry/landmark_pose.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <Eigen/Dense>

#include "base/error.h"
#include "base/number_text.h"
#include "geometry/fiducial_registration.h"

namespace af {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// One landmark in one view.
struct Sighting {
  std::size_t landmark;
  std::size_t view;
  const CameraGeometry* camera;
  Vector3d ct_point;
  Vector2d seen_px;
};

struct Candidate {
  RigidTransform room_from_ct = RigidTransform::Identity();
  double cost_mm2 = std::numeric_limits<double>::infinity();  ///< on the detectors
};

std::vector<Sighting> sightings_of(std::span<const LandmarkView> views,
                                   std::span<const Vector3d> landmarks_ct_mm) {
  std::vector<Sighting> sightings;
  for (std::size_t view = 0; view < views.size(); ++view) {
    if (views[view].landmarks_px.size() != landmarks_ct_mm.size())
      throw InputError(
          "landmarks_px of camera '" + views[view].camera.name + "'",
          std::to_string(views[view].landmarks_px.size()) + " entries",
          "must be as many as landmarks_ct_mm, " + std::to_string(landmarks_ct_mm.size()));
    for (std::size_t i = 0; i < landmarks_ct_mm.size(); ++i)
      if (const auto& seen = views[view].landmarks_px[i]; seen.has_value())
        sightings.push_back({i, view, &views[view].camera, landmarks_ct_mm[i], *seen});
  }
  return sightings;
}

/// InputError when the landmarks that are seen do not fix a pose.
void require_enough(const std::vector<Sighting>& sightings) {
  std::set<std::size_t> seen;
  std::vector<Vector3d> points;
  for (const Sighting& sighting : sightings)
    if (seen.insert(sighting.landmark).second) points.push_back(sighting.ct_point);
  if (points.size() < 3)
    throw InputError("landmarks seen",
                     std::to_string(points.size()),
                     "must be at least 3, in one view or in several");
  Eigen::Matrix3Xd centered(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i)
    centered.col(static_cast<Eigen::Index>(i)) = points[i];
  centered.colwise() -= Vector3d(centered.rowwise().mean());
  const Vector3d extent =
      Eigen::JacobiSVD<Matrix3d, Eigen::NoQRPreconditioner>(centered * centered.transpose())
          .singularValues();
  // The second largest extent relative to the largest, as variances.
  constexpr double kLeastWidth = 0.02;
  if (!(extent[1] > kLeastWidth * kLeastWidth * extent[0]))
    throw InputError("landmarks_ct_mm", "on one line", "must fix a rotation about any axis");
}

/// Distance (mm, on the detector) between a point's projection and where it was seen; nullopt when
/// the point is not in front of the source.
std::optional<Vector2d> miss_mm(const Sighting& sighting, const RigidTransform& room_from_ct) {
  const Vector3d room_point = room_from_ct * sighting.ct_point;
  constexpr double kLeastDepthMm = 1.0;
  if (!(sighting.camera->depth_mm(room_point) > kLeastDepthMm)) return std::nullopt;
  return (sighting.camera->project(room_point) - sighting.seen_px)
      .cwiseProduct(sighting.camera->pixel_spacing_mm);
}

double cost_mm2(const std::vector<Sighting>& sightings, const RigidTransform& room_from_ct) {
  double cost = 0.0;
  for (const Sighting& sighting : sightings) {
    const auto miss = miss_mm(sighting, room_from_ct);
    if (!miss) return std::numeric_limits<double>::infinity();
    cost += miss->squaredNorm();
  }
  return cost;
}

/// The pose turned about the landmarks' middle, then moved: steps in radians and millimetres.
RigidTransform stepped(const RigidTransform& pose, const Vector3d& middle, const Vector6d& step) {
  const PoseFrame frame = PoseFrame::about(pose, middle);
  return pose_from_parameters(frame, {step.head<3>(), step.tail<3>()});
}

/// Normal equations of the misses about a pose. Central differences are cheap enough: a few points,
/// six parameters.
struct NormalEquations {
  Matrix6d hessian = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
};

std::optional<NormalEquations> normal_equations(const std::vector<Sighting>& sightings,
                                                const RigidTransform& pose,
                                                const Vector3d& middle) {
  constexpr double kStepRad = 1e-6;
  constexpr double kStepMm = 1e-4;
  std::array<RigidTransform, 12> neighbours;
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t side = 0; side < 2; ++side) {
      const double size = (i < 3 ? kStepRad : kStepMm) * (side == 0 ? 1.0 : -1.0);
      neighbours[2 * i + side] =
          stepped(pose, middle, size * Vector6d::Unit(static_cast<Eigen::Index>(i)));
    }
  NormalEquations equations;
  for (const Sighting& sighting : sightings) {
    const auto miss = miss_mm(sighting, pose);
    if (!miss) return std::nullopt;
    Eigen::Matrix<double, 2, 6> slope;
    for (std::size_t i = 0; i < 6; ++i) {
      const auto ahead = miss_mm(sighting, neighbours[2 * i]);
      const auto behind = miss_mm(sighting, neighbours[2 * i + 1]);
      if (!ahead || !behind) return std::nullopt;
      slope.col(static_cast<Eigen::Index>(i)) =
          (*ahead - *behind) / (2.0 * (i < 3 ? kStepRad : kStepMm));
    }
    equations.hessian += slope.transpose() * slope;
    equations.gradient += slope.transpose() * *miss;
  }
  return equations;
}

/// Levenberg-Marquardt.
Candidate refined(const std::vector<Sighting>& sightings,
                  const RigidTransform& start,
                  const Vector3d& middle) {
  Candidate best{start, cost_mm2(sightings, start)};
  constexpr int kMostIterations = 100;
  constexpr double kLeastGain = 1e-12;
  double damping = 1e-3;
  for (int i = 0; i < kMostIterations && std::isfinite(best.cost_mm2); ++i) {
    const auto equations = normal_equations(sightings, best.room_from_ct, middle);
    if (!equations) break;
    Matrix6d damped = equations->hessian;
    damped.diagonal() *= 1.0 + damping;
    const Vector6d step = -damped.ldlt().solve(equations->gradient);
    constexpr double kLongestTurnRad = 0.5;
    const double turn = step.head<3>().norm();
    const double scale = turn > kLongestTurnRad ? kLongestTurnRad / turn : 1.0;
    if (!step.allFinite()) break;
    const RigidTransform pose = stepped(best.room_from_ct, middle, scale * step);
    const double cost = cost_mm2(sightings, pose);
    if (cost < best.cost_mm2) {
      const bool is_done =
          best.cost_mm2 - cost <= kLeastGain * (1.0 + best.cost_mm2) && step.norm() < 1e-9;
      best = {pose, cost};
      damping = std::max(damping / 10.0, 1e-12);
      if (is_done) break;
    } else {
      damping *= 10.0;
      if (damping > 1e10) break;
    }
  }
  return best;
}

/// The pose with this rotation whose translation brings the points nearest to their rays.
RigidTransform nearest_to_rays(const std::vector<Sighting>& sightings, const Matrix3d& rotation) {
  Matrix3d sum = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const Sighting& sighting : sightings) {
    const Ray ray = sighting.camera->ray(sighting.seen_px.x(), sighting.seen_px.y());
    const Matrix3d across = Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    sum += across;
    right += across * (ray.origin_point - rotation * sighting.ct_point);
  }
  RigidTransform pose = RigidTransform::Identity();
  pose.linear() = rotation;
  pose.translation() = sum.ldlt().solve(right);
  return pose;
}

/// The 24 turns of a cube, each also turned by 45 degrees about x, y and z.
std::vector<Matrix3d> rotations_over_all() {
  std::vector<Matrix3d> cube;
  for (int first = 0; first < 3; ++first)
    for (int second = 0; second < 3; ++second)
      for (int signs = 0; signs < 4 && first != second; ++signs) {
        Matrix3d rotation;
        rotation.col(0) = Vector3d::Unit(first) * ((signs & 1) != 0 ? -1.0 : 1.0);
        rotation.col(1) = Vector3d::Unit(second) * ((signs & 2) != 0 ? -1.0 : 1.0);
        rotation.col(2) = rotation.col(0).cross(rotation.col(1));
        cube.push_back(rotation);
      }
  std::vector<Matrix3d> all = cube;
  for (int axis = 0; axis < 3; ++axis)
    for (const Matrix3d& rotation : cube)
      all.emplace_back(
          Eigen::AngleAxisd(45.0 * kRadPerDeg, Vector3d::Unit(axis)).toRotationMatrix() * rotation);
  return all;
}

/// The pose fitted to the triangulated landmarks, where two or more views show three of them.
std::optional<RigidTransform> triangulated_pose(const std::vector<Sighting>& sightings,
                                                std::size_t landmark_count) {
  std::vector<Vector3d> room_points;
  std::vector<Vector3d> ct_points;
  for (std::size_t i = 0; i < landmark_count; ++i) {
    std::vector<Ray> rays;
    Vector3d ct_point = Vector3d::Zero();
    for (const Sighting& sighting : sightings)
      if (sighting.landmark == i) {
        rays.push_back(sighting.camera->ray(sighting.seen_px.x(), sighting.seen_px.y()));
        ct_point = sighting.ct_point;
      }
    if (rays.size() < 2) continue;
    try {
      room_points.push_back(back_project(rays).room_point);
      ct_points.push_back(ct_point);
    } catch (const InputError&) {  // parallel rays: the other starts remain
    }
  }
  if (room_points.size() < 3) return std::nullopt;
  try {
    return fit_rigid(room_points, ct_points).target_from_source;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

/// Poses that differ from each other, the best first.
std::vector<Candidate> different_candidates(std::vector<Candidate> all) {
  std::ranges::stable_sort(
      all, [](const Candidate& a, const Candidate& b) { return a.cost_mm2 < b.cost_mm2; });
  std::vector<Candidate> kept;
  constexpr double kSameRad = 1.0 * kRadPerDeg;
  for (const Candidate& candidate : all) {
    if (!std::isfinite(candidate.cost_mm2)) continue;
    const bool is_known = std::ranges::any_of(kept, [&](const Candidate& other) {
      return rotation_angle_between_rad(candidate.room_from_ct, other.room_from_ct) < kSameRad;
    });
    if (!is_known) kept.push_back(candidate);
  }
  return kept;
}

/// The candidates that fit about as well as the best. The way landmarks were clicked can explain
/// RMS misses of half a millimetre more on the detector, or a fifth more.
std::vector<Candidate> about_as_good(const std::vector<Candidate>& candidates,
                                     std::size_t sighting_count) {
  const auto rms_mm = [&](const Candidate& candidate) {
    return std::sqrt(candidate.cost_mm2 / static_cast<double>(sighting_count));
  };
  constexpr double kMoreMm = 0.5;
  constexpr double kMoreOfIt = 1.2;
  const double limit =
      std::max(rms_mm(candidates.front()) + kMoreMm, kMoreOfIt * rms_mm(candidates.front()));
  std::vector<Candidate> good;
  for (const Candidate& candidate : candidates)
    if (rms_mm(candidate) <= limit) good.push_back(candidate);
  return good;
}

void add_residuals(const std::vector<Sighting>& sightings, LandmarkPose& result) {
  double sum_px2 = 0.0;
  double sum_mm2 = 0.0;
  for (const Sighting& sighting : sightings) {
    const Vector3d room_point = result.room_from_ct * sighting.ct_point;
    const Ray ray = sighting.camera->ray(sighting.seen_px.x(), sighting.seen_px.y());
    const double px = (sighting.camera->project(room_point) - sighting.seen_px).norm();
    const double mm = (room_point - ray.origin_point).cross(ray.direction).norm();
    result.residuals.push_back({sighting.landmark, sighting.view, px, mm});
    sum_px2 += px * px;
    sum_mm2 += mm * mm;
  }
  const auto count = static_cast<double>(sightings.size());
  result.rms_px = std::sqrt(sum_px2 / count);
  result.rms_mm = std::sqrt(sum_mm2 / count);
}

}  // namespace

LandmarkPose pose_from_landmarks(std::span<const LandmarkView> views,
                                 std::span<const Vector3d> landmarks_ct_mm,
                                 const RigidTransform& nominal_room_from_ct) {
  const std::vector<Sighting> sightings = sightings_of(views, landmarks_ct_mm);
  require_enough(sightings);
  Vector3d middle = Vector3d::Zero();
  for (const Sighting& sighting : sightings)
    middle += sighting.ct_point / static_cast<double>(sightings.size());
  std::vector<Candidate> all = {refined(sightings, nominal_room_from_ct, middle)};
  if (const auto pose = triangulated_pose(sightings, landmarks_ct_mm.size()))
    all.push_back(refined(sightings, *pose, middle));
  for (const Matrix3d& rotation : rotations_over_all())
    all.push_back(refined(
        sightings, nearest_to_rays(sightings, rotation * nominal_room_from_ct.linear()), middle));
  const std::vector<Candidate> different = different_candidates(std::move(all));
  if (different.empty())
    throw InputError("landmarks",
                     "behind a camera at every pose",
                     "must lie in front of the cameras that saw them");
  std::vector<Candidate> good = about_as_good(different, sightings.size());
  const auto turn_deg = [&](const Candidate& candidate) {
    return rotation_angle_between_rad(nominal_room_from_ct, candidate.room_from_ct) * kDegPerRad;
  };
  std::ranges::stable_sort(good,
                           [&](const auto& a, const auto& b) { return turn_deg(a) < turn_deg(b); });
  LandmarkPose result;
  result.room_from_ct = good.front().room_from_ct;
  if (good.size() > 1)
    result.notes.push_back("the landmarks leave " + std::to_string(good.size()) +
                           " poses that fit about as well; the one turned least from the nominal "
                           "pose is taken, by " +
                           std::to_string(std::lround(turn_deg(good[0]))) +
                           " degrees, the next by " +
                           std::to_string(std::lround(turn_deg(good[1]))) +
                           ": mark more landmarks, or in another view");
  add_residuals(sightings, result);
  return result;
}

}  // namespace af
