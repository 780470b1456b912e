// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/finished_rows.h"

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/error.h"
#include "study/pose_file.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

Eigen::Vector3d point_of(const json& values) {
  return {values.at(0).get<double>(), values.at(1).get<double>(), values.at(2).get<double>()};
}

FinishedCase case_of_summary(const json& of_case) {
  const RigidTransform gold = pose_of_rows(of_case.at("gold_room_from_ct"), "gold_room_from_ct");
  const json& box = of_case.at("target_box_ct_mm");
  return {PoseFrame::about(gold, point_of(of_case.at("center_ct_mm"))),
          {point_of(box.at(0)), point_of(box.at(1))},
          of_case.at("views").get<int>() == 1};
}

std::array<double, 6> parameters_of(const CsvTable& table,
                                    std::size_t row,
                                    const std::string& prefix) {
  std::array<double, 6> values{};
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = table.number_or_nan(row, prefix + kParameterNames[i]);
  return values;
}

RegistrationRow row_of(const CsvTable& table, std::size_t at, const RunFacts& facts) {
  RegistrationRow row;
  row.case_name = table.text(at, "case");
  row.has_one_view = facts.case_of(row).has_one_view;
  row.renderer = table.text(at, "renderer");
  row.start_index = static_cast<std::int64_t>(table.number(at, "start_index"));
  row.start_deg_mm = parameters_of(table, at, "start_");
  row.final_deg_mm = parameters_of(table, at, "final_");
  row.initial_tre_mm = table.number(at, "initial_tre_mm");
  row.tre_mm = table.number_or_nan(at, "tre_mm");
  row.errors.mrpd_mm = table.number_or_nan(at, "mrpd_mm");
  if (row.has_one_view) row.errors.depth_mm = table.number_or_nan(at, "depth_mm");
  row.errors.rotation_deg = table.number_or_nan(at, "rotation_error_deg");
  row.drr_count = static_cast<std::int64_t>(table.number(at, "drr_count"));
  row.seconds = table.number_or_nan(at, "seconds");
  return row;
}

}  // namespace

const FinishedCase& RunFacts::case_of(const RegistrationRow& row) const {
  const auto found = cases.find(row.case_name);
  if (found == cases.end())
    throw FileError(summary_path,
                    "cases",
                    "the case '" + row.case_name + "' of registrations.csv",
                    "none of this name");
  return found->second;
}

RunFacts facts_of(const EvaluationRun& run) {
  RunFacts facts;
  facts.summary_path = (run.folder / "summary.json").string();
  const auto unusable = [&] {
    return FileError(
        facts.summary_path,
        "success_tre_mm, cases",
        "a number; gold_room_from_ct, center_ct_mm, target_box_ct_mm and views of every case",
        "something else");
  };
  try {
    facts.success_tre_mm = run.summary.at("success_tre_mm").get<double>();
    for (const json& of_case : run.summary.at("cases"))
      facts.cases[of_case.at("case").get<std::string>()] = case_of_summary(of_case);
  } catch (const json::exception&) {
    throw unusable();
  } catch (const InputError&) {
    throw unusable();
  }
  return facts;
}

void read_rows(const EvaluationRun& run,
               const RunFacts& facts,
               const std::function<void(const RegistrationRow& row)>& receive) {
  run.read_registrations([&](const CsvTable& part) {
    for (std::size_t i = 0; i < part.row_count(); ++i) receive(row_of(part, i, facts));
  });
}

}  // namespace af::evaluation
