// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/pose_distances.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "evaluate/registration/finished_rows.h"
#include "evaluate/statistics/patient_names.h"
#include "files/csv_cells.h"
#include "geometry/rigid_transform.h"
#include "geometry/target_box.h"
#include "geometry/tre.h"

namespace af::evaluation {
namespace {

struct EndPose {
  RigidTransform start_room_from_ct;
  RigidTransform room_from_ct;
};

/// When one run draws starts and another reads them from its starts.csv, they differ by rounding,
/// which stays far below this. Starts that were drawn separately differ by more.
constexpr double kSameStartMm = 1e-6;

/// SHA-256 of a case's X-rays by camera. None where the run does not state them.
using XrayHashes = std::map<std::string, nlohmann::json>;

/// The registrations of one case by one renderer of a run.
struct MethodEnds {
  std::string run, renderer, case_name;
  XrayHashes xrays;
  std::vector<Eigen::Vector3d> points_ct_mm;
  std::map<std::int64_t, EndPose> ends;  ///< by start index; only those with a pose
};

XrayHashes xrays_of(const EvaluationRun& run, const std::string& case_name) {
  static const nlohmann::json::json_pointer inputs("/provenance/input_sha256");
  XrayHashes hashes;
  if (!run.summary.contains(inputs)) return hashes;
  const std::string prefix = case_name + ": xray ";
  for (const auto& [name, hash] : run.summary.at(inputs).items())
    if (name.starts_with(prefix)) hashes[name.substr(prefix.size())] = hash;
  return hashes;
}

/// Throws InputError when the ends to compare were found in different X-rays.
void require_same_xrays(const MethodEnds& a, const MethodEnds& b) {
  if (a.xrays.empty() || b.xrays.empty()) return;
  for (const auto& [of, other] : {std::pair(&a, &b), std::pair(&b, &a)})
    for (const auto& [camera, hash] : of->xrays)
      if (const auto its = other->xrays.find(camera);
          its == other->xrays.end() || its->second != hash)
        throw InputError("--pose-distances",
                         a.run + " and " + b.run,
                         "must be of the same X-rays: those of case " + a.case_name + ", view " +
                             camera + ", differ");
}

std::vector<MethodEnds> ends_of(const EvaluationRun& run) {
  const RunFacts facts = facts_of(run);
  std::map<std::pair<std::string, std::string>, MethodEnds> methods;
  read_rows(run, facts, [&](const RegistrationRow& row) {
    const FinishedCase& of_case = facts.case_of(row);
    MethodEnds& method = methods[{row.case_name, row.renderer}];
    if (method.run.empty())
      method = {run.folder.filename().string(),
                row.renderer,
                row.case_name,
                xrays_of(run, row.case_name),
                target_points(of_case.target_box_ct),
                {}};
    const auto pose_of = [&](const std::array<double, 6>& deg_mm) {
      return pose_from_parameters(of_case.gold_frame, PoseParameters::from_deg_and_mm(deg_mm));
    };
    const RigidTransform pose = pose_of(row.final_deg_mm);
    if (pose.matrix().allFinite()) method.ends[row.start_index] = {pose_of(row.start_deg_mm), pose};
  });
  std::vector<MethodEnds> all;
  all.reserve(methods.size());
  for (auto& [key, method] : methods) all.push_back(std::move(method));
  return all;
}

struct Distances {
  std::vector<double> mm, deg;
};

/// Distances for starts that both have.
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
      if (distances.mm.empty()) continue;
      require_same_xrays(a, b);
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
  return csv_table(rows, [](const PoseDistanceRow& row) -> CsvCells {
    return {{"case", row.case_name},
            {"run_a", row.run_a},
            {"renderer_a", row.renderer_a},
            {"run_b", row.run_b},
            {"renderer_b", row.renderer_b},
            {"starts", row.distance_mm.count},
            {"mean_distance_mm", row.distance_mm.mean},
            {"median_distance_mm", row.distance_mm.median},
            {"p95_distance_mm", row.distance_mm.percentile_95},
            {"max_distance_mm", row.distance_mm.maximum},
            {"mean_rotation_deg", row.rotation_deg.mean},
            {"median_rotation_deg", row.rotation_deg.median},
            {"p95_rotation_deg", row.rotation_deg.percentile_95},
            {"max_rotation_deg", row.rotation_deg.maximum}};
  });
}

std::vector<PatientDistances> distances_over_patients(const std::vector<PoseDistanceRow>& rows,
                                                      double margin_mm) {
  std::vector<PatientDistances> methods;
  // Grouped by patient: a patient may have several poses, and each of these several rows, as for
  // runs with the same name, or for two methods in both orders.
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
  return csv_table(methods, [](const PatientDistances& method) -> CsvCells {
    const CaseEquivalence& found = method.equivalence;
    return {{"run_a", method.run_a},
            {"renderer_a", method.renderer_a},
            {"run_b", method.run_b},
            {"renderer_b", method.renderer_b},
            {"patients", found.cases},
            {"starts", method.starts},
            {"mean_distance_mm", found.mean},
            {"bootstrap_low_mm", found.bootstrap.low},
            {"bootstrap_high_mm", found.bootstrap.high},
            {"student_low_mm", found.student.low},
            {"student_high_mm", found.student.high},
            {"margin_mm", found.margin},
            {"p",
             found.has_enough_cases()
                 ? number_text(found.p)
                 : "fewer than " + std::to_string(kEnoughCasesForEquivalence) + " patients"},
            {"claim", claim_of(found)}};
  });
}

}  // namespace af::evaluation
