// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/anatomy.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/hash_random.h"

namespace af {

namespace {

using Eigen::Vector3d;

constexpr double kFullTurnRad = 2.0 * std::numbers::pi;

/// Standard normal, redrawn until within +-2.
double bounded_normal(HashRandom& random) {
  double value = random.normal();
  while (std::abs(value) > 2.0) value = random.normal();
  return value;
}

HashRandom trait_random(std::uint64_t key, std::string_view trait, int index) {
  return HashRandom(key, hash_name(trait), static_cast<std::uint64_t>(index));
}

}  // namespace

Anatomy::Anatomy(std::string_view kind, std::uint64_t seed)
    : key_(hash64(seed, hash_name(kind)) | 1U) {}

double Anatomy::factor(std::string_view trait, double spread, int index) const {
  return is_typical() ? 1.0 : std::exp(shift(trait, spread, index));
}

double Anatomy::shift(std::string_view trait, double spread, int index) const {
  if (is_typical()) return 0.0;
  HashRandom random = trait_random(key_, trait, index);
  return spread * bounded_normal(random);
}

Vector3d Anatomy::shift3(std::string_view trait, double spread, int index) const {
  if (is_typical()) return Vector3d::Zero();
  HashRandom random = trait_random(key_, trait, index);
  const double x = bounded_normal(random);
  const double y = bounded_normal(random);
  const double z = bounded_normal(random);
  return spread * Vector3d(x, y, z);
}

double Anatomy::between(
    std::string_view trait, double low, double high, double typical, int index) const {
  if (is_typical()) return typical;
  return trait_random(key_, trait, index).uniform(low, high);
}

bool Anatomy::has(std::string_view trait, double probability, int index) const {
  return between(trait, 0.0, 1.0, 1.0, index) < probability;
}

double Anatomy::arthrosis() const {
  return std::max(0.0, between("arthrosis", -2.0 / 3.0, 1.0, 0.0));
}

Habitus::Habitus(const Anatomy& anatomy, double wave_mm, bool bends)
    : is_typical_(anatomy.is_typical()) {
  if (is_typical_) return;
  constexpr double kSizeSpread = 0.045;
  constexpr double kProportionSpread = 0.025;
  const double size = anatomy.factor("size", kSizeSpread);
  for (int axis = 0; axis < 3; ++axis) {
    stretch_[axis] = size * anatomy.factor("proportion", kProportionSpread, axis);
    wave_vectors_per_mm_.col(axis) =
        kFullTurnRad / anatomy.between("wavelength", 220.0, 400.0, 300.0, axis) *
        (anatomy.shift3("wave direction", 1.0, axis) + Vector3d(0.0, 0.0, 0.1)).normalized();
    phases_rad_[axis] = anatomy.between("wave phase", 0.0, kFullTurnRad, 0.0, axis);
  }
  wave_mm_ = wave_mm * anatomy.between("waves", 0.3, 1.0, 0.0);
  if (!bends) return;
  const double cobb_deg = anatomy.has("scoliosis", 0.3)
                              ? anatomy.between("Cobb angle", 10.0, 28.0, 0.0)
                              : anatomy.between("posture", 0.0, 7.0, 0.0);
  bend_wavelength_mm_ = anatomy.between("bend wavelength", 260.0, 420.0, 300.0);
  bend_mm_ = std::tan(0.5 * cobb_deg * std::numbers::pi / 180.0) * bend_wavelength_mm_ /
             kFullTurnRad * (anatomy.has("bend to the right", 0.7) ? -1.0 : 1.0);
  bend_phase_rad_ = anatomy.between("bend phase", 0.0, kFullTurnRad, 0.0);
  turn_rad_per_mm_ = anatomy.between("turn", 0.2, 0.7, 0.0) * std::numbers::pi / 180.0;
  kyphosis_mm_ = anatomy.shift("kyphosis", 4.0);
}

double Habitus::cobb_deg() const {
  return 2.0 * std::atan(std::abs(bend_mm_) * kFullTurnRad / bend_wavelength_mm_) * 180.0 /
         std::numbers::pi;
}

Vector3d Habitus::operator()(const Vector3d& typical_ct_mm) const {
  if (is_typical_) return typical_ct_mm;
  Vector3d point = stretch_.cwiseProduct(typical_ct_mm);
  for (int axis = 0; axis < 3; ++axis)
    point[axis] +=
        wave_mm_ * std::sin(wave_vectors_per_mm_.col(axis).dot(typical_ct_mm) + phases_rad_[axis]);
  const double z_mm = typical_ct_mm.z();
  // The spine, which lies at x = y = 0, bends more than the chest wall, which stays within the
  // skin.
  constexpr double kReachMm = 90.0;
  const double nearness = std::exp(-typical_ct_mm.head<2>().squaredNorm() / (kReachMm * kReachMm));
  const double bend_mm =
      nearness * bend_mm_ * std::sin(kFullTurnRad * z_mm / bend_wavelength_mm_ + bend_phase_rad_);
  // Vertebrae turn towards the convex side.
  const double turn_rad = turn_rad_per_mm_ * bend_mm;
  const double x = point.x();
  point.x() = std::cos(turn_rad) * x - std::sin(turn_rad) * point.y() + bend_mm;
  point.y() = std::sin(turn_rad) * x + std::cos(turn_rad) * point.y() +
              nearness * kyphosis_mm_ * std::cos(z_mm / 70.0);
  return point;
}

Eigen::Matrix3d Habitus::jacobian(const Vector3d& typical_ct_mm) const {
  constexpr double kStepMm = 0.5;
  Eigen::Matrix3d matrix;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d step = kStepMm * Vector3d::Unit(axis);
    matrix.col(axis) =
        ((*this)(typical_ct_mm + step) - (*this)(typical_ct_mm - step)) / (2.0 * kStepMm);
  }
  return matrix;
}

}  // namespace af
