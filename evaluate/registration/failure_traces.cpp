// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/failure_traces.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>

#include "gold_standard/tre.h"

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

CsvTable trace_table(const std::vector<TracePoint>& trace) {
  std::vector<std::string> columns = {"stage", "step_mm", "poses_tried", "similarity"};
  for (const char axis : {'x', 'y', 'z'}) columns.push_back(std::string("r") + axis + "_deg");
  for (const char axis : {'x', 'y', 'z'}) columns.push_back(std::string("t") + axis + "_mm");
  columns.emplace_back("tre_mm");
  CsvTable table(std::move(columns));
  for (const TracePoint& point : trace) {
    std::vector<std::string> fields = {std::to_string(point.stage),
                                       number_text(point.step_mm),
                                       std::to_string(point.poses_tried),
                                       number_text(point.similarity)};
    for (const double value : point.deg_mm) fields.push_back(number_text(value));
    fields.push_back(number_text(point.tre_mm));
    table.add_row(std::move(fields));
  }
  return table;
}

}  // namespace af::evaluation
