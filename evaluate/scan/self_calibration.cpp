// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/self_calibration.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include <Eigen/Dense>

#include "base/error.h"
#include "ct/ray_caster.h"
#include "evaluate/scan/image_sampling.h"
#include "geometry/point_projector.h"
#include "geometry/rigid_transform.h"

namespace af {

namespace {

/// Smoothing of the compared images, in pixels of the working resolution.
constexpr double kFinePx = 1.0;

/// The scan with the detector where the calibration has it. A pixel's size at the axis, and with it
/// every sampling, then follows the object's size, so that costs of different distances can be
/// compared.
CircularScan with_distance_of(const CircularScan& scan, const ScanCalibration& calibration) {
  CircularScan result = scan;
  result.source_to_detector_mm = calibration.source_to_detector_mm;
  return result;
}

/// A volume as the ray caster takes it. Negative attenuation counts as none, as in every CT.
AttenuationVolume castable(const MuVolume& volume) {
  const double reference = reference_mu_per_mm(volume);
  return {ct_of(volume, reference), AttenuationModel{reference, -1000}};
}

Image2d cast_view(const AttenuationVolume& volume, const CameraGeometry& camera) {
  const RayFan fan = {camera.source_point,
                      camera.detector_point(0, 0),
                      camera.pixel_spacing_mm.x() * camera.column_direction,
                      camera.pixel_spacing_mm.y() * camera.row_direction,
                      camera.size_px.x(),
                      camera.size_px.y()};
  Image2d image(fan.columns, fan.rows);
  RayCaster(volume, {volume.grid().spacing_mm.x()}).cast(fan, image.pixels);
  return image;
}

/// The column (or row) across the axis where the views' common centre of attenuation lies. For a
/// full circle, that centre is on the axis.
double axis_position_px(const ScanImages& images, const std::vector<int>& used) {
  const bool along_columns = images.scan.axis_along == AxisAlong::Columns;
  double sum = 0.0;
  double moment = 0.0;
  for (const int view : used) {
    const Image2d& image = images.line_integrals[static_cast<std::size_t>(view)];
    const float largest = *std::max_element(image.pixels.begin(), image.pixels.end());
    for (int row = 0; row < image.height; ++row)
      for (int column = 0; column < image.width; ++column) {
        const float value = image.at(column, row);
        constexpr float kNoise = 0.1F;
        if (value < kNoise * largest) continue;
        sum += static_cast<double>(value);
        moment += static_cast<double>(value) * (along_columns ? row : column);
      }
  }
  if (!(sum > 0.0)) throw InputError("the scan shows no object: nothing attenuates");
  return moment / sum;
}

/// The band-passed images of a working resolution, made once and used in every round.
class Rounds {
 public:
  Rounds(ScanImages images,
         const std::vector<int>& used,
         const SelfCalibrationOptions& options,
         ThreadPool& pool)
      : images_(std::move(images)), used_(used), options_(options), pool_(pool) {}

  [[nodiscard]] const ScanImages& images() const { return images_; }

  /// Predicts both halves from each other. Returns the mean cost and the step of the harmonics.
  struct Outcome {
    double cost = 0.0;
    double step_px = 0.0;  ///< root mean square over views, of column and row
  };
  Outcome improve(ScanCalibration& calibration) const {
    const AngleBasis functions = calibration.column_px.basis;
    const Eigen::Index size = functions.size();
    const Eigen::Index all = kViewParameters * size;
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(all, all);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(all);
    Outcome outcome;
    std::size_t judged_count = 0;
    std::vector<Eigen::VectorXd> bases;
    for (int half = 0; half < 2; ++half) {
      std::vector<int> from;
      std::vector<int> judged;
      for (std::size_t i = 0; i < used_.size(); ++i)
        (static_cast<int>(i % 2) == half ? judged : from).push_back(used_[i]);
      const HeldOutResidual residual =
          held_out_residual(images_, calibration, from, judged, options_, pool_);
      for (const JudgedView& judged_view : residual.views) {
        const double angle = images_.scan.angles_rad[static_cast<std::size_t>(judged_view.view)];
        const Eigen::VectorXd basis = functions.at(angle);
        bases.push_back(basis);
        const ViewAlignment& alignment = judged_view.alignment;
        for (int p = 0; p < kViewParameters; ++p) {
          right.segment(p * size, size) += alignment.right[p] * basis;
          for (int q = 0; q < kViewParameters; ++q)
            normal.block(p * size, q * size, size, size) +=
                alignment.normal(p, q) * basis * basis.transpose();
        }
        outcome.cost += alignment.cost;
        ++judged_count;
      }
    }
    outcome.cost /= static_cast<double>(judged_count);
    // The ridge keeps directions that the images do not determine where they are.
    constexpr double kRidge = 1e-6;
    for (Eigen::Index i = 0; i < all; ++i) normal(i, i) *= 1.0 + kRidge;
    const Eigen::VectorXd step = normal.ldlt().solve(right);
    if (!step.allFinite())
      throw NumericError("self-calibration: the normal equations are singular");
    calibration.column_px.coefficients += step.segment(0, size);
    calibration.row_px.coefficients += step.segment(size, size);
    calibration.rotation_rad.coefficients += step.segment(2 * size, size);
    for (const Eigen::VectorXd& basis : bases) {
      const double column = basis.dot(step.segment(0, size));
      const double row = basis.dot(step.segment(size, size));
      outcome.step_px += column * column + row * row;
    }
    outcome.step_px = std::sqrt(outcome.step_px / static_cast<double>(bases.size()));
    return outcome;
  }

  /// Improves `rounds` times. Returns the last cost, which is that before the last step.
  double improve(ScanCalibration& calibration, int rounds) const {
    double cost = 0.0;
    for (int round = 0; round < rounds; ++round) cost = improve(calibration).cost;
    return cost;
  }

 private:
  ScanImages images_;
  std::vector<int> used_;
  SelfCalibrationOptions options_;
  ThreadPool& pool_;
};

int binning_for(const CircularScan& scan, int most_px) {
  return std::max(1, (scan.size_px.maxCoeff() + most_px - 1) / most_px);
}

/// One soft value of a calibration. Column and row follow a changed distance in the rounds.
using SoftValue = double ScanCalibration::*;

/// The minimum of a parabola through three costs, or the lowest of the three.
double parabola_minimum(const std::array<double, 3>& at, const std::array<double, 3>& cost) {
  const double left = (cost[1] - cost[0]) / (at[1] - at[0]);
  const double right = (cost[2] - cost[1]) / (at[2] - at[1]);
  const double curvature = (right - left) / (at[2] - at[0]);
  const auto lowest =
      static_cast<std::size_t>(std::min_element(cost.begin(), cost.end()) - cost.begin());
  if (!(curvature > 0.0)) return at[lowest];
  const double minimum = 0.5 * (at[0] + at[1]) - 0.5 * left / curvature;
  return std::clamp(minimum, at[0], at[2]);
}

/// Searches the soft value within `reach` of where it is: at three places, then at a narrower three
/// about the best.
void seek(const Rounds& rounds, ScanCalibration& calibration, SoftValue value, double reach) {
  constexpr int kRoundsEach = 2;
  constexpr double kNarrower = 0.3;
  const double middle = calibration.*value;
  double center = middle;
  for (const double width : {reach, kNarrower * reach}) {
    std::array<double, 3> at = {};
    std::array<double, 3> cost = {};
    for (std::size_t i = 0; i < 3; ++i) {
      at[i] = center + (static_cast<double>(i) - 1.0) * width;
      ScanCalibration tried = calibration;
      tried.*value = at[i];
      cost[i] = rounds.improve(tried, kRoundsEach);
    }
    center = std::clamp(parabola_minimum(at, cost), middle - reach, middle + reach);
  }
  calibration.*value = center;
}

std::string calibration_line(const char* what, const ScanCalibration& calibration, double cost) {
  std::ostringstream line;
  line.precision(6);
  line << what << ": source to detector " << calibration.source_to_detector_mm << " mm, tilt "
       << calibration.tilt_rad << " rad, cost " << cost;
  return line.str();
}

/// A scan that turns the other way: the same images at the opposite angles.
ScanImages turned_around(const ScanImages& images) {
  ScanImages result = images;
  for (double& angle : result.scan.angles_rad) angle = -angle;
  return result;
}

void refuse_other_direction(const ScanImages& images,
                            const std::vector<int>& used,
                            const SelfCalibrationOptions& options,
                            ThreadPool& pool,
                            double cost,
                            const std::function<void(const std::string&)>& report) {
  constexpr int kRounds = 3;
  const Rounds other(turned_around(images), used, options, pool);
  ScanCalibration calibration = stated_calibration(other.images(), used, options, pool);
  const double other_cost = other.improve(calibration, kRounds);
  std::ostringstream costs;
  costs << cost << " against " << other_cost;
  // An object that looks the same from all sides does not tell the direction, and noise must not
  // decide it.
  constexpr double kClearly = 0.9;
  if (other_cost > kClearly * cost && cost > kClearly * other_cost)
    report("Warning: the images hardly tell which way the scan turns (cost " + costs.str() +
           "); the sign of step_deg is taken as stated");
  if (other_cost <= kClearly * cost)
    throw InputError("step_deg",
                     "residual " + costs.str() + " when the scan turns the other way",
                     "the images agree better with the opposite direction: change the sign of "
                     "step_deg, or mirror the images");
}

}  // namespace

AngleBasis SelfCalibrationOptions::basis_for(const CircularScan& scan,
                                             std::size_t used_views) const {
  // What few views seem to tell of a short period is mostly noise.
  constexpr std::size_t kViewsPerHarmonic = 8;
  AngleBasis basis;
  basis.harmonics = std::min(harmonics, static_cast<int>(used_views / kViewsPerHarmonic));
  basis.drift = sweep_of(scan);
  return basis;
}

void SelfCalibrationOptions::describe(Fields& field) {
  field("harmonics",
        harmonics,
        "Harmonics of the view angle in which the detector may move; at most one per 16 views")
      .within(0, 12);
  field("rounds", rounds, "Rounds of reconstructing, predicting and moving cameras").within(1, 100);
  field.leave_out(coarse_px, "one value suits every scan");
  field("working_px",
        working_px,
        "Images are binned until their larger side has at most this many pixels")
      .within(32, 4096);
  field("search_px", search_px, "The same while distance and tilt of the detector are sought")
      .within(32, 4096);
  field("focal_share",
        focal_share,
        "The detector's distance, which scales all lengths, is sought within this share of the "
        "stated one; 0: kept. Default: the scan's distance_tolerance")
      .within(0.0, 0.3);
  field("tilt_deg", tilt_deg, "The detector's tilt is sought within this many degrees; 0: kept")
      .within(0.0, 10.0);
}

double object_radius_mm(const MuVolume& volume) {
  const CtGrid& grid = volume.grid;
  const auto bins = static_cast<std::size_t>(grid.size[0]);
  std::vector<double> mass(bins + 1, 0.0);
  std::size_t next = 0;
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i) {
        const double mu = std::max(0.0F, volume.mu_per_mm[next++]);
        const Eigen::Vector3d point = grid.point_mm(Eigen::Vector3d(i, j, k));
        const double radius = point.head<2>().norm() / grid.spacing_mm.x();
        mass[std::min(bins, static_cast<std::size_t>(radius))] += mu * mu;
      }
  constexpr double kNearlyAll = 0.98;
  double all = 0.0;
  for (const double bin : mass) all += bin;
  double within = 0.0;
  std::size_t bin = 0;
  while (bin < bins && within < kNearlyAll * all) within += mass[bin++];
  return static_cast<double>(bin) * grid.spacing_mm.x();
}

ScanCalibration stated_calibration(const ScanImages& images,
                                   const std::vector<int>& used,
                                   const SelfCalibrationOptions& options,
                                   ThreadPool& pool) {
  const ScanCalibration stated =
      ScanCalibration::nominal(images.scan, options.basis_for(images.scan, used.size()));
  ScanCalibration centred = stated;
  (images.scan.axis_along == AxisAlong::Columns ? centred.row_px : centred.column_px)
      .coefficients[0] = axis_position_px(images, used);
  const int bin = binning_for(images.scan, options.search_px);
  const Rounds coarse(images.binned(bin), used, options, pool);
  const auto cost = [&](const ScanCalibration& tried) {
    constexpr int kRounds = 2;  // the cost after one step
    ScanCalibration moved = tried.binned(bin);
    return coarse.improve(moved, kRounds);
  };
  return cost(stated) < cost(centred) ? stated : centred;
}

ScanImages ScanImages::binned(int factor) const {
  ScanImages result;
  result.scan = scan.binned(factor);
  for (const Image2d& image : line_integrals)
    result.line_integrals.push_back(binned_image(image, factor));
  Image2d lit(scan.size_px.x(), scan.size_px.y());
  for (std::size_t i = 0; i < is_lit.size(); ++i) lit.pixels[i] = is_lit[i] != 0 ? 1.0F : 0.0F;
  for (const float share : binned_image(lit, factor).pixels)
    result.is_lit.push_back(share > 0.999F ? 1 : 0);
  return result;
}

std::vector<unsigned char> fully_seen_pixels(const CircularScan& scan,
                                             const ScanCalibration& calibration,
                                             const std::vector<unsigned char>& is_lit,
                                             double radius_mm) {
  std::vector<unsigned char> is_seen = is_lit;
  const double radius = scan.source_to_axis_mm;
  // Where a reconstructed point must lie to be seen from everywhere, and how high a ray gets.
  const double nearest = (radius - radius_mm) / radius;
  const AxisView view = view_at_axis(scan);
  const double farthest = (radius + radius_mm) / calibration.source_to_detector_mm;
  const bool along_columns = scan.axis_along == AxisAlong::Columns;
  const double foot = (along_columns ? calibration.column_px : calibration.row_px).coefficients[0];
  const double spacing = along_columns ? scan.pixel_spacing_mm.x() : scan.pixel_spacing_mm.y();
  // Excludes a few pixels at the edges, where filters see only one side.
  constexpr int kEdgePx = 3;
  std::size_t pixel = 0;
  for (int row = 0; row < scan.size_px.y(); ++row)
    for (int column = 0; column < scan.size_px.x(); ++column, ++pixel) {
      const double height_mm = farthest * spacing * (along_columns ? column - foot : foot - row);
      const bool at_edge = column < kEdgePx || row < kEdgePx ||
                           column >= scan.size_px.x() - kEdgePx ||
                           row >= scan.size_px.y() - kEdgePx;
      if (at_edge || height_mm < view.lowest_mm * nearest || height_mm > view.highest_mm * nearest)
        is_seen[pixel] = 0;
    }
  return is_seen;
}

MuVolume reconstruct_views(const ScanImages& images,
                           const ScanCalibration& calibration,
                           const std::vector<int>& used,
                           const FdkOptions& options,
                           ThreadPool& pool) {
  const CircularScan scan = with_distance_of(images.scan, calibration);
  std::vector<ScanView> views;
  for (const int view : used) {
    const auto i = static_cast<std::size_t>(view);
    const double angle = scan.angles_rad[i];
    views.push_back({angle, scan_camera(scan, calibration, angle), &images.line_integrals[i]});
  }
  return reconstruct_fdk(scan, views, scan_grid(scan, options.voxel_mm), options, pool);
}

HeldOutResidual held_out_residual(const ScanImages& images,
                                  const ScanCalibration& calibration,
                                  const std::vector<int>& used,
                                  const std::vector<int>& judged,
                                  const SelfCalibrationOptions& options,
                                  ThreadPool& pool) {
  const MuVolume reconstruction = reconstruct_views(images, calibration, used, {}, pool);
  const AttenuationVolume volume = castable(reconstruction);
  const CircularScan scan = with_distance_of(images.scan, calibration);
  const std::vector<unsigned char> is_counted =
      fully_seen_pixels(scan, calibration, images.is_lit, object_radius_mm(reconstruction));
  const BandPass band_pass(
      scan.size_px.x(), scan.size_px.y(), is_counted, kFinePx, options.coarse_px);
  HeldOutResidual residual;
  residual.views.resize(judged.size());
  pool.for_each(static_cast<int>(judged.size()), [&](int task, int /*slot*/) {
    const auto i = static_cast<std::size_t>(task);
    const auto view = static_cast<std::size_t>(judged[i]);
    const double angle = scan.angles_rad[view];
    const Image2d predicted = band_pass(cast_view(volume, scan_camera(scan, calibration, angle)));
    JudgedView& result = residual.views[i];
    result.view = judged[i];
    result.alignment = align_view(band_pass(images.line_integrals[view]),
                                  predicted,
                                  is_counted,
                                  {calibration.column_px.at(angle), calibration.row_px.at(angle)},
                                  scan.pixel_spacing_mm);
    result.shift_px = result.alignment.shift_px.cwiseQuotient(result.alignment.response);
  });
  const double mm_per_px =
      scan.pixel_spacing_mm.maxCoeff() * scan.source_to_axis_mm / calibration.source_to_detector_mm;
  for (const JudgedView& view : residual.views) {
    residual.rms_px += view.shift_px.squaredNorm();
    residual.rotation_rms_rad += view.alignment.rotation_rad * view.alignment.rotation_rad;
    residual.cost += view.alignment.cost;
  }
  residual.rms_px = std::sqrt(residual.rms_px / static_cast<double>(judged.size()));
  residual.rms_mm_at_axis = residual.rms_px * mm_per_px;
  residual.rotation_rms_rad =
      std::sqrt(residual.rotation_rms_rad / static_cast<double>(judged.size()));
  residual.cost /= static_cast<double>(judged.size());
  return residual;
}

ScanCalibration self_calibrate(const ScanImages& images,
                               const std::vector<int>& used,
                               const SelfCalibrationOptions& options,
                               ThreadPool& pool,
                               const std::function<void(const std::string&)>& report) {
  constexpr int kFirstRounds = 4;
  const int search_bin = binning_for(images.scan, options.search_px);
  const Rounds search(images.binned(search_bin), used, options, pool);
  const ScanCalibration stated = stated_calibration(search.images(), used, options, pool);
  ScanCalibration calibration = stated;
  double cost = search.improve(calibration, kFirstRounds);
  report(calibration_line("As stated", calibration, cost));
  const AngleBasis& functions = calibration.column_px.basis;
  report("Foot and rotation of the detector may follow " + std::to_string(functions.harmonics) +
         " harmonics of the angle" +
         (functions.drift ? " and a drift from the first view to the last" : ", no drift"));
  refuse_other_direction(search.images(), used, options, pool, cost, report);
  const double focal_share = options.focal_share.value_or(images.scan.distance_tolerance);
  if (focal_share > 0.0) {
    seek(search,
         calibration,
         &ScanCalibration::source_to_detector_mm,
         focal_share * images.scan.source_to_detector_mm);
    cost = search.improve(calibration, 2);
    report(calibration_line("Distance sought", calibration, cost));
  }
  if (options.tilt_deg > 0.0)
    seek(search, calibration, &ScanCalibration::tilt_rad, options.tilt_deg * kRadPerDeg);
  cost = search.improve(calibration, 2);
  report(calibration_line("Tilt sought", calibration, cost));

  const int bin = binning_for(images.scan, options.working_px);
  const Rounds finer(images.binned(bin), used, options, pool);
  const double bin_ratio = static_cast<double>(bin) / search_bin;
  calibration = calibration.binned(bin_ratio);
  constexpr double kSmallStepPx = 0.005;
  // What was found must predict better than what was stated. The gain must exceed what its many
  // parameters follow of the noise of few views.
  constexpr double kLeastGain = 0.01;
  ScanCalibration best = stated.binned(bin_ratio);
  ScanCalibration moved = best;
  const double stated_cost = finer.improve(moved).cost;
  double lowest = (1.0 - kLeastGain) * stated_cost;
  report(calibration_line("As stated, finer", best, stated_cost));
  for (int round = 0; round < options.rounds; ++round) {
    const ScanCalibration before = calibration;
    const Rounds::Outcome outcome = finer.improve(calibration);
    std::ostringstream line;
    line << "Round " << round + 1 << ": cost " << outcome.cost << ", moves by "
         << outcome.step_px * bin << " px";
    report(line.str());
    // What still moves without a gain is the object's place and orientation, not the geometry.
    if (outcome.cost >= lowest) break;
    lowest = outcome.cost;
    best = before;
    if (outcome.step_px < kSmallStepPx) break;
  }
  // At full resolution noise would count too.
  constexpr double kMuchUnexplained = 0.25;
  if (lowest > kMuchUnexplained)
    report("Warning: views share little detail with their predictions (cost " +
           std::to_string(lowest) +
           "): the object reaches far beyond the detector or moves, or the stated geometry is "
           "wrong (step_deg, rotation_axis, the files' order)");
  return best.binned(1.0 / bin);
}

}  // namespace af
