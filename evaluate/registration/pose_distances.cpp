// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/pose_distances.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "evaluate/statistics/patient_names.h"
#include "geometry/rigid_transform.h"
#include "gold_standard/target_box.h"
#include "gold_standard/tre.h"
#include "pose_files/pose_file.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

/// What the poses of a case's rows are relative to, and what moves with them.
struct CaseTarget {
  PoseFrame gold_frame;
  std::vector<Eigen::Vector3d> points_ct_mm;
};

struct EndPose {
  RigidTransform start_room_from_ct;
  RigidTransform room_from_ct;
};

/// Starts that one run drew and another read from its starts.csv differ by rounding, which stays
/// far below this; starts that were drawn apart are further from each other.
constexpr double kSameStartMm = 1e-6;

/// The registrations of one case by one renderer of a run.
struct MethodEnds {
  std::string run, renderer, case_name;
  std::vector<Eigen::Vector3d> points_ct_mm;
  std::map<std::int64_t, EndPose> ends;  ///< by start index; those with a pose
};

Eigen::Vector3d point_of(const json& values) {
  return {values.at(0).get<double>(), values.at(1).get<double>(), values.at(2).get<double>()};
}

CaseTarget target_of(const json& of_case) {
  const RigidTransform gold = pose_of_rows(of_case.at("gold_room_from_ct"), "gold_room_from_ct");
  const json& box = of_case.at("target_box_ct_mm");
  return {PoseFrame::about(gold, point_of(of_case.at("center_ct_mm"))),
          target_points({point_of(box.at(0)), point_of(box.at(1))})};
}

std::map<std::string, CaseTarget> targets_of(const EvaluationRun& run) {
  const auto unusable = [&] {
    return FileError(
        (run.folder / "summary.json").string(),
        "cases",
        "gold_room_from_ct, center_ct_mm and target_box_ct_mm of every case",
        "a run without them (of an earlier version, or damaged); --pose-distances needs them");
  };
  std::map<std::string, CaseTarget> targets;
  try {
    for (const json& of_case : run.summary.at("cases"))
      targets[of_case.at("case").get<std::string>()] = target_of(of_case);
  } catch (const json::exception&) {
    throw unusable();
  } catch (const InputError&) {
    throw unusable();
  }
  return targets;
}

RigidTransform pose_of(const CsvTable& table,
                       std::size_t row,
                       const char* prefix,
                       const PoseFrame& frame) {
  std::array<double, 6> values{};
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = table.number_or_nan(row, std::string(prefix) + kParameterNames[i]);
  return pose_from_parameters(frame, PoseParameters::from_deg_and_mm(values));
}

std::vector<MethodEnds> ends_of(const EvaluationRun& run) {
  const std::map<std::string, CaseTarget> targets = targets_of(run);
  std::map<std::pair<std::string, std::string>, MethodEnds> methods;
  run.read_registrations([&](const CsvTable& table) {
    for (std::size_t row = 0; row < table.row_count(); ++row) {
      const std::string& name = table.text(row, "case");
      const auto target = targets.find(name);
      if (target == targets.end())
        throw FileError((run.folder / "summary.json").string(),
                        "cases",
                        "the case '" + name + "' of registrations.csv",
                        "none of this name");
      const std::string& renderer = table.text(row, "renderer");
      MethodEnds& method = methods[{name, renderer}];
      if (method.run.empty())
        method = {run.folder.filename().string(), renderer, name, target->second.points_ct_mm, {}};
      const PoseFrame& frame = target->second.gold_frame;
      const RigidTransform pose = pose_of(table, row, "final_", frame);
      if (pose.matrix().allFinite())
        method.ends[static_cast<std::int64_t>(table.number(row, "start_index"))] = {
            pose_of(table, row, "start_", frame), pose};
    }
  });
  std::vector<MethodEnds> all;
  all.reserve(methods.size());
  for (auto& [key, method] : methods) all.push_back(std::move(method));
  return all;
}

struct Distances {
  std::vector<double> mm, deg;
};

/// Of starts that both have.
Distances distances_of(const MethodEnds& a, const MethodEnds& b) {
  Distances distances;
  for (const auto& [index, end] : a.ends) {
    const auto other = b.ends.find(index);
    if (other == b.ends.end()) continue;
    const EndPose& its = other->second;
    if (mean_tre_mm(end.start_room_from_ct, its.start_room_from_ct, a.points_ct_mm) >= kSameStartMm)
      continue;
    distances.mm.push_back(mean_tre_mm(end.room_from_ct, its.room_from_ct, a.points_ct_mm));
    distances.deg.push_back(kDegPerRad *
                            rotation_angle_between_rad(end.room_from_ct, its.room_from_ct));
  }
  return distances;
}

std::string claim_of(const CaseEquivalence& found) {
  if (!found.has_enough_cases()) return "too few patients";
  return found.is_shown() ? "yes" : "not shown";
}

}  // namespace

std::vector<PoseDistanceRow> pose_distances(const std::vector<EvaluationRun>& runs) {
  std::vector<MethodEnds> methods;
  for (const EvaluationRun& run : runs)
    for (MethodEnds& method : ends_of(run)) methods.push_back(std::move(method));
  std::vector<PoseDistanceRow> rows;
  for (std::size_t i = 0; i < methods.size(); ++i)
    for (std::size_t k = i + 1; k < methods.size(); ++k) {
      const MethodEnds& a = methods[i];
      const MethodEnds& b = methods[k];
      if (a.case_name != b.case_name) continue;
      const Distances distances = distances_of(a, b);
      if (!distances.mm.empty())
        rows.push_back({a.case_name,
                        a.run,
                        a.renderer,
                        b.run,
                        b.renderer,
                        summarize(distances.mm),
                        summarize(distances.deg)});
    }
  return rows;
}

CsvTable pose_distances_table(const std::vector<PoseDistanceRow>& rows) {
  CsvTable table({"case",
                  "run_a",
                  "renderer_a",
                  "run_b",
                  "renderer_b",
                  "starts",
                  "mean_distance_mm",
                  "median_distance_mm",
                  "p95_distance_mm",
                  "max_distance_mm",
                  "mean_rotation_deg",
                  "median_rotation_deg",
                  "p95_rotation_deg",
                  "max_rotation_deg"});
  for (const PoseDistanceRow& row : rows)
    table.add_row({row.case_name,
                   row.run_a,
                   row.renderer_a,
                   row.run_b,
                   row.renderer_b,
                   std::to_string(row.distance_mm.count),
                   number_text(row.distance_mm.mean),
                   number_text(row.distance_mm.median),
                   number_text(row.distance_mm.percentile_95),
                   number_text(row.distance_mm.maximum),
                   number_text(row.rotation_deg.mean),
                   number_text(row.rotation_deg.median),
                   number_text(row.rotation_deg.percentile_95),
                   number_text(row.rotation_deg.maximum)});
  return table;
}

std::vector<PatientDistances> distances_over_patients(const std::vector<PoseDistanceRow>& rows,
                                                      double margin_mm) {
  std::vector<PatientDistances> methods;
  // By patient: who may have several poses, and each of these several rows, as runs of one name and
  // both orders of two methods do.
  std::vector<std::map<std::string, std::vector<double>>> means_mm;
  for (const PoseDistanceRow& row : rows) {
    const auto is_same = [&](const PatientDistances& other) {
      return other.run_a == row.run_a && other.renderer_a == row.renderer_a &&
             other.run_b == row.run_b && other.renderer_b == row.renderer_b;
    };
    auto method = std::find_if(methods.begin(), methods.end(), is_same);
    if (method == methods.end()) {
      methods.push_back({row.run_a, row.renderer_a, row.run_b, row.renderer_b, 0, {}});
      means_mm.emplace_back();
      method = methods.end() - 1;
    }
    method->starts += row.distance_mm.count;
    means_mm[static_cast<std::size_t>(method - methods.begin())][patient_of_case(row.case_name)]
        .push_back(row.distance_mm.mean);
  }
  constexpr std::uint64_t kSeed = 1;
  for (std::size_t i = 0; i < methods.size(); ++i) {
    std::vector<double> of_patients_mm;
    for (const auto& [name, means] : means_mm[i]) of_patients_mm.push_back(summarize(means).mean);
    methods[i].equivalence = equivalence_over_cases(of_patients_mm, margin_mm, kSeed);
  }
  return methods;
}

CsvTable patient_distances_table(const std::vector<PatientDistances>& methods) {
  CsvTable table({"run_a",
                  "renderer_a",
                  "run_b",
                  "renderer_b",
                  "patients",
                  "starts",
                  "mean_distance_mm",
                  "bootstrap_low_mm",
                  "bootstrap_high_mm",
                  "student_low_mm",
                  "student_high_mm",
                  "margin_mm",
                  "p",
                  "claim"});
  for (const PatientDistances& method : methods) {
    const CaseEquivalence& found = method.equivalence;
    table.add_row({method.run_a,
                   method.renderer_a,
                   method.run_b,
                   method.renderer_b,
                   std::to_string(found.cases),
                   std::to_string(method.starts),
                   number_text(found.mean),
                   number_text(found.bootstrap.low),
                   number_text(found.bootstrap.high),
                   number_text(found.student.low),
                   number_text(found.student.high),
                   number_text(found.margin),
                   number_text(found.p),
                   claim_of(found)});
  }
  return table;
}

}  // namespace af::evaluation
