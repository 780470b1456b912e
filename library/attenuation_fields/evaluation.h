// SPDX-License-Identifier: Apache-2.0
// Measures of poses and DRRs, and the tables that the programs write.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "attenuation_fields/export.h"
#include "attenuation_fields/geometry.h"

namespace attenuation_fields {

/// An axis-aligned box in the ct frame (mm).
struct CtBox {
  Vector3 low_mm = {0.0, 0.0, 0.0};
  Vector3 high_mm = {0.0, 0.0, 0.0};
};

/// Target registration error (mm): the mean distance over a box between where two poses put its
/// points. Throws InputError for a box without volume.
[[nodiscard]] ATTENUATION_FIELDS_API double mean_tre_mm(const Pose& pose,
                                                        const Pose& gold,
                                                        const CtBox& target_box_ct);

/// Peak signal-to-noise ratio (dB) of a DRR against a reference. Pixels where the reference is 0
/// are left out; nullopt when nothing remains. Throws InputError when the sizes differ.
[[nodiscard]] ATTENUATION_FIELDS_API std::optional<double> psnr_db(
    std::span<const float> drr, std::span<const float> reference);

/// The paper's threshold: a TRE below this is a success.
inline constexpr double kSuccessTreMm = 2.5;

/// Successes among registrations, with Wilson's 95 % interval of their rate.
struct SuccessRate {
  std::int64_t trials = 0;
  std::int64_t successes = 0;
  double rate = 0.0;  ///< NaN without trials
  double low = 0.0;
  double high = 1.0;
};

/// The success rate of these TREs (mm). NaN counts as a failure.
[[nodiscard]] ATTENUATION_FIELDS_API SuccessRate success_rate(std::span<const double> tre_mm,
                                                              double threshold_mm = kSuccessTreMm);

/// A CSV file with a header line: registrations.csv, image-quality.csv, starts.csv.
class ATTENUATION_FIELDS_API Table {
 public:
  /// Throws FileError naming path and line.
  static Table read(const std::filesystem::path& path);

  [[nodiscard]] const std::vector<std::string>& columns() const;
  [[nodiscard]] std::size_t row_count() const;
  /// A column as text. Throws InputError that lists the columns.
  [[nodiscard]] std::vector<std::string> texts(const std::string& column) const;
  /// A column as numbers. Empty cells and "nan" are NaN. Throws FileError naming line, column and
  /// value.
  [[nodiscard]] std::vector<double> numbers(const std::string& column) const;

 private:
  struct Impl;
  explicit Table(std::shared_ptr<const Impl> impl);
  std::shared_ptr<const Impl> impl_;
};

}  // namespace attenuation_fields
