// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/failure_traces.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "files/csv_cells.h"
#include "files/output_file.h"
#include "geometry/tre.h"

namespace af::evaluation {

std::vector<TracePoint> trace_points(const std::vector<registration::TraceRow>& trace,
                                     const PoseFrame& frame,
                                     const Yardstick& yardstick) {
  std::vector<TracePoint> points;
  const std::size_t count = std::min(trace.size(), kMostTracePoints);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t last = std::max<std::size_t>(count, 2) - 1;
    const registration::TraceRow& row = trace[i * (trace.size() - 1) / last];
    const RigidTransform pose = pose_from_parameters(frame, row.parameters);
    points.push_back({row.pass + 1,
                      row.step_mm,
                      row.evaluations,
                      row.similarity,
                      parameters_from_pose(yardstick.gold_frame, pose).deg_and_mm(),
                      mean_tre_mm(pose, yardstick.gold_room_from_ct, yardstick.points_ct_mm)});
  }
  return points;
}

void keep_if_first(std::int64_t start_index, std::vector<TracePoint> trace, FirstTraces& kept) {
  if (trace.empty()) return;
  kept[start_index] = std::move(trace);
  if (kept.size() > kMostTraces) kept.erase(std::prev(kept.end()));
}

std::string trace_file(const std::string& case_name,
                       const std::string& renderer,
                       std::int64_t start_index) {
  return "traces/" + file_name_part(case_name) + "-" + file_name_part(renderer) + "-" +
         std::to_string(start_index) + ".csv";
}

CsvTable trace_table(const std::vector<TracePoint>& trace) {
  return csv_table(trace, [](const TracePoint& point) {
    CsvCells cells = {{"stage", point.stage},
                      {"step_mm", point.step_mm},
                      {"poses_tried", point.poses_tried},
                      {"similarity", point.similarity}};
    append("", kParameterNames, point.deg_mm, cells);
    cells.emplace_back("tre_mm", point.tre_mm);
    return cells;
  });
}

}  // namespace af::evaluation
