// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/case_table.h"

#include <cstddef>
#include <string>
#include <vector>

#include "evaluate/outputs/sample_summary_json.h"

namespace af::evaluation {

using nlohmann::json;

CsvTable case_table(const json& renderers) {
  CsvTable table({"renderer",
                  "case",
                  "starts",
                  "successes",
                  "success_rate",
                  "mean_tre_of_successes_mm",
                  "sd_tre_of_successes_mm",
                  "median_tre_of_all_mm",
                  "p95_tre_of_all_mm",
                  "gross_failures",
                  "mrpd_successes",
                  "capture_range_mm",
                  "capture_range_ended_by"});
  const auto add = [&](const std::string& renderer, const std::string& name, const json& part) {
    const json& successes = part.at("tre_of_successes_mm");
    const json& all = part.at("tre_of_all_mm");
    const json& range = part.at("capture_range");
    table.add_row({renderer,
                   name,
                   part.at("starts").dump(),
                   part.at("successes").dump(),
                   number_text(number_of(part.at("rate"))),
                   number_text(number_of(successes.at("mean"))),
                   number_text(number_of(successes.at("sd"))),
                   number_text(number_of(all.at("median"))),
                   number_text(number_of(all.at("p95"))),
                   part.at("gross_failures").at("successes").dump(),
                   part.at("mrpd_success").at("successes").dump(),
                   range.is_object() ? number_text(number_of(range.at("initial_tre_mm"))) : "nan",
                   range.is_object() ? range.at("ended_by").get<std::string>() : ""});
  };
  for (const json& renderer : renderers) {
    const auto name = renderer.at("renderer").get<std::string>();
    for (const json& entry : renderer.at("cases"))
      add(name, entry.at("case").get<std::string>(), entry);
    add(name, "all", renderer);
  }
  return table;
}

CsvTable drawn_starts_table(const json& cases, const json& renderers) {
  CsvTable table(
      {"case", "low_mm", "high_mm", "draws", "refused_draws", "rotation_share_of_starts"});
  const json& intervals = renderers.at(0).at("intervals");
  for (const json& of_case : cases)
    for (std::size_t k = 0; k < intervals.size(); ++k) {
      const auto number = [&](const char* key) {
        const json& values = of_case.at(key);
        return k < values.size() && values.at(k).is_number()
                   ? number_text(values.at(k).get<double>())
                   : std::string("nan");
      };
      table.add_row({of_case.at("case").get<std::string>(),
                     number_text(number_of(intervals.at(k).at("low_mm"))),
                     number_text(number_of(intervals.at(k).at("high_mm"))),
                     number("draws_per_interval"),
                     // Zeros of starts that were not drawn say nothing.
                     of_case.at("draws_per_interval").empty()
                         ? "nan"
                         : number("inadmissible_draws_per_interval"),
                     number("rotation_share_per_interval")});
    }
  return table;
}

}  // namespace af::evaluation
