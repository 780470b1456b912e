// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/scan_study.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/number_text.h"
#include "base/toml_text.h"
#include "ct/ct_reader.h"
#include "evaluate/scan/image_sampling.h"
#include "figures/picture.h"
#include "files/csv_table.h"
#include "files/output_file.h"
#include "files/toml_reader.h"
#include "study/rig_file.h"
#include "xray/image_file.h"
#include "xray/quantile.h"

namespace af::tools {

namespace {

namespace fs = std::filesystem;

std::string view_name(int view) {
  std::string digits = std::to_string(view);
  if (digits.size() < 3) digits.insert(0, 3 - digits.size(), '0');
  return "view-" + digits;
}

std::string numbered(const char* what, std::size_t index) {
  const std::string digits = std::to_string(index + 1);
  return std::string(what) + (digits.size() < 2 ? "-0" : "-") + digits;
}

/// Angle between two directions on the circle, within 0 and pi.
double angle_between_rad(double a, double b) {
  return std::abs(std::remainder(a - b, 2.0 * std::numbers::pi));
}

CameraGeometry camera_of(const CalibratedScan& scan, int view) {
  return scan_camera(scan.images.scan,
                     scan.calibration,
                     scan.images.scan.angles_rad[static_cast<std::size_t>(view)],
                     view_name(view));
}

/// The smallest box that holds every pixel whose rays are seen from all around.
RegionOfInterest seen_region(const CalibratedScan& scan) {
  const CircularScan& geometry = scan.images.scan;
  const std::vector<unsigned char> is_seen =
      fully_seen_pixels(geometry, scan.calibration, scan.images.is_lit, scan.object_radius_mm);
  int low_column = geometry.size_px.x();
  int high_column = -1;
  int low_row = geometry.size_px.y();
  int high_row = -1;
  std::size_t pixel = 0;
  for (int row = 0; row < geometry.size_px.y(); ++row)
    for (int column = 0; column < geometry.size_px.x(); ++column, ++pixel) {
      if (is_seen[pixel] == 0) continue;
      low_column = std::min(low_column, column);
      high_column = std::max(high_column, column);
      low_row = std::min(low_row, row);
      high_row = std::max(high_row, row);
    }
  if (high_column <= low_column || high_row <= low_row)
    throw InputError("no part of the detector sees what the scan reconstructs");
  return {low_column, low_row, high_column - low_column + 1, high_row - low_row + 1};
}

/// The box within the object over which errors are taken: 0.6 of its radius, and 0.6 of the height
/// that is seen from all around.
CtBox target_box(const CalibratedScan& scan) {
  constexpr double kShare = 0.6;
  const CircularScan& geometry = scan.images.scan;
  const AxisView view = view_at_axis(geometry);
  const double nearest = 1.0 - scan.object_radius_mm / geometry.source_to_axis_mm;
  const Eigen::Vector3d middle(0.0, 0.0, 0.5 * nearest * (view.highest_mm + view.lowest_mm));
  const Eigen::Vector3d half =
      kShare * Eigen::Vector3d(scan.object_radius_mm,
                               scan.object_radius_mm,
                               0.5 * nearest * (view.highest_mm - view.lowest_mm));
  return {middle - half, middle + half};
}

RigidTransform nominal_pose(const ScanOptions& options, const std::string& scan_name, int pair) {
  HashRandom random(options.seed, hash_name(scan_name), static_cast<std::uint64_t>(pair));
  PoseParameters offset;
  for (double& angle : offset.rotation_rad)
    angle = kRadPerDeg *
            random.uniform(-options.max_offset_rotation_deg, options.max_offset_rotation_deg);
  for (double& shift : offset.translation_mm)
    shift = random.uniform(-options.max_offset_translation_mm, options.max_offset_translation_mm);
  return pose_from_parameters(PoseFrame{}, offset);
}

StudyCase case_of(const CalibratedScan& scan,
                  const std::string& name,
                  const RigidTransform& nominal,
                  const std::vector<int>& views,
                  const RegionOfInterest& region,
                  const fs::path& folder) {
  StudyCase result;
  result.name = name;
  result.note =
      "odd views of the scan " + scan.name +
      "; the CT is reconstructed from the even ones, so the true pose is the identity, to "
      "the held-out residual of " +
      fixed_text(scan.calibrated.rms_mm_at_axis, 3) + " mm";
  result.ct = folder / "ct.nii.gz";
  result.nominal_room_from_ct = nominal;
  result.target_box_ct = target_box(scan);
  result.gold_room_from_ct = RigidTransform::Identity();
  for (const int view : views) {
    StudyView study_view;
    study_view.camera = view_name(view);
    study_view.xray = folder / (view_name(view) + ".mha");
    study_view.xray_domain = XrayDomain::Attenuation;
    study_view.roi = region;
    study_view.mask = folder / (view_name(view) + "-mask.png");
    result.views.push_back(std::move(study_view));
  }
  return result;
}

const JudgedView& judged(const CalibratedScan& scan, int view) {
  const auto found = std::find_if(scan.calibrated.views.begin(),
                                  scan.calibrated.views.end(),
                                  [&](const JudgedView& row) { return row.view == view; });
  check(found != scan.calibrated.views.end(), "an X-ray of a study must have been judged");
  return *found;
}

/// Draws the X-ray, the mask and what the prediction leaves, side by side.
void write_view_picture(const CalibratedScan& scan,
                        int view,
                        const Image2d& mask,
                        const RegionOfInterest& region,
                        const fs::path& path) {
  const JudgedView& row = judged(scan, view);
  const Image2d& xray = scan.images.line_integrals[static_cast<std::size_t>(view)];
  const auto [low, high] = percentile_window(xray);
  Image2d residual(xray.width, xray.height);
  residual.pixels = row.alignment.residual;
  using Colors = PicturePanel::Colors;
  const PicturePanel measured = {
      xray, low, high, "measured", "line integrals", Colors::Grey, {region}};
  const PicturePanel used = {mask, 0.0, 1.0, "mask", "white: used", Colors::Grey, {region}};
  const PicturePanel rest = {residual,
                             -6.0,
                             6.0,
                             "measured - predicted",
                             "over what is expected",
                             Colors::Diverging,
                             {region}};
  write_picture({measured, used, rest},
                3,
                view_name(view) + ": shifted by " + fixed_text(row.shift_px.x(), 2) + ", " +
                    fixed_text(row.shift_px.y(), 2) + " px",
                path);
}

/// The share of a region that a mask leaves out.
double masked_share(const Image2d& mask, const RegionOfInterest& region) {
  int masked = 0;
  for (int row = region.row; row < region.row + region.height; ++row)
    for (int column = region.column; column < region.column + region.width; ++column)
      if (mask.at(column, row) == 0.0F) ++masked;
  return static_cast<double>(masked) / static_cast<double>(region.pixel_count());
}

/// Returns the share of the region that is masked.
double write_view(const ScanOptions& options,
                  const CalibratedScan& scan,
                  int view,
                  const RegionOfInterest& region,
                  const fs::path& folder) {
  const CircularScan& geometry = scan.images.scan;
  const Eigen::Vector2d spacing = geometry.pixel_spacing_mm;
  const std::string name = view_name(view);
  write_image(scan.images.line_integrals[static_cast<std::size_t>(view)],
              folder / (name + ".mha"),
              spacing.x(),
              spacing.y());
  const Image2d mask = mask_of(
      geometry, scan.images.is_lit, judged(scan, view).alignment.residual, options.mask_deviations);
  write_png_image(mask, folder / (name + "-mask.png"), 0.0, 1.0);
  write_view_picture(scan, view, mask, region, folder / (name + ".png"));
  return masked_share(mask, region);
}

/// The median response of held-out views, along columns or rows.
double median_response(const CalibratedScan& scan, int axis) {
  std::vector<float> responses;
  for (const JudgedView& row : scan.calibrated.views)
    responses.push_back(static_cast<float>(row.alignment.response[axis]));
  return static_cast<double>(nearest_rank(responses, 0.5));
}

/// What people should know before they trust the study, one line each.
std::string warnings_of(const CalibratedScan& scan, double most_masked) {
  std::string text;
  constexpr double kMuchMasked = 0.05;
  if (most_masked > kMuchMasked)
    text += "\nWarning: up to " + fixed_text(100.0 * most_masked, 1) +
            " % of an X-ray is masked as moved: look at the pictures, or give --mask-deviations 0";
  constexpr double kLeastResponse = 0.3;
  for (const int axis : {0, 1})
    if (const double response = median_response(scan, axis); response < kLeastResponse)
      text += std::string("\nWarning: the views hardly show shifts along ") +
              (axis == 0 ? "columns" : "rows") + " (response " + fixed_text(response, 2) +
              "): the gold residual says little there";
  return text;
}

std::string series_text(const char* key, const AngleSeries& series) {
  return std::string(key) + " = " + toml_numbers(series.coefficients) + "\n";
}

std::string calibration_text(const CalibratedScan& scan, double most_masked) {
  const ScanCalibration& found = scan.calibration;
  const HeldOutResidual& after = scan.calibrated;
  std::string text =
      "# Found from the even views of the scan, judged by the odd ones against the even ones' "
      "reconstruction. Pixels are those of the X-rays here.\n# Series: constant, cos a, sin a, cos "
      "2a, sin 2a, ... of the view angle a";
  if (found.column_px.basis.drift)
    text += "; the last is what the value grows by, evenly, from the first view to the last";
  text += ".\n";
  text += "scan = " + toml_text(scan.name) + "\n";
  text +=
      "enlarged = " + std::to_string(scan.enlarged) + "  # lengths over those of the scan's file\n";
  text += "source_to_axis_mm = " + toml_number(scan.images.scan.source_to_axis_mm) + "\n";
  text += "source_to_detector_mm = " + toml_number(found.source_to_detector_mm) + "\n";
  text += "tilt_rad = " + toml_number(found.tilt_rad) + "\n";
  text += series_text("beam_foot_column_px", found.column_px);
  text += series_text("beam_foot_row_px", found.row_px);
  text += series_text("detector_rotation_rad", found.rotation_rad);
  text += "stated_source_to_detector_mm = " + toml_number(scan.images.scan.source_to_detector_mm) +
          "\n";
  text += "ct_voxel_mm = " + toml_number(scan.ct.grid.spacing_mm.minCoeff()) + "\n";
  text += "water_mu_per_mm = " + toml_number(scan.water_mu_per_mm) + "\n";
  text +=
      "held_out_cost = " + toml_number(after.cost) + "  # of the odd views' detail, unexplained\n";
  text += "largest_masked_share = " + toml_number(most_masked) + "  # of an X-ray's region\n";
  text += "gold_residual_px = " + toml_number(after.rms_px) + "\n";
  text += "gold_residual_mm_at_axis = " + toml_number(after.rms_mm_at_axis) + "\n";
  text += "gold_residual_rotation_deg = " + toml_number(after.rotation_rms_rad * kDegPerRad) + "\n";
  text += "stated_residual_rotation_deg = " +
          toml_number(scan.as_stated.rotation_rms_rad * kDegPerRad) + "\n";
  text += "stated_residual_px = " + toml_number(scan.as_stated.rms_px) + "\n";
  text += "stated_residual_mm_at_axis = " + toml_number(scan.as_stated.rms_mm_at_axis) + "\n";
  return text;
}

void write_held_out(const CalibratedScan& scan, const fs::path& path) {
  std::string text =
      "view,angle_deg,column_shift_px,row_shift_px,rotation_deg,gain,response_column,response_"
      "row\n";
  for (const JudgedView& row : scan.calibrated.views) {
    const double angle = scan.images.scan.angles_rad[static_cast<std::size_t>(row.view)];
    text += std::to_string(row.view) + "," + number_text(angle * kDegPerRad) + "," +
            number_text(row.shift_px.x()) + "," + number_text(row.shift_px.y()) + "," +
            number_text(row.alignment.rotation_rad * kDegPerRad) + "," +
            number_text(row.alignment.gain) + "," + number_text(row.alignment.response.x()) + "," +
            number_text(row.alignment.response.y()) + "\n";
  }
  write_text_file(path, text);
}

/// Every second view of the scan as a case with a known pose, and X-rays in `folder`.
StudyCase projections_case(const CalibratedScan& scan,
                           const std::string& name,
                           int first_view,
                           const RegionOfInterest& region,
                           const fs::path& folder) {
  const int count = static_cast<int>(scan.images.scan.angles_rad.size());
  StudyCase result = case_of(scan,
                             name,
                             RigidTransform::Identity(),
                             CircularScan::every(first_view, 2, count),
                             region,
                             folder / "projections");
  result.ct = folder / "ct.nii.gz";
  const std::vector<unsigned char>& is_lit = scan.images.is_lit;
  const bool has_dark = std::find(is_lit.begin(), is_lit.end(), 0) != is_lit.end();
  for (StudyView& view : result.views) {
    view.mask.reset();
    if (has_dark) view.mask = folder / "projections" / "lit.png";
  }
  return result;
}

/// Writes projections.toml, its rig, and the folder of its X-rays.
void write_projections(const CalibratedScan& scan,
                       const RegionOfInterest& region,
                       const fs::path& folder) {
  const CircularScan& geometry = scan.images.scan;
  fs::create_directory(folder / "projections");
  Study study;
  study.path = folder / "projections.toml";
  study.rig_name_or_path = (folder / "projections" / "rig.toml").string();
  study.cases = {projections_case(scan, "measured", 0, region, folder),
                 projections_case(scan, "held-out", 1, region, folder)};
  for (std::size_t view = 0; view < geometry.angles_rad.size(); ++view) {
    study.rig.cameras.push_back(camera_of(scan, static_cast<int>(view)));
    write_image(scan.images.line_integrals[view],
                folder / "projections" / (view_name(static_cast<int>(view)) + ".mha"),
                geometry.pixel_spacing_mm.x(),
                geometry.pixel_spacing_mm.y());
  }
  Image2d lit(geometry.size_px.x(), geometry.size_px.y());
  std::copy(scan.images.is_lit.begin(), scan.images.is_lit.end(), lit.pixels.begin());
  write_png_image(lit, folder / "projections" / "lit.png", 0.0, 1.0);
  write_text_file(study.rig_name_or_path, rig_to_toml(study.rig));
  write_text_file(study.path, study_to_toml(study, folder));
}

}  // namespace

std::vector<ViewPair> odd_view_pairs(const CircularScan& scan, int pairs) {
  const std::vector<int> odd = CircularScan::every(1, 2, static_cast<int>(scan.angles_rad.size()));
  const auto angle = [&](int view) { return scan.angles_rad[static_cast<std::size_t>(view)]; };
  // Pairs a quarter turn apart have each other's views half a turn later. An odd share of the
  // circle keeps them apart.
  std::vector<ViewPair> result;
  for (int pair = 0; pair < pairs; ++pair) {
    const double wanted = 2.0 * std::numbers::pi * pair / pairs + angle(odd.front());
    const auto nearest = [&](double target_rad) {
      return *std::min_element(odd.begin(), odd.end(), [&](int a, int b) {
        return angle_between_rad(angle(a), target_rad) < angle_between_rad(angle(b), target_rad);
      });
    };
    const int first = nearest(wanted);
    result.push_back({first, nearest(angle(first) + 0.5 * std::numbers::pi)});
  }
  return result;
}

Image2d mask_of(const CircularScan& scan,
                const std::vector<unsigned char>& is_lit,
                const std::vector<float>& residual,
                double most_deviations) {
  Image2d beyond(scan.size_px.x(), scan.size_px.y());
  for (std::size_t i = 0; i < residual.size(); ++i)
    beyond.pixels[i] =
        most_deviations > 0.0 && std::abs(static_cast<double>(residual[i])) > most_deviations
            ? 1.0F
            : 0.0F;
  // What moved has a border of some pixels around where it was and is.
  const int around = std::max(2, scan.size_px.maxCoeff() / 80);
  Image2d mask(beyond.width, beyond.height);
  for (std::size_t i = 0; i < mask.pixels.size(); ++i)
    mask.pixels[i] = is_lit[i] != 0 ? 1.0F : 0.0F;
  // Single pixels are noise.
  constexpr float kFewestNeighbours = 3.0F;
  for (int row = 1; row + 1 < beyond.height; ++row)
    for (int column = 1; column + 1 < beyond.width; ++column) {
      float neighbours = 0.0F;
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) neighbours += beyond.at(column + i, row + j);
      if (beyond.at(column, row) == 0.0F || neighbours < kFewestNeighbours) continue;
      for (int j = -around; j <= around; ++j)
        for (int i = -around; i <= around; ++i) {
          const int x = std::clamp(column + i, 0, mask.width - 1);
          const int y = std::clamp(row + j, 0, mask.height - 1);
          if (i * i + j * j <= around * around) mask.at(x, y) = 0.0F;
        }
    }
  return mask;
}

std::string write_scan_study(const ScanOptions& options,
                             const CalibratedScan& scan,
                             const Provenance& provenance,
                             const fs::path& folder) {
  const RegionOfInterest region = seen_region(scan);
  const std::vector<ViewPair> pairs = odd_view_pairs(scan.images.scan, options.pairs);
  Study study;
  study.path = folder / "study.toml";
  study.rig_name_or_path = (folder / "rig.toml").string();
  std::vector<int> written;
  double most_masked = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const RigidTransform nominal = nominal_pose(options, scan.name, static_cast<int>(i));
    study.cases.push_back(case_of(
        scan, numbered("pair", i), nominal, {pairs[i].first, pairs[i].second}, region, folder));
    study.cases.push_back(
        case_of(scan, numbered("single", i), nominal, {pairs[i].first}, region, folder));
    for (const int view : {pairs[i].first, pairs[i].second}) {
      if (std::find(written.begin(), written.end(), view) != written.end()) continue;
      written.push_back(view);
      study.rig.cameras.push_back(camera_of(scan, view));
      most_masked = std::max(most_masked, write_view(options, scan, view, region, folder));
    }
  }
  if (options.writes_projections) write_projections(scan, region, folder);
  write_ct(scan.ct, folder / "ct.nii.gz");
  write_text_file(folder / "rig.toml", rig_to_toml(study.rig));
  write_text_file(folder / "study.toml", study_to_toml(study, folder));
  write_text_file(folder / "calibration.toml", calibration_text(scan, most_masked));
  write_held_out(scan, folder / "held-out.csv");
  write_text_file(folder / "provenance.json", to_json(provenance).dump(2) + "\n");
  write_reproduce_script(folder, provenance);
  return "Gold residual on " + std::to_string(scan.calibrated.views.size()) +
         " held-out views: " + fixed_text(scan.calibrated.rms_px, 3) + " px, " +
         fixed_text(scan.calibrated.rms_mm_at_axis, 4) +
         " mm at the axis (as stated: " + fixed_text(scan.as_stated.rms_px, 3) + " px, " +
         fixed_text(scan.as_stated.rms_mm_at_axis, 4) +
         " mm)\nDetector's distance from the source: " +
         fixed_text(scan.calibration.source_to_detector_mm, 1) +
         " mm (stated: " + fixed_text(scan.images.scan.source_to_detector_mm, 1) +
         " mm); masked: at most " + fixed_text(100.0 * most_masked, 1) + " % of an X-ray" +
         (scan.enlarged == 1 ? ""
                             : "\nAll lengths are " + std::to_string(scan.enlarged) +
                                   " times those of the scan's file, these, too") +
         warnings_of(scan, most_masked);
}

}  // namespace af::tools
