// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "evaluate/image_quality/loss_split.h"

namespace af::evaluation {

/// Writes loss-split-poses.csv and the figure loss-split. Returns the entry of summary.json: PSNR
/// of every part, and its share of the total mean square.
nlohmann::json write_loss_split(const std::vector<LossSplit>& splits,
                                const std::filesystem::path& folder);

}  // namespace af::evaluation
