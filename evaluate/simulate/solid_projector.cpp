// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/solid_projector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "evaluate/simulate/solid_chords.h"

namespace af {

using Eigen::Vector3d;

/// The bodies around the present point of a ray; the one that was painted last is what is there.
class SolidProjector::OpenBodies {
 public:
  void apply(const Crossing& crossing) {
    if (crossing.is_entry) {
      open_.insert(std::upper_bound(open_.begin(), open_.end(), crossing.solid), crossing.solid);
    } else {
      open_.erase(std::lower_bound(open_.begin(), open_.end(), crossing.solid));
    }
  }
  [[nodiscard]] bool is_empty() const { return open_.empty(); }
  [[nodiscard]] int top() const { return open_.back(); }

 private:
  std::vector<int> open_;  ///< ascending
};

SolidProjector::SolidProjector(const Phantom& phantom,
                               const TissueModel& tissue,
                               std::optional<SmoothMotion> motion)
    : solids_(phantom.solids),
      half_sizes_mm_(phantom.half_sizes_mm),
      tissue_(tissue),
      motion_(std::move(motion)) {
  balls_.reserve(solids_.size());
  for (const Solid& solid : solids_) {
    double radius_mm = solid.half_sizes_mm.maxCoeff();
    if (solid.shape == Solid::Shape::Capsule)
      radius_mm = solid.half_sizes_mm.x() + solid.half_sizes_mm.z();
    if (solid.shape == Solid::Shape::EllipticCylinder)
      radius_mm = std::hypot(solid.half_sizes_mm.head<2>().maxCoeff(), solid.half_sizes_mm.z());
    balls_.push_back({solid.center_mm, radius_mm});
  }
}

std::vector<SolidProjector::Piece> SolidProjector::pieces(const Vector3d& source_point,
                                                          const Vector3d& direction) const {
  constexpr double kPieceMm = 8.0;
  double first_mm = 0.0;
  double last_mm = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0.0) {
      if (std::abs(source_point[axis]) > half_sizes_mm_[axis]) return {};
      continue;
    }
    const double a = (-half_sizes_mm_[axis] - source_point[axis]) / direction[axis];
    const double b = (half_sizes_mm_[axis] - source_point[axis]) / direction[axis];
    first_mm = std::max(first_mm, std::min(a, b));
    last_mm = std::min(last_mm, std::max(a, b));
  }
  if (!(first_mm < last_mm)) return {};
  if (!motion_)
    return {{first_mm,
             last_mm,
             source_point + first_mm * direction,
             direction,
             last_mm - first_mm,
             1.0}};
  std::vector<Piece> found;
  const int count = static_cast<int>(std::ceil((last_mm - first_mm) / kPieceMm));
  const double step_mm = (last_mm - first_mm) / count;
  const auto in_anatomy = [&](int i) {
    const Vector3d point = source_point + (first_mm + i * step_mm) * direction;
    return Vector3d(point + motion_->displacement_mm(point));
  };
  Vector3d from = in_anatomy(0);
  for (int i = 0; i < count; ++i) {
    const Vector3d to = in_anatomy(i + 1);
    const double length_mm = (to - from).norm();
    found.push_back({first_mm + i * step_mm,
                     first_mm + (i + 1) * step_mm,
                     from,
                     (to - from) / length_mm,
                     length_mm,
                     step_mm / length_mm});
    from = to;
  }
  return found;
}

void SolidProjector::add_length(int hu, double length_mm, PathIntegrals& sum) const {
  const AttenuationModel& model = tissue_.attenuation_model();
  if (hu < model.air_below_hu) return;
  const auto relative = static_cast<std::uint16_t>(
      std::clamp(hu + 1000, 0, int{std::numeric_limits<std::uint16_t>::max()}));
  const double bone = tissue_.bone_part(relative);
  sum.water_mm += (relative - bone) * length_mm / 1000.0;
  sum.bone_mm += bone * length_mm / 1000.0;
}

void SolidProjector::add_span(const Piece& piece,
                              const Solid& solid,
                              double first_mm,
                              double last_mm,
                              PathIntegrals& sum) const {
  constexpr double kTextureStepMm = 1.5;
  const double length_mm = last_mm - first_mm;
  if (!(length_mm > 0.0)) return;
  const int steps =
      solid.texture_hu == 0 ? 1 : static_cast<int>(std::ceil(length_mm / kTextureStepMm));
  const double step_mm = length_mm / steps;
  for (int i = 0; i < steps; ++i) {
    double hu = solid.hu;
    if (solid.texture_hu != 0)
      hu += solid.texture_hu * texture(piece.origin + solid.texture_shift_mm +
                                           (first_mm + (i + 0.5) * step_mm) * piece.direction,
                                       solid.texture_scale_mm);
    add_length(static_cast<int>(std::lround(hu)), step_mm * piece.stretch, sum);
  }
}

std::vector<SolidProjector::Candidate> SolidProjector::candidates(const Vector3d& source_point,
                                                                  const Vector3d& direction) const {
  // Motion takes no point of the ray farther from it than this.
  const double slack_mm = motion_ ? motion_->largest_mm() : 0.0;
  std::vector<Candidate> found;
  for (std::size_t i = 0; i < balls_.size(); ++i) {
    const Vector3d to_center = balls_[i].center_mm - source_point;
    const double nearest_mm = to_center.dot(direction);
    const double reach_mm = balls_[i].radius_mm + slack_mm;
    const double inside = reach_mm * reach_mm - (to_center - nearest_mm * direction).squaredNorm();
    if (inside < 0.0) continue;
    const double half_mm = std::sqrt(inside);
    found.push_back({static_cast<int>(i), nearest_mm - half_mm, nearest_mm + half_mm});
  }
  return found;
}

void SolidProjector::find_crossings(const Piece& piece,
                                    const std::vector<Candidate>& candidates,
                                    std::vector<Crossing>& crossings) const {
  crossings.clear();
  for (const Candidate& candidate : candidates) {
    if (candidate.ray_last_mm < piece.ray_first_mm || candidate.ray_first_mm > piece.ray_last_mm)
      continue;
    const Solid& solid = solids_[static_cast<std::size_t>(candidate.solid)];
    for (const Chord& chord : chords(solid, piece.origin, piece.direction)) {
      const double first_mm = std::max(chord.first_mm, 0.0);
      const double last_mm = std::min(chord.last_mm, piece.length_mm);
      if (!(first_mm < last_mm)) continue;
      crossings.push_back({first_mm, candidate.solid, true});
      crossings.push_back({last_mm, candidate.solid, false});
    }
  }
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
    return std::pair(a.at_mm, a.is_entry) < std::pair(b.at_mm, b.is_entry);
  });
}

void SolidProjector::add_piece(const Piece& piece,
                               const std::vector<Crossing>& crossings,
                               OpenBodies& open,
                               PathIntegrals& sum) const {
  double at_mm = 0.0;
  for (const Crossing& crossing : crossings) {
    if (!open.is_empty())
      add_span(piece, solids_[static_cast<std::size_t>(open.top())], at_mm, crossing.at_mm, sum);
    at_mm = crossing.at_mm;
    open.apply(crossing);
  }
}

PathIntegrals SolidProjector::integrate(const Vector3d& source_point,
                                        const Vector3d& through_point) const {
  const Vector3d direction = (through_point - source_point).normalized();
  const std::vector<Candidate> near = candidates(source_point, direction);
  std::vector<Crossing> crossings;
  OpenBodies open;
  PathIntegrals sum;
  for (const Piece& piece : pieces(source_point, direction)) {
    find_crossings(piece, near, crossings);
    add_piece(piece, crossings, open, sum);
  }
  return sum;
}

}  // namespace af
