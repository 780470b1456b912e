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

/// A capsule is convex: its chord reaches over those of its cylinder and its two balls.
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

/// Adds the parts of `outer` that the waist leaves, to 1e-6 mm; a gap of less than 1/24 of the
/// chord may stay unseen.
void add_waist_chords(
    const Solid& solid, const Vector3d& a, const Vector3d& b, const Chord& outer, Chords& found) {
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
  std::optional<double> entry;
  double last = outer.first_mm;
  bool was_inside = false;
  for (int i = 0; i <= kSamples; ++i) {
    // The ends lie on the body's own flat ends, or on the cylinder around it: a little inwards.
    const double t = outer.first_mm + std::clamp(i * step, 1e-7, (kSamples - 1e-7) * step);
    const bool now_inside = is_inside(t);
    if (now_inside && !was_inside) entry = i == 0 ? outer.first_mm : surface_between(last, t);
    if (!now_inside && was_inside && entry) found.add(*entry, surface_between(last, t));
    was_inside = now_inside;
    last = t;
  }
  if (was_inside && entry) found.add(*entry, outer.last_mm);
}

}  // namespace

void Chords::add(double first_mm, double last_mm) {
  if (count < 2 && first_mm < last_mm)
    items[static_cast<std::size_t>(count++)] = {first_mm, last_mm};
}

Chords chords(const Solid& solid, const Vector3d& origin, const Vector3d& direction) {
  const Vector3d a = solid.rotation.transpose() * (origin - solid.center_mm);
  const Vector3d b = solid.rotation.transpose() * direction;
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
        add_waist_chords(solid, unit_a, unit_b, *chord, found);
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

}  // namespace af
