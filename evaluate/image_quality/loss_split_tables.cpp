// SPDX-License-Identifier: Apache-2.0
#include "evaluate/image_quality/loss_split_tables.h"

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "evaluate/report/sample_summary_json.h"
#include "files/csv_cells.h"
#include "files/output_file.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

constexpr std::array<const char*, LossSplit::kParts> kLabels = {
    "(u,v) alone", "(s,t) alone", "(u,v) and (s,t)", "quantisation", "field"};

CsvTable splits_table(const std::vector<LossSplit>& splits) {
  std::vector<CsvCells> rows;
  for (const LossSplit& split : splits) {
    CsvCells cells = {{"pose_index", rows.size()}};
    const auto psnr_db = split.psnr_db();
    for (std::size_t i = 0; i < LossSplit::kParts; ++i)
      cells.emplace_back(std::string(LossSplit::kNames[i]) + "_psnr_db", psnr_db[i]);
    rows.push_back(std::move(cells));
  }
  return csv_table(std::move(rows));
}

/// Mean over the poses that could be split.
double mean_of_part(const std::vector<LossSplit>& splits, std::size_t part) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const LossSplit& split : splits) {
    if (std::isnan(split.mean_square[part])) continue;
    sum += split.mean_square[part];
    ++count;
  }
  return sum / static_cast<double>(count);
}

}  // namespace

json write_loss_split(const std::vector<LossSplit>& splits, const std::filesystem::path& folder) {
  write_text_file(folder / "loss-split-poses.csv", splits_table(splits).to_text());
  json parts = json::array();
  for (std::size_t part = 0; part < LossSplit::kParts; ++part) {
    std::vector<double> values;
    for (const LossSplit& split : splits)
      if (const double value = split.psnr_db()[part]; !std::isnan(value)) values.push_back(value);
    parts.push_back(
        {{"name", LossSplit::kNames[part]},
         {"label", kLabels[part]},
         {"psnr_db", to_json(summarize(values))},
         {"share_of_total",
          number_json(mean_of_part(splits, part) / mean_of_part(splits, LossSplit::kParts - 1))}});
  }
  return {{"poses", splits.size()}, {"parts", parts}};
}

}  // namespace af::evaluation
