// SPDX-License-Identifier: Apache-2.0
#include "evaluate/image_quality/loss_split_tables.h"

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "evaluate/outputs/sample_summary_json.h"
#include "files/output_file.h"
#include "text/csv_table.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

constexpr std::array<const char*, LossSplit::kParts> kLabels = {
    "(u,v) alone", "(s,t) alone", "(u,v) and (s,t)", "quantisation", "field"};

CsvTable splits_table(const std::vector<LossSplit>& splits) {
  std::vector<std::string> columns = {"pose_index"};
  for (const char* name : LossSplit::kNames) columns.push_back(std::string(name) + "_psnr_db");
  CsvTable table(std::move(columns));
  for (std::size_t i = 0; i < splits.size(); ++i) {
    std::vector<std::string> fields = {std::to_string(i)};
    for (const double value : splits[i].psnr_db()) fields.push_back(number_text(value));
    table.add_row(std::move(fields));
  }
  return table;
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
