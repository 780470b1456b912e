// SPDX-License-Identifier: Apache-2.0
#include "evaluate/outputs/failed_start.h"

#include <filesystem>

#include "files/output_file.h"
#include "text/shell_words.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

std::string start_name(const std::string& case_name,
                       const std::string& renderer,
                       std::int64_t start_index) {
  return file_name_part(case_name) + "-" + file_name_part(renderer) + "-" +
         std::to_string(start_index);
}

}  // namespace

std::string trace_file(const std::string& case_name,
                       const std::string& renderer,
                       std::int64_t start_index) {
  return "traces/" + start_name(case_name, renderer, start_index) + ".csv";
}

std::string repeat_command(const json& summary,
                           const std::string& case_name,
                           const std::string& renderer,
                           std::int64_t start_index) {
  const json repeat = summary.value("repeat", json());
  if (!repeat.is_object()) return "";
  // Ray casting beside fields has the blur of their levels, so it is repeated beside them.
  const bool is_beside_fields = renderer == "raycast" && repeat.at("renderer") == "both";
  const std::filesystem::path output =
      std::filesystem::path(repeat.at("output").get<std::string>()) /
      start_name(case_name, renderer, start_index);
  return repeat.at("command").get<std::string>() + " --case " + shell_quoted(case_name) +
         " --renderer " + (is_beside_fields ? "both" : shell_quoted(renderer)) + " --only-start " +
         std::to_string(start_index) + " --output " + shell_quoted(output.string());
}

}  // namespace af::evaluation
