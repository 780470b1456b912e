// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/solid_projector.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "evaluate/simulate/solid_chords.h"

namespace af {

using Eigen::Vector3d;

namespace {

constexpr std::size_t kRaysAtOnce = 16;
/// Distance beyond a body's surface within which it is looked for, far above rounding.
constexpr double kMarginMm = 1e-6;

}  // namespace

/// The bodies around the current point of a ray. What is there is the one that was painted last.
class SolidProjector::OpenBodies {
 public:
  void start(const std::vector<int>& bodies) { open_ = bodies; }
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

void SolidProjector::find_way(const Vector3d& source_point,
                              const Vector3d& direction,
                              Way& way) const {
  constexpr double kPieceMm = 8.0;
  way.clear();
  double first_mm = 0.0;
  double last_mm = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0.0) {
      if (std::abs(source_point[axis]) > half_sizes_mm_[axis]) return;
      continue;
    }
    const double a = (-half_sizes_mm_[axis] - source_point[axis]) / direction[axis];
    const double b = (half_sizes_mm_[axis] - source_point[axis]) / direction[axis];
    first_mm = std::max(first_mm, std::min(a, b));
    last_mm = std::min(last_mm, std::max(a, b));
  }
  if (!(first_mm < last_mm)) return;
  if (!motion_) {
    way.push_back({source_point + first_mm * direction, direction, last_mm - first_mm, 1.0});
    return;
  }
  const int count = static_cast<int>(std::ceil((last_mm - first_mm) / kPieceMm));
  const double step_mm = (last_mm - first_mm) / count;
  std::vector<Vector3d> points;
  for (int i = 0; i <= count; ++i)
    points.emplace_back(source_point + (first_mm + i * step_mm) * direction);
  motion_->displace(points);
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Vector3d& from = points[i - 1];
    const Vector3d along = points[i] - from;
    const double length_mm = along.norm();
    way.push_back({from, along / length_mm, length_mm, step_mm / length_mm});
  }
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
  if (solid.texture_hu == 0) {
    add_length(solid.hu, length_mm * piece.stretch, sum);
    return;
  }
  const int steps = static_cast<int>(std::ceil(length_mm / kTextureStepMm));
  const double step_mm = length_mm / steps;
  const Vector3d origin = solid.texture_rotation * (piece.origin + solid.texture_shift_mm);
  const Vector3d direction = solid.texture_rotation * piece.direction;
  for (int i = 0; i < steps; ++i) {
    const double hu =
        solid.hu + solid.texture_hu * texture(origin + (first_mm + (i + 0.5) * step_mm) * direction,
                                              solid.texture_scale_mm);
    add_length(nearest_hu(hu), step_mm * piece.stretch, sum);
  }
}

std::vector<int> SolidProjector::candidates(const Vector3d& source_point,
                                            const Vector3d& direction,
                                            double sine) const {
  // Motion takes no point of a ray farther from the ray than this.
  const double slack_mm = kMarginMm + (motion_ ? motion_->largest_mm() : 0.0);
  std::vector<int> found;
  for (std::size_t i = 0; i < balls_.size(); ++i) {
    const Vector3d to_center = balls_[i].center_mm - source_point;
    const double around_mm = balls_[i].radius_mm + slack_mm;
    const double reach_mm = around_mm + sine * (to_center.norm() + around_mm);
    if ((to_center - to_center.dot(direction) * direction).squaredNorm() <= reach_mm * reach_mm)
      found.push_back(static_cast<int>(i));
  }
  return found;
}

std::vector<SolidProjector::Tube> SolidProjector::tubes(std::span<const Way> ways) {
  std::size_t count = 0;
  for (const Way& way : ways) count = std::max(count, way.size());
  std::vector<Tube> found(count);
  for (std::size_t i = 0; i < count; ++i) {
    Eigen::AlignedBox3d starts;
    Eigen::AlignedBox3d ends;
    for (const Way& way : ways) {
      if (way.size() <= i) continue;
      starts.extend(way[i].origin);
      ends.extend(Vector3d(way[i].origin + way[i].length_mm * way[i].direction));
    }
    const double across_mm = std::max(starts.diagonal().norm(), ends.diagonal().norm());
    found[i] = {starts.center(), ends.center(), 0.5 * across_mm + kMarginMm};
  }
  return found;
}

void SolidProjector::sort_into(const std::vector<Tube>& tubes,
                               const std::vector<int>& candidates,
                               std::vector<Bodies>& bodies) const {
  double reach_mm = 0.0;
  double step_mm = 0.0;
  bodies.resize(tubes.size());
  for (std::size_t i = 0; i < tubes.size(); ++i) {
    bodies[i].around.clear();
    bodies[i].near.clear();
    reach_mm = std::max(reach_mm, 0.5 * (tubes[i].to - tubes[i].from).norm() + tubes[i].radius_mm);
    if (i > 0) step_mm = std::max(step_mm, (tubes[i].middle() - tubes[i - 1].middle()).norm());
  }
  for (const int candidate : candidates) {
    const Ball& ball = balls_[static_cast<std::size_t>(candidate)];
    const Solid& solid = solids_[static_cast<std::size_t>(candidate)];
    std::size_t i = 0;
    while (i < tubes.size()) {
      const double gap_mm = (ball.center_mm - tubes[i].middle()).norm() - ball.radius_mm - reach_mm;
      if (gap_mm > 0.0) {  // as many tubes do not reach the body
        i += 1 + static_cast<std::size_t>(
                     std::min(gap_mm / step_mm, static_cast<double>(tubes.size())));
        continue;
      }
      switch (place_of(solid, tubes[i].from, tubes[i].to, tubes[i].radius_mm)) {
        case Place::Around:
          bodies[i].around.push_back(candidate);
          break;
        case Place::Near:
          bodies[i].near.push_back(candidate);
          break;
        case Place::Off:
          break;
      }
      ++i;
    }
  }
}

void SolidProjector::find_crossings(const Piece& piece,
                                    const std::vector<int>& near,
                                    std::vector<Crossing>& crossings) const {
  crossings.clear();
  for (const int body : near) {
    const Solid& solid = solids_[static_cast<std::size_t>(body)];
    for (const Chord& chord :
         chords(solid, piece.origin, piece.direction, {0.0, piece.length_mm})) {
      const double first_mm = std::max(chord.first_mm, 0.0);
      const double last_mm = std::min(chord.last_mm, piece.length_mm);
      if (!(first_mm < last_mm)) continue;
      crossings.push_back({first_mm, body, true});
      crossings.push_back({last_mm, body, false});
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
  const auto add_until = [&](double to_mm) {
    if (!open.is_empty())
      add_span(piece, solids_[static_cast<std::size_t>(open.top())], at_mm, to_mm, sum);
    at_mm = to_mm;
  };
  for (const Crossing& crossing : crossings) {
    add_until(crossing.at_mm);
    open.apply(crossing);
  }
  add_until(piece.length_mm);
}

PathIntegrals SolidProjector::integrate(const Vector3d& source_point,
                                        const Vector3d& through_point) const {
  PathIntegrals sum;
  integrate_row(source_point, {&through_point, 1}, {&sum, 1});
  return sum;
}

void SolidProjector::integrate_row(const Vector3d& source_point,
                                   std::span<const Vector3d> through_points,
                                   std::span<PathIntegrals> sums) const {
  std::fill(sums.begin(), sums.end(), PathIntegrals());
  std::vector<Way> ways;
  std::vector<Bodies> bodies;
  std::vector<Crossing> crossings;
  OpenBodies open;
  for (std::size_t first = 0; first < through_points.size(); first += kRaysAtOnce) {
    const auto points =
        through_points.subspan(first, std::min(kRaysAtOnce, through_points.size() - first));
    const Vector3d axis = (points[points.size() / 2] - source_point).normalized();
    double sine = 0.0;
    ways.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vector3d direction = (points[i] - source_point).normalized();
      sine = std::max(sine, direction.cross(axis).norm());
      find_way(source_point, direction, ways[i]);
    }
    sort_into(tubes(ways), candidates(source_point, axis, sine), bodies);
    // The loop goes piece by piece, not ray by ray, so that what is read lies close together.
    for (std::size_t k = 0; k < bodies.size(); ++k)
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (k >= ways[i].size()) continue;
        find_crossings(ways[i][k], bodies[k].near, crossings);
        open.start(bodies[k].around);
        add_piece(ways[i][k], crossings, open, sums[first + i]);
      }
  }
}

}  // namespace af
