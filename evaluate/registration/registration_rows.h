// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "evaluate/registration/registration_errors.h"
#include "evaluate/starts/perturbed_starts.h"
#include "evaluate/statistics/success_rate.h"
#include "files/csv_table.h"
#include "register/results/registration_columns.h"

namespace af::evaluation {

/// One step of a search that failed.
struct TracePoint {
  int stage = 0;  ///< from 1, counted over the chains
  double step_mm = 0.0;
  std::int64_t poses_tried = 0;  ///< up to here, over all stages
  double similarity = 0.0;
  std::array<double, 6> deg_mm{};  ///< relative to gold, about the ROI centre
  double tre_mm = 0.0;

  auto members() { return std::tie(stage, step_mm, poses_tried, similarity, deg_mm, tre_mm); }
};

/// One registration as evaluated. Poses are relative to gold, about the ROI centre. Without an end
/// pose (stop reasons of failed registrations), similarity, TRE and final parameters are NaN.
struct RegistrationRow : registration::RegistrationRow {
  std::uint64_t draw_index = 0;
  int interval = 0;  ///< in initial TRE
  double stated_pose_tre_mm =
      kMissing;  ///< against gold_room_from_ct when the fiducials give the gold
  RegistrationErrors errors;
  double squared_distance = kMissing;  ///< Mahalanobis distance of the error by the covariance
  double gold_tre_95_mm = 0.0;         ///< of the gold standard itself; 0 where unknown
  std::string error;                   ///< message of the exception that a registration threw
  bool has_one_view = false;           ///< of the case

  /// The error by which every success, failure and capture range is counted. This is TRE, or mRPD
  /// with one view, which hardly shows depth.
  [[nodiscard]] double decisive_mm() const { return has_one_view ? errors.mrpd_mm : tre_mm; }
  /// Its name in tables.
  [[nodiscard]] const char* decisive_name() const { return has_one_view ? "mRPD" : "TRE"; }
  /// The column `success`.
  [[nodiscard]] bool is_success(double success_mm) const { return decisive_mm() < success_mm; }
  auto members() {
    return std::tuple_cat(registration::RegistrationRow::members(),
                          std::tie(draw_index,
                                   interval,
                                   stated_pose_tre_mm,
                                   errors,
                                   squared_distance,
                                   gold_tre_95_mm,
                                   error,
                                   has_one_view));
  }
};

/// Most starts of a run, because rank 0 holds all of its rows.
inline constexpr std::size_t kMostStarts = 1000000;

/// Some of many rows.
using RowPointers = std::vector<const RegistrationRow*>;

/// A row and, for some failures, how the search went (failure_traces.h; empty for other rows).
struct TracedRow {
  RegistrationRow row;
  std::vector<TracePoint> trace;

  auto members() { return std::tie(row, trace); }
};

/// registrations.csv in the given order, timings last. Where a correction was wanted, every row has
/// its columns. `success` is is_success(success_tre_mm).
CsvTable registrations_table(std::span<const RegistrationRow> rows,
                             double success_tre_mm = kSuccessTreMm);

/// Writes registrations.csv of any length, one part at a time.
void write_registrations(const std::filesystem::path& path,
                         std::span<const RegistrationRow> rows,
                         double success_tre_mm = kSuccessTreMm);

/// Writes starts.csv: the starts of any number of cases, in order. The file gets its name once
/// finished.
class StartsFile {
 public:
  explicit StartsFile(std::filesystem::path path);
  void add(const std::string& case_name, std::span<const PerturbedStart> starts);
  /// Throws FileError when it cannot be written whole.
  void finish();

 private:
  std::filesystem::path path_;
  std::filesystem::path partial_;
  std::ofstream file_;
};

}  // namespace af::evaluation
