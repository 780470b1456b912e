// SPDX-License-Identifier: Apache-2.0
#include "evaluate/image_quality/image_quality_tables.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "evaluate/report/sample_summary_json.h"
#include "evaluate/statistics/statistics.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

constexpr double kGoodPsnrDb = 40.0;  // the paper: almost all above
constexpr double kPoorPsnrDb = 36.0;  // the paper: very few below

/// PSNR of the comparisons that were possible.
std::vector<double> psnr_values(const std::vector<DrrComparison>& comparisons) {
  std::vector<double> values;
  for (const DrrComparison& comparison : comparisons)
    if (!std::isnan(comparison.psnr_db)) values.push_back(comparison.psnr_db);
  return values;
}

template <typename Value>
json summary_of(const std::vector<DrrComparison>& comparisons, Value value) {
  std::vector<double> values;
  for (const DrrComparison& comparison : comparisons)
    if (!std::isnan(value(comparison))) values.push_back(value(comparison));
  return to_json(summarize(std::move(values)));
}

json share_where(const std::vector<double>& values, const auto& predicate) {
  if (values.empty()) return nullptr;
  return static_cast<double>(std::count_if(values.begin(), values.end(), predicate)) /
         static_cast<double>(values.size());
}

}  // namespace

std::vector<CsvCells> image_quality_rows(const std::vector<DrrComparison>& comparisons,
                                         const CsvCells& target) {
  std::vector<CsvCells> rows;
  for (const DrrComparison& comparison : comparisons) {
    CsvCells cells = target;
    cells.emplace_back("pose_index", rows.size());
    append("", kParameterNames, comparison.parameters.deg_and_mm(), cells);
    append({{"psnr_db", comparison.psnr_db},
            {"rms_difference", comparison.rms_difference},
            {"mean_difference", comparison.mean_difference},
            {"largest_difference", comparison.largest_difference},
            {"reference_maximum", comparison.reference_maximum},
            {"foreground_fraction", comparison.foreground_fraction},
            {"rays_outside", comparison.rays_outside},
            {"redrawn", comparison.redrawn}},
           cells);
    rows.push_back(std::move(cells));
  }
  return rows;
}

std::optional<std::size_t> comparison_at(const std::vector<DrrComparison>& comparisons,
                                         double share) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < comparisons.size(); ++i)
    if (!std::isnan(comparisons[i].psnr_db)) order.push_back(i);
  if (order.empty()) return std::nullopt;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return comparisons[a].psnr_db < comparisons[b].psnr_db;
  });
  return order[static_cast<std::size_t>(share * static_cast<double>(order.size() - 1))];
}

json image_quality_statistics(const std::vector<DrrComparison>& comparisons) {
  const std::vector<double> values = psnr_values(comparisons);
  std::int64_t redrawn = 0;
  for (const DrrComparison& comparison : comparisons) redrawn += comparison.redrawn;
  json result;
  result["poses"] = comparisons.size();
  result["compared"] = values.size();
  result["redrawn"] = redrawn;
  result["outside_or_empty"] = comparisons.size() - values.size();
  result["psnr_db"] = to_json(summarize(values));
  result["share_above_40_db"] =
      share_where(values, [](double value) { return value > kGoodPsnrDb; });
  result["share_below_36_db"] =
      share_where(values, [](double value) { return value < kPoorPsnrDb; });
  result["reference_maximum"] =
      summary_of(comparisons, [](const auto& row) { return row.reference_maximum; });
  result["mean_difference"] =
      summary_of(comparisons, [](const auto& row) { return row.mean_difference; });
  result["rms_difference"] =
      summary_of(comparisons, [](const auto& row) { return row.rms_difference; });
  result["seconds_per_drr_field"] =
      summary_of(comparisons, [](const auto& row) { return row.tested_seconds; });
  result["seconds_per_drr_raycast"] =
      summary_of(comparisons, [](const auto& row) { return row.reference_seconds; });
  return result;
}

json camera_distance_json(const CameraDistance& distance, const MotionRange& covered) {
  return {{"text", distance.text()},
          {"source_mm", distance.source_mm},
          {"rotation_deg", distance.rotation_deg},
          {"source_detector_mm", distance.source_detector_mm},
          {"detector_mm", distance.detector_mm},
          {"range", covered.text()}};
}

json field_description(const FieldIdentity& identity,
                       const LightSlab& planes,
                       std::size_t codewords) {
  const MotionRange within = identity.range.symmetric_part();
  const SlabLattice lattice = planes.lattice(0);
  return {{"camera", identity.camera.name},
          {"detector_px", {identity.camera.size_px.x(), identity.camera.size_px.y()}},
          {"pixel_spacing_mm",
           {identity.camera.pixel_spacing_mm.x(), identity.camera.pixel_spacing_mm.y()}},
          {"source_detector_mm", identity.camera.source_detector_distance_mm()},
          {"uv_nodes", {lattice.u.nodes, lattice.v.nodes}},
          {"st_nodes", {lattice.s.nodes, lattice.t.nodes}},
          {"slabs", planes.slabs.size()},
          {"codewords", codewords},
          {"max_rotation_deg", within.max_rotation_rad() * kDegPerRad},
          {"max_translation_mm", within.max_translation_mm()},
          {"range", identity.range.text()},
          {"mu_water_per_mm", identity.mu_water_per_mm}};
}

}  // namespace af::evaluation
