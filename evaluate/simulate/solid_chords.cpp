// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/solid_chords.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace af {

namespace {

using Eigen::Vector3d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Where |a + t b|^2 < radius^2; a and b have two or three components.
template <typename Vector>
std::optional<Chord> within_radius(const Vector& a, const Vector& b, double radius) {
  const double bb = b.squaredNorm();
  const double outside = a.squaredNorm() - radius * radius;
  if (bb == 0.0) {
    if (outside >= 0.0) return std::nullopt;
    return Chord{-kInfinity, kInfinity};
  }
  const double ab = a.dot(b);
  const double discriminant = ab * ab - bb * outside;
  if (!(discriminant > 0.0)) return std::nullopt;
  const double root = std::sqrt(discriminant);
  return Chord{(-ab - root) / bb, (-ab + root) / bb};
}

/// Where low < origin + t direction < high.
std::optional<Chord> within_slab(double origin, double direction, double low, double high) {
  if (direction == 0.0) {
    if (origin <= low || origin >= high) return std::nullopt;
    return Chord{-kInfinity, kInfinity};
  }
  const double a = (low - origin) / direction;
  const double b = (high - origin) / direction;
  return Chord{std::min(a, b), std::max(a, b)};
}

std::optional<Chord> common(const std::optional<Chord>& a, const std::optional<Chord>& b) {
  if (!a || !b) return std::nullopt;
  const Chord both{std::max(a->first_mm, b->first_mm), std::min(a->last_mm, b->last_mm)};
  if (!(both.first_mm < both.last_mm)) return std::nullopt;
  return both;
}

/// A capsule is convex, so its chord spans those of its cylinder and its two balls.
std::optional<Chord> capsule_chord(const Solid& solid, const Vector3d& a, const Vector3d& b) {
  const double radius = solid.half_sizes_mm.x();
  const double half = solid.half_sizes_mm.z();
  std::optional<Chord> all = common(within_radius(a.head<2>().eval(), b.head<2>().eval(), radius),
                                    within_slab(a.z(), b.z(), -half, half));
  for (const double end : {-half, half}) {
    const std::optional<Chord> ball =
        within_radius(Vector3d(a - end * Vector3d::UnitZ()), b, radius);
    if (!ball) continue;
    if (!all) {
      all = ball;
    } else {
      all->first_mm = std::min(all->first_mm, ball->first_mm);
      all->last_mm = std::max(all->last_mm, ball->last_mm);
    }
  }
  return all;
}

/// Adds the parts of `outer` that the waist leaves, to 1e-6 mm. A gap of less than 1/24 of the
/// chord may go unseen. Looks only within `wanted`.
void add_waist_chords(const Solid& solid,
                      const Vector3d& a,
                      const Vector3d& b,
                      const Chord& outer,
                      const Chord& wanted,
                      Chords& found) {
  constexpr int kSamples = 24;
  constexpr int kBisections = 30;
  const auto is_inside = [&](double t) {
    const Vector3d unit = a + t * b;
    const double radius = 1.0 - solid.waist * (1.0 - unit.z() * unit.z());
    return unit.head<2>().squaredNorm() <= radius * radius;
  };
  const auto surface_between = [&](double low, double high) {
    const bool low_is_inside = is_inside(low);
    for (int i = 0; i < kBisections; ++i) {
      const double middle = 0.5 * (low + high);
      (is_inside(middle) == low_is_inside ? low : high) = middle;
    }
    return 0.5 * (low + high);
  };
  const double step = (outer.last_mm - outer.first_mm) / kSamples;
  if (outer.last_mm <= wanted.first_mm || outer.first_mm >= wanted.last_mm) return;
  const auto first_sample =
      static_cast<int>(std::max(0.0, std::floor((wanted.first_mm - outer.first_mm) / step)));
  const auto last_sample = static_cast<int>(
      std::min<double>(kSamples, std::ceil((wanted.last_mm - outer.first_mm) / step)));
  std::optional<double> entry;
  double last = outer.first_mm;
  bool was_inside = false;
  for (int i = first_sample; i <= last_sample; ++i) {
    // The ends lie on the body's own flat ends, or on the cylinder around it, so they are moved
    // inwards a little.
    const double t = outer.first_mm + std::clamp(i * step, 1e-7, (kSamples - 1e-7) * step);
    const bool now_inside = is_inside(t);
    if (now_inside && !was_inside)
      entry = i == first_sample ? outer.first_mm : surface_between(last, t);
    if (!now_inside && was_inside && entry) found.add(*entry, surface_between(last, t));
    was_inside = now_inside;
    last = t;
  }
  if (was_inside && entry) found.add(*entry, outer.last_mm);
}

/// Whether all of the segment from a to b lies beyond one face of a box around the origin.
bool lies_beyond_a_face(const Vector3d& a, const Vector3d& b, const Vector3d& half_sizes) {
  return (a.array() > half_sizes.array() && b.array() > half_sizes.array()).any() ||
         (a.array() < -half_sizes.array() && b.array() < -half_sizes.array()).any();
}

/// Whether the body, in its own frame, holds all points within `distance_mm` of this one. Those
/// points that it holds form a convex body, so what holds for two of them holds between them.
bool holds_around(const Solid& solid, const Vector3d& point, double distance_mm) {
  if (solid.shape == Solid::Shape::Capsule) {
    const double half = solid.half_sizes_mm.z();
    const Vector3d from_axis = point - std::clamp(point.z(), -half, half) * Vector3d::UnitZ();
    return from_axis.norm() <= solid.half_sizes_mm.x() - distance_mm;
  }
  const Vector3d unit = point.cwiseQuotient(solid.half_sizes_mm);
  const double inwards = 1.0 - distance_mm / solid.half_sizes_mm.minCoeff();
  if (solid.shape == Solid::Shape::EllipticCylinder)
    return std::abs(unit.z()) <= inwards && unit.head<2>().norm() <= inwards - solid.waist;
  if (solid.shape == Solid::Shape::HalfEllipsoid && point.z() < distance_mm) return false;
  return unit.norm() <= inwards;
}

}  // namespace

void Chords::add(double first_mm, double last_mm) {
  if (count < 2 && first_mm < last_mm)
    items[static_cast<std::size_t>(count++)] = {first_mm, last_mm};
}

Chords chords(const Solid& solid,
              const Vector3d& origin,
              const Vector3d& direction,
              const Chord& wanted) {
  constexpr double kMarginMm = 1e-6;  // far above rounding
  const Vector3d a = solid.rotation.transpose() * (origin - solid.center_mm);
  const Vector3d b = solid.rotation.transpose() * direction;
  if (lies_beyond_a_face(a + wanted.first_mm * b,
                         a + wanted.last_mm * b,
                         solid.reach_mm() + Vector3d::Constant(kMarginMm)))
    return {};
  const Vector3d unit_a = a.cwiseQuotient(solid.half_sizes_mm);
  const Vector3d unit_b = b.cwiseQuotient(solid.half_sizes_mm);
  Chords found;
  std::optional<Chord> chord;
  switch (solid.shape) {
    case Solid::Shape::Capsule:
      chord = capsule_chord(solid, a, b);
      break;
    case Solid::Shape::EllipticCylinder:
      chord = common(within_radius(unit_a.head<2>().eval(), unit_b.head<2>().eval(), 1.0),
                     within_slab(unit_a.z(), unit_b.z(), -1.0, 1.0));
      if (chord && solid.waist > 0.0) {
        add_waist_chords(solid, unit_a, unit_b, *chord, wanted, found);
        return found;
      }
      break;
    case Solid::Shape::HalfEllipsoid:
      chord = common(within_radius(unit_a, unit_b, 1.0),
                     within_slab(unit_a.z(), unit_b.z(), 0.0, kInfinity));
      break;
    case Solid::Shape::Ellipsoid:
      chord = within_radius(unit_a, unit_b, 1.0);
      break;
  }
  if (chord) found.add(chord->first_mm, chord->last_mm);
  return found;
}

Place place_of(const Solid& solid, const Vector3d& from, const Vector3d& to, double distance_mm) {
  const Vector3d a = solid.rotation.transpose() * (from - solid.center_mm);
  const Vector3d b = solid.rotation.transpose() * (to - solid.center_mm);
  if (lies_beyond_a_face(a, b, solid.reach_mm() + Vector3d::Constant(distance_mm)))
    return Place::Off;
  return holds_around(solid, a, distance_mm) && holds_around(solid, b, distance_mm) ? Place::Around
                                                                                    : Place::Near;
}

}  // namespace af
