// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/field_parameter_tables.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "evaluate/outputs/sample_summary_json.h"
#include "files/output_file.h"
#include "text/csv_table.h"

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

std::vector<std::string> setting_fields(const PrecomputeOptions& setting) {
  return {std::to_string(setting.design().uv_nodes),
          std::to_string(setting.design().st_nodes),
          std::to_string(setting.design().codewords),
          number_text(training_share(setting)),
          std::to_string(setting.design().slabs)};
}

const std::vector<std::string>& setting_columns() {
  static const std::vector<std::string> columns = {
      "uv_nodes", "st_nodes", "codewords", "training_fraction", "slabs"};
  return columns;
}

std::vector<std::string> followed_by(std::vector<std::string> a,
                                     const std::vector<std::string>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

const std::vector<std::string>& measured_columns() {
  static const std::vector<std::string> columns = {"psnr_mean_db",
                                                   "psnr_median_db",
                                                   "psnr_q1_db",
                                                   "psnr_q3_db",
                                                   "psnr_p5_db",
                                                   "psnr_min_db",
                                                   "uncompressed_bytes",
                                                   "payload_bytes",
                                                   "file_bytes",
                                                   "payload_compression",
                                                   "file_compression",
                                                   "creation_ranks",
                                                   "creation_seconds"};
  return columns;
}

std::vector<std::string> measured_fields(const PooledSetting& pool) {
  const SampleSummary& psnr = pool.psnr_db;
  return {number_text(psnr.mean),
          number_text(psnr.median),
          number_text(psnr.lower_quartile),
          number_text(psnr.upper_quartile),
          number_text(psnr.percentile_5),
          number_text(psnr.minimum),
          number_text(pool.uncompressed_bytes),
          number_text(pool.payload_bytes),
          number_text(pool.file_bytes),
          number_text(pool.uncompressed_bytes / pool.payload_bytes),
          number_text(pool.uncompressed_bytes / pool.file_bytes),
          std::to_string(pool.creation_ranks),
          number_text(pool.creation_seconds)};
}

CsvTable settings_table(const std::vector<PooledSetting>& pools) {
  CsvTable table(followed_by(setting_columns(), measured_columns()));
  for (const PooledSetting& pool : pools)
    table.add_row(followed_by(setting_fields(pool.setting), measured_fields(pool)));
  return table;
}

CsvTable fields_table(const std::vector<SettingResult>& results) {
  CsvTable table(
      followed_by(followed_by({"case", "camera"}, setting_columns()), measured_columns()));
  for (const SettingResult& result : results)
    table.add_row(followed_by(followed_by({result.setting.case_name, result.setting.camera},
                                          setting_fields(result.setting)),
                              measured_fields(pooled({&result}))));
  return table;
}

CsvTable poses_table(const std::vector<SettingResult>& results) {
  CsvTable table(
      followed_by(followed_by({"case", "camera"}, setting_columns()), {"pose_index", "psnr_db"}));
  for (const SettingResult& result : results)
    for (std::size_t i = 0; i < result.comparisons.size(); ++i)
      table.add_row(followed_by(followed_by({result.setting.case_name, result.setting.camera},
                                            setting_fields(result.setting)),
                                {std::to_string(i), number_text(result.comparisons[i].psnr_db)}));
  return table;
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
