// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/field_parameter_tables.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "evaluate/report/sample_summary_json.h"
#include "files/csv_cells.h"
#include "files/output_file.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

/// One setting over all targets.
struct PooledSetting {
  PrecomputeOptions setting;
  SampleSummary psnr_db;
  double uncompressed_bytes = 0.0;
  double payload_bytes = 0.0;  ///< means over the fields
  double file_bytes = 0.0;
  double creation_seconds = 0.0;
  int creation_ranks = 0;  ///< 0: not all the same
  std::vector<const SettingResult*> fields;
};

std::vector<std::string> targets_of(const std::vector<SettingResult>& results) {
  std::vector<std::string> targets;
  for (const SettingResult& result : results)
    if (targets.empty() || targets.back() != result.target()) targets.push_back(result.target());
  return targets;
}

SampleSummary psnr_of(const std::vector<const SettingResult*>& fields) {
  std::vector<double> values;
  for (const SettingResult* field : fields)
    for (const DrrComparison& comparison : field->comparisons)
      if (!std::isnan(comparison.psnr_db)) values.push_back(comparison.psnr_db);
  return summarize(std::move(values));
}

PooledSetting pooled(const std::vector<const SettingResult*>& fields) {
  PooledSetting pool;
  pool.setting = fields.front()->setting;
  pool.fields = fields;
  pool.psnr_db = psnr_of(fields);
  pool.creation_ranks = fields.front()->creation_ranks;
  const auto count = static_cast<double>(fields.size());
  for (const SettingResult* field : fields) {
    pool.uncompressed_bytes += static_cast<double>(field->uncompressed_bytes) / count;
    pool.payload_bytes += static_cast<double>(field->info.payload_bytes) / count;
    pool.file_bytes += static_cast<double>(field->info.file_bytes) / count;
    pool.creation_seconds += field->creation_seconds / count;
    if (field->creation_ranks != pool.creation_ranks) pool.creation_ranks = 0;
  }
  return pool;
}

std::vector<PooledSetting> pooled_settings(const std::vector<SettingResult>& results) {
  const std::size_t settings = results.size() / targets_of(results).size();
  std::vector<PooledSetting> pools;
  for (std::size_t i = 0; i < settings; ++i) {
    std::vector<const SettingResult*> fields;
    for (std::size_t at = i; at < results.size(); at += settings) fields.push_back(&results[at]);
    pools.push_back(pooled(fields));
  }
  return pools;
}

CsvCells setting_cells(const PrecomputeOptions& setting) {
  return {{"uv_nodes", setting.design().uv_nodes},
          {"st_nodes", setting.design().st_nodes},
          {"codewords", setting.design().codewords},
          {"training_fraction", training_share(setting)},
          {"slabs", setting.design().slabs}};
}

CsvCells target_cells(const PrecomputeOptions& setting) {
  CsvCells cells = {{"case", setting.case_name}, {"camera", setting.camera}};
  append(setting_cells(setting), cells);
  return cells;
}

CsvCells measured_cells(const PooledSetting& pool) {
  const SampleSummary& psnr = pool.psnr_db;
  return {{"psnr_mean_db", psnr.mean},
          {"psnr_median_db", psnr.median},
          {"psnr_q1_db", psnr.lower_quartile},
          {"psnr_q3_db", psnr.upper_quartile},
          {"psnr_p5_db", psnr.percentile_5},
          {"psnr_min_db", psnr.minimum},
          {"uncompressed_bytes", pool.uncompressed_bytes},
          {"payload_bytes", pool.payload_bytes},
          {"file_bytes", pool.file_bytes},
          {"payload_compression", pool.uncompressed_bytes / pool.payload_bytes},
          {"file_compression", pool.uncompressed_bytes / pool.file_bytes},
          {"creation_ranks", pool.creation_ranks},
          {"creation_seconds", pool.creation_seconds}};
}

CsvTable settings_table(const std::vector<PooledSetting>& pools) {
  std::vector<CsvCells> rows;
  for (const PooledSetting& pool : pools) {
    rows.push_back(setting_cells(pool.setting));
    append(measured_cells(pool), rows.back());
  }
  return csv_table(std::move(rows));
}

CsvTable fields_table(const std::vector<SettingResult>& results) {
  std::vector<CsvCells> rows;
  for (const SettingResult& result : results) {
    rows.push_back(target_cells(result.setting));
    append(measured_cells(pooled({&result})), rows.back());
  }
  return csv_table(std::move(rows));
}

CsvTable poses_table(const std::vector<SettingResult>& results) {
  std::vector<CsvCells> rows;
  for (const SettingResult& result : results)
    for (std::size_t i = 0; i < result.comparisons.size(); ++i) {
      rows.push_back(target_cells(result.setting));
      append({{"pose_index", i}, {"psnr_db", result.comparisons[i].psnr_db}}, rows.back());
    }
  return csv_table(std::move(rows));
}

json pooled_json(const PooledSetting& pool) {
  json files = json::array();
  for (const SettingResult* field : pool.fields) files.push_back(field->setting.output);
  return {{"uv_nodes", pool.setting.design().uv_nodes},
          {"st_nodes", pool.setting.design().st_nodes},
          {"codewords", pool.setting.design().codewords},
          {"training_fraction", training_share(pool.setting)},
          {"field", pool.fields.front()->field},
          {"field_files", files},
          {"psnr_db", to_json(pool.psnr_db)},
          {"uncompressed_bytes", pool.uncompressed_bytes},
          {"payload_bytes", pool.payload_bytes},
          {"file_bytes", pool.file_bytes},
          {"creation_seconds", pool.creation_seconds},
          {"creation_ranks", pool.creation_ranks}};
}

}  // namespace

std::string SettingResult::target() const {
  return (setting.case_name.empty() ? "" : setting.case_name + " ") + setting.camera;
}

double training_share(const PrecomputeOptions& setting) {
  return setting.training_fraction.value();
}

std::uint64_t uncompressed_bytes_of(const PrecomputeOptions& setting) {
  const auto square = [](int nodes) {
    return static_cast<std::uint64_t>(nodes) * static_cast<std::uint64_t>(nodes);
  };
  return 2 * static_cast<std::uint64_t>(setting.design().slabs) *
         square(setting.design().uv_nodes) * square(setting.design().st_nodes);
}

void read_creation(SettingResult& result) {
  const json provenance = json::parse(result.info.provenance.provenance_json, nullptr, false);
  if (!provenance.is_object() || !provenance.contains("seconds")) return;
  for (const auto& [phase, seconds] : provenance.at("seconds").items())
    result.creation_seconds += seconds.get<double>();
  result.creation_ranks = provenance.value("rank_count", 0);
}

json write_sweep(const std::vector<SettingResult>& results, const std::filesystem::path& folder) {
  const std::vector<PooledSetting> pools = pooled_settings(results);
  write_text_file(folder / "field-parameters.csv", settings_table(pools).to_text());
  write_text_file(folder / "field-parameters-fields.csv", fields_table(results).to_text());
  write_text_file(folder / "field-parameters-poses.csv", poses_table(results).to_text());
  std::string targets;
  for (const std::string& target : targets_of(results))
    targets += (targets.empty() ? "" : ", ") + target;
  json summary = {{"camera", targets},
                  {"poses", pools.front().psnr_db.count},
                  {"figures", {"field-parameters"}},
                  {"settings", json::array()}};
  for (const PooledSetting& pool : pools) summary["settings"].push_back(pooled_json(pool));
  return summary;
}

std::string sweep_text(const std::vector<SettingResult>& results) {
  constexpr double kBytesPerMb = 1e6;
  std::string text;
  for (const PooledSetting& pool : pooled_settings(results))
    text += "uv " + std::to_string(pool.setting.design().uv_nodes) + ", st " +
            std::to_string(pool.setting.design().st_nodes) + ", " +
            std::to_string(pool.setting.design().codewords) + " codewords, training " +
            number_text(training_share(pool.setting)) + ": PSNR median " +
            fixed_text(pool.psnr_db.median, 2) + " dB, " +
            fixed_text(pool.payload_bytes / kBytesPerMb, 1) + " MB, compression " +
            fixed_text(pool.uncompressed_bytes / pool.payload_bytes, 1) + ", " +
            fixed_text(pool.creation_seconds, 1) + " s\n";
  return text;
}

}  // namespace af::evaluation
