// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <Eigen/Core>

namespace af {

/// What differs in one patient. Every trait is a draw of its own, keyed by (kind, seed, trait,
/// index), so a new trait changes no other. Without a seed it is the typical adult: every factor is
/// 1, every shift 0, and nothing is found. Spreads are this project's choice, of the size of the
/// variation between adults. Nothing is fitted to patient data.
/// \test Anatomy.TraitsAreIndependentAndTypicalWithoutASeed
class Anatomy {
 public:
  Anatomy() = default;
  Anatomy(std::string_view kind, std::uint64_t seed);

  [[nodiscard]] bool is_typical() const { return key_ == 0; }
  /// A factor about 1: exp(spread n), where n is standard normal within +-2.
  [[nodiscard]] double factor(std::string_view trait, double spread, int index = 0) const;
  /// A shift about 0: spread n, with the same n.
  [[nodiscard]] double shift(std::string_view trait, double spread, int index = 0) const;
  [[nodiscard]] Eigen::Vector3d shift3(std::string_view trait, double spread, int index = 0) const;
  /// Uniform in [low, high); `typical` without a seed.
  [[nodiscard]] double between(
      std::string_view trait, double low, double high, double typical, int index = 0) const;
  /// True with that probability. False without a seed.
  [[nodiscard]] bool has(std::string_view trait, double probability, int index = 0) const;

  /// Wear of joints and discs: 0 in two of five patients, otherwise up to 1.
  [[nodiscard]] double arthrosis() const;
  /// Thickness of cortical shells, relative to the typical one.
  [[nodiscard]] double shell() const { return factor("shell", 0.15); }
  /// Fat under the skin, mm more (or less) than typical.
  [[nodiscard]] double fat_mm() const { return between("fat", -5.0, 14.0, 0.0); }

 private:
  std::uint64_t key_ = 0;
};

/// A smooth map of the ct frame that turns the typical adult's size and proportions into a
/// patient's. It has stretches and long waves (no side mirrors the other). Where `bends`, it adds
/// scoliosis with the turn of the vertebrae that goes with it, and more or less kyphosis.
class Habitus {
 public:
  /// `wave_mm`: amplitude of the waves.
  Habitus(const Anatomy& anatomy, double wave_mm, bool bends);

  [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& typical_ct_mm) const;
  [[nodiscard]] Eigen::Matrix3d jacobian(const Eigen::Vector3d& typical_ct_mm) const;
  [[nodiscard]] const Eigen::Vector3d& stretch() const { return stretch_; }
  /// Angle between the steepest parts of the spine's curve as seen from the front.
  [[nodiscard]] double cobb_deg() const;

 private:
  bool is_typical_ = true;
  Eigen::Vector3d stretch_ = Eigen::Vector3d::Ones();
  double wave_mm_ = 0.0;
  Eigen::Matrix3d wave_vectors_per_mm_ =
      Eigen::Matrix3d::Zero();  ///< one column for each of x, y, z
  Eigen::Vector3d phases_rad_ = Eigen::Vector3d::Zero();
  double bend_mm_ = 0.0;  ///< amplitude of the scoliosis
  double bend_wavelength_mm_ = 300.0;
  double bend_phase_rad_ = 0.0;
  double turn_rad_per_mm_ = 0.0;
  double kyphosis_mm_ = 0.0;
};

}  // namespace af
