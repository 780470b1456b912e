// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <tuple>
#include <vector>

#include "evaluate/sweeps/field_parameter_tables.h"
#include "ranks/communicator.h"

namespace af::evaluation {

/// One DRR of a sweep: which field, and which of its poses.
struct SweepDrr {
  std::size_t result = 0;
  std::size_t pose = 0;

  auto members() { return std::tie(result, pose); }
  bool operator==(const SweepDrr&) const = default;
};

/// For each PSNR level, the setting nearest to it. All belong to one target and pose: those with
/// the least sum of distances from the levels. Empty when nothing could be compared.
/// \test DifferenceImages.AreThoseNearestToTheLevelsAtOnePose
std::vector<SweepDrr> drrs_at_levels(const std::vector<SettingResult>& results,
                                     const std::vector<double>& levels_db);

/// Collective. The paper's Fig. 9: difference images, field - ray casting, of DRRs of about 36, 40
/// and 44 dB at one pose, from fields of different settings, with one common window. Writes
/// difference-images.png and .csv. Returns the entry of summary.json; null when nothing could be
/// compared.
nlohmann::json write_difference_images(const std::vector<SettingResult>& results,
                                       double drr_step_mm,
                                       const std::filesystem::path& folder,
                                       const Communicator& world);

}  // namespace af::evaluation
