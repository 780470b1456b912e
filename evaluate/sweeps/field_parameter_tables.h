// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "evaluate/image_quality/drr_comparison.h"
#include "field/field_file.h"
#include "precompute/build/precompute_options.h"

namespace af::evaluation {

/// The field of one setting and one camera of a CT, and how its DRRs compare.
struct SettingResult {
  PrecomputeOptions setting;
  FieldFileInfo info;
  nlohmann::json field;
  double creation_seconds = 0.0;
  int creation_ranks = 0;
  std::uint64_t uncompressed_bytes = 0;
  std::vector<DrrComparison> comparisons;  ///< on rank 0

  /// "skull A", or the camera alone when no case is named.
  [[nodiscard]] std::string target() const;
};

/// Share of the tiles; sweeps always state it.
double training_share(const PrecomputeOptions& setting);

/// Size of all samples of the uncropped planes at 16 bits, which the paper calls the uncompressed
/// field.
std::uint64_t uncompressed_bytes_of(const PrecomputeOptions& setting);

/// Reads creation time and ranks from the field's file.
void read_creation(SettingResult& result);

/// Writes the tables and the figure of a sweep, and returns its part of summary.json. Every target
/// (camera of a case) has the same settings in the same order, the base setting first, one target
/// after the other. A setting's DRRs are pooled over the targets; sizes and times are averaged.
/// Writes field-parameters.csv (a row per setting: Table I), field-parameters-fields.csv (per
/// field), field-parameters-poses.csv (per DRR), and field-parameters.svg and .png (Fig. 10).
nlohmann::json write_sweep(const std::vector<SettingResult>& results,
                           const std::filesystem::path& folder);

/// One line per setting, for people.
std::string sweep_text(const std::vector<SettingResult>& results);

}  // namespace af::evaluation
