// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/case_table.h"

#include <cstddef>
#include <string>
#include <vector>

#include "evaluate/report/sample_summary_json.h"
#include "files/csv_cells.h"

namespace af::evaluation {

using nlohmann::json;

CsvTable case_table(const json& renderers) {
  std::vector<CsvCells> rows;
  const auto add = [&](const json& renderer, const std::string& name, const json& part) {
    const json& successes = part.at("error_of_successes_mm");
    const auto of_all = [&](const char* error, const char* quantile) {
      return number_of(part.at(error + std::string("_of_all_mm")).at(quantile));
    };
    const json& range = part.at("capture_range");
    rows.push_back(
        {{"renderer", renderer.at("renderer").get<std::string>()},
         {"case", name},
         {"starts", part.at("starts").dump()},
         {"successes", part.at("successes").dump()},
         {"success_rate", number_of(part.at("rate"))},
         {"error", part.at("error").get<std::string>()},
         {"mean_error_of_successes_mm", number_of(successes.at("mean"))},
         {"sd_error_of_successes_mm", number_of(successes.at("sd"))},
         {"median_error_of_all_mm", of_all("error", "median")},
         {"p95_error_of_all_mm", of_all("error", "p95")},
         {"median_tre_of_all_mm", of_all("tre", "median")},
         {"p95_tre_of_all_mm", of_all("tre", "p95")},
         {"median_depth_of_all_mm", of_all("depth", "median")},
         {"p95_depth_of_all_mm", of_all("depth", "p95")},
         {"gross_failures", part.at("gross_failures").at("successes").dump()},
         {"capture_range_mm", range.is_object() ? number_of(range.at("initial_tre_mm")) : kNan},
         {"capture_range_ended_by",
          range.is_object() ? range.at("ended_by").get<std::string>() : ""}});
  };
  for (const json& renderer : renderers) {
    for (const json& entry : renderer.at("cases"))
      add(renderer, entry.at("case").get<std::string>(), entry);
    add(renderer, "all", renderer);
  }
  return csv_table(std::move(rows));
}

CsvTable drawn_starts_table(const json& cases, const json& renderers) {
  std::vector<CsvCells> rows;
  const json& intervals = renderers.at(0).at("intervals");
  for (const json& of_case : cases)
    for (std::size_t k = 0; k < intervals.size(); ++k) {
      const auto number = [&](const char* key) {
        const json& values = of_case.at(key);
        return k < values.size() ? number_of(values.at(k)) : kNan;
      };
      // Zeros for starts that were not drawn would say nothing.
      const bool is_drawn = !of_case.at("draws_per_interval").empty();
      rows.push_back(
          {{"case", of_case.at("case").get<std::string>()},
           {"low_mm", number_of(intervals.at(k).at("low_mm"))},
           {"high_mm", number_of(intervals.at(k).at("high_mm"))},
           {"draws", number("draws_per_interval")},
           {"refused_draws", is_drawn ? number("inadmissible_draws_per_interval") : kNan},
           {"rotation_share_of_starts", number("rotation_share_per_interval")}});
    }
  return csv_table(std::move(rows));
}

}  // namespace af::evaluation
