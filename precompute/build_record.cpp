// SPDX-License-Identifier: Apache-2.0
#include "precompute/build_record.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

#include "precompute/formatted_text.h"

namespace af {

namespace {

using nlohmann::json;

/// Root mean square error of one element, total attenuation.
double rms_attenuation(double squared_error, std::uint64_t tiles, float step) {
  if (tiles == 0) return 0.0;
  const double elements = static_cast<double>(tiles) * static_cast<double>(kTileElements);
  return static_cast<double>(step) * std::sqrt(squared_error / elements);
}

json training_json(const TrainedCodebook& trained) {
  json iterations = json::array();
  for (const TrainingIteration& iteration : trained.iterations)
    iterations.push_back({{"training_squared_error", iteration.training_squared_error},
                          {"held_out_squared_error", iteration.held_out_squared_error},
                          {"codewords_repaired", iteration.codewords_repaired}});
  return {{"training_tiles", trained.training_tiles},
          {"held_out_tiles", trained.held_out_tiles},
          {"stop", to_string(trained.stop)},
          {"iterations", iterations}};
}

json forecast_json(const DesignForecast& forecast) {
  return {{"design", to_text(forecast.design)},
          {"psnr_db", forecast.psnr_db},
          {"interpolation_db", forecast.interpolation_db},
          {"quantisation_db", forecast.quantisation_db},
          {"file_bytes", forecast.file_bytes},
          {"drr_ms", forecast.drr_ms}};
}

json design_json(const DesignChoice& choice) {
  json measured = json::array();
  for (const DesignForecast& forecast : choice.chosen.measured)
    measured.push_back(forecast_json(forecast));
  return {{"asked", choice.asked},
          {"chosen", forecast_json(choice.chosen.forecast)},
          {"measured", measured}};
}

std::string training_text(const TrainedCodebook& trained, float step) {
  std::ostringstream text;
  text << "codebook: " << trained.codebook.size() << " codewords from " << trained.training_tiles
       << " tiles, " << trained.iterations.size() << " iterations (" << to_string(trained.stop)
       << ")\n  rms error of training / unseen tiles per iteration:";
  text.precision(4);
  for (const TrainingIteration& iteration : trained.iterations)
    text << "  "
         << rms_attenuation(
                static_cast<double>(iteration.training_squared_error), trained.training_tiles, step)
         << " / "
         << rms_attenuation(static_cast<double>(iteration.held_out_squared_error),
                            trained.held_out_tiles,
                            step);
  return text.str();
}

json filter_json(const FittedFilter& fitted, float step) {
  return {{"tiles", fitted.tiles},
          {"rms_attenuation_error", rms_attenuation(fitted.squared_error, fitted.tiles, step)},
          {"rms_attenuation_error_filtered",
           rms_attenuation(fitted.squared_error_left, fitted.tiles, step)}};
}

std::string filter_text(const FittedFilter& fitted, float step) {
  if (!fitted.filter) return "";
  std::ostringstream text;
  text.precision(3);
  text << "\ntile filter: rms error " << rms_attenuation(fitted.squared_error, fitted.tiles, step)
       << " becomes " << rms_attenuation(fitted.squared_error_left, fitted.tiles, step)
       << ", as fitted to " << fitted.tiles << " tiles";
  return text.str();
}

/// Mean divided by largest. It is 1 when all ranks worked equally long.
double balance_of(const std::vector<double>& seconds) {
  const double largest = *std::max_element(seconds.begin(), seconds.end());
  if (!(largest > 0.0)) return 1.0;
  return std::accumulate(seconds.begin(), seconds.end(), 0.0) /
         (largest * static_cast<double>(seconds.size()));
}

}  // namespace

double BuildRecord::rms_error() const {
  return rms_attenuation(static_cast<double>(squared_error), cast.occupied_tiles, step);
}

void add_record(const BuildRecord& record, json& provenance) {
  provenance["training"] = training_json(record.trained.training);
  if (record.trained.fitted.filter)
    provenance["tile_filter"] = filter_json(record.trained.fitted, record.step);
  if (record.design) provenance["design"] = design_json(*record.design);
  provenance["occupied_tiles"] = record.cast.occupied_tiles;
  provenance["rms_attenuation_error"] = record.rms_error();
  provenance["rays_cast"] = record.cast.rays_cast;
  provenance["units_resumed"] = record.cast.units_resumed;
  provenance["training_iterations_resumed"] = record.trained.iterations_resumed;
  provenance["units_encoded_before"] = record.units_encoded_before;
  provenance["units_kept_in_memory"] = record.cast.units_kept;
  provenance["busy_seconds"] = {{"cast", record.cast.busy_seconds},
                                {"encode", record.encode_seconds}};
  provenance["peak_bytes"] = {{"per_rank", record.peak_bytes_per_rank},
                              {"ct_and_grid_per_node", record.volume_bytes}};
  for (const auto& [phase, seconds] : record.clock.phases()) provenance["seconds"][phase] = seconds;
}

std::string record_text(const BuildRecord& record,
                        const FieldFileInfo& info,
                        std::int64_t stored_nodes) {
  const auto rate =
      static_cast<double>(record.cast.rays_cast) / record.clock.seconds_of("cast") / 1e6;
  const auto raw_bytes = static_cast<double>(2 * stored_nodes);
  std::ostringstream text;
  text.precision(3);
  text << training_text(record.trained.training, record.step)
       << filter_text(record.trained.fitted, record.step)
       << "\nwhole field: " << static_cast<double>(record.cast.occupied_tiles) / 1e6
       << " million tiles not empty, rms error " << record.rms_error() << " (total attenuation"
       << (record.trained.fitted.filter ? ", before the filter" : "")
       << ")\nseconds: " << seconds_text(record.clock.phases()) << "; cast " << rate
       << " million rays/s on " << record.encode_seconds.size()
       << " ranks\nbalance (mean / slowest rank): cast " << balance_of(record.cast.busy_seconds)
       << ", encode " << balance_of(record.encode_seconds) << "; peak memory "
       << megabytes_text(record.peak_bytes_per_rank) << " of one rank beside "
       << megabytes_text(record.volume_bytes)
       << " per node for the CT\nratio of 16-bit samples stored: payload 1 : "
       << raw_bytes / static_cast<double>(info.payload_bytes)
       << ", file 1 : " << raw_bytes / static_cast<double>(info.file_bytes);
  return text.str();
}

}  // namespace af
