// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/plausible.h"
#include "ct/ct_read_options.h"

namespace af {

/// Turns the numbers of a CT's file into HU.
class HuConversion {
 public:
  /// For numbers that are HU already.
  HuConversion() = default;
  /// Throws InputError for options with problems.
  explicit HuConversion(const CtReadOptions& options);
  [[nodiscard]] bool is_identity() const { return kind_ == Kind::Hu; }
  [[nodiscard]] double hu(double number) const;

 private:
  enum class Kind { Hu, Scaled, Labels };
  Kind kind_ = Kind::Hu;
  double scale_ = 1.0;
  double offset_ = 0.0;
  std::vector<std::pair<double, double>> labels_;  ///< number, HU; by number
};

/// Collects voxels as int16 HU, and counts what does not fit.
class HuValues {
 public:
  HuValues() = default;
  /// Numbers are converted to HU first.
  explicit HuValues(HuConversion conversion) : conversion_(std::move(conversion)) {}

  void reserve(std::size_t voxels) { hu_.reserve(voxels); }

  void add(double number) { add_hu(conversion_.hu(number)); }

  void add_hu(double hu) {
    constexpr double kLow = std::numeric_limits<std::int16_t>::min();
    constexpr double kHigh = std::numeric_limits<std::int16_t>::max();
    const double rounded = std::nearbyint(hu);
    // NaN fails both comparisons and takes the second branch.
    if (rounded >= kLow && rounded <= kHigh) {
      hu_.push_back(static_cast<std::int16_t>(rounded));
      return;
    }
    if (!std::isfinite(hu)) {
      if (non_finite_count_++ == 0) first_non_finite_ = hu_.size();
      hu_.push_back(0);
      return;
    }
    if (!(std::abs(hu) <= kMaxHu) && implausible_count_++ == 0) {
      first_implausible_ = hu_.size();
      first_implausible_hu_ = hu;
    }
    ++clamped_count_;
    hu_.push_back(static_cast<std::int16_t>(rounded < kLow ? kLow : kHigh));
  }

  template <typename Value>
  void add_all(std::span<const Value> values) {
    if constexpr (std::is_same_v<Value, std::int16_t>)
      if (conversion_.is_identity()) {
        hu_.insert(hu_.end(), values.begin(), values.end());
        return;
      }
    for (const Value value : values) add(static_cast<double>(value));
  }

  [[nodiscard]] std::size_t clamped_count() const { return clamped_count_; }
  [[nodiscard]] std::size_t non_finite_count() const { return non_finite_count_; }
  /// Voxel number of the first NaN or infinite value.
  [[nodiscard]] std::size_t first_non_finite() const { return first_non_finite_; }
  /// Voxels beyond kMaxHu.
  [[nodiscard]] std::size_t implausible_count() const { return implausible_count_; }
  [[nodiscard]] std::size_t first_implausible() const { return first_implausible_; }
  [[nodiscard]] double first_implausible_hu() const { return first_implausible_hu_; }
  [[nodiscard]] const std::vector<std::int16_t>& hu() const { return hu_; }
  [[nodiscard]] std::vector<std::int16_t> take() { return std::move(hu_); }
  /// Replaces these voxels by those of another grid; counts stay.
  void replace(std::vector<std::int16_t> hu) { hu_ = std::move(hu); }

 private:
  HuConversion conversion_;
  std::vector<std::int16_t> hu_;
  std::size_t clamped_count_ = 0;
  std::size_t non_finite_count_ = 0;
  std::size_t first_non_finite_ = 0;
  std::size_t implausible_count_ = 0;
  std::size_t first_implausible_ = 0;
  double first_implausible_hu_ = 0.0;
};

}  // namespace af
