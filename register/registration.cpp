// SPDX-License-Identifier: Apache-2.0
#include "register/registration.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "image/gaussian_blur.h"
#include "register/parameter_scaling.h"

namespace af::registration {
namespace {

using Clock = std::chrono::steady_clock;

std::string view_name(const RegistrationView& view) {
  return "view '" + view.view.camera.name + "': ";
}

bool has_size_of(const Image2d& image, const CameraGeometry& camera) {
  return image.width == camera.size_px.x() && image.height == camera.size_px.y();
}

void append_view_problems(const RegistrationView& view, std::vector<std::string>& found) {
  const CameraGeometry& camera = view.view.camera;
  if (!view.renderer) found.push_back(view_name(view) + "renderer = none: must be given");
  for (const std::string& text : problems(view.view.roi, camera.size_px.x(), camera.size_px.y()))
    found.push_back(view_name(view) + text);
  const auto size_text = [](int width, int height) {
    return std::to_string(width) + " x " + std::to_string(height);
  };
  const std::string expected = size_text(camera.size_px.x(), camera.size_px.y());
  if (!has_size_of(view.xray, camera))
    found.push_back(view_name(view) +
                    "X-ray size = " + size_text(view.xray.width, view.xray.height) +
                    ": must be the camera's " + expected);
  if (!view.mask.pixels.empty() && !has_size_of(view.mask, camera))
    found.push_back(view_name(view) +
                    "mask size = " + size_text(view.mask.width, view.mask.height) +
                    ": must be the camera's " + expected);
}

/// The region grown by half its size to every side, cut at the detector's edges.
RegionOfInterest grown(const RegionOfInterest& roi, const Eigen::Vector2i& size_px) {
  const int left = std::max(0, roi.column - roi.width / 2);
  const int top = std::max(0, roi.row - roi.height / 2);
  const int right = std::min(size_px.x(), roi.column + roi.width + roi.width / 2);
  const int bottom = std::min(size_px.y(), roi.row + roi.height + roi.height / 2);
  return {left, top, right - left, bottom - top};
}

ValueRange drr_range_at_nominal(const RegistrationProblem& problem, const RegistrationView& view) {
  const View wide{view.view.camera, grown(view.view.roi, view.view.camera.size_px)};
  std::int64_t rays_outside = 0;
  const Image2d drr =
      render_image(*view.renderer, problem.nominal_room_from_ct, wide, &rays_outside);
  if (rays_outside > 0)
    throw InputError(view_name(view) + "nominal_room_from_ct = a pose outside the field (" +
                     std::to_string(rays_outside) +
                     " rays miss its planes): must lie inside the field");
  const auto [low, high] = std::minmax_element(drr.pixels.begin(), drr.pixels.end());
  return {static_cast<double>(*low), static_cast<double>(*high)};
}

std::vector<std::uint8_t> used_pixels(const RegistrationView& view) {
  if (view.mask.pixels.empty()) return {};
  const Image2d mask = crop(view.mask, view.view.roi);
  std::vector<std::uint8_t> used(mask.pixels.size());
  std::transform(mask.pixels.begin(), mask.pixels.end(), used.begin(), [](float value) {
    return static_cast<std::uint8_t>(value != 0.0f ? 1 : 0);
  });
  return used;
}

/// Detector pixels per millimetre on the isocentre plane (mean of both directions).
double pixels_per_isocenter_mm(const RegistrationProblem& problem, const CameraGeometry& camera) {
  const double magnification =
      camera.source_detector_distance_mm() / camera.depth_mm(problem.isocenter_point);
  return magnification / camera.pixel_spacing_mm.mean();
}

ObjectiveView prepare_view(const RegistrationProblem& problem,
                           const RegistrationView& view,
                           const ValueRange& drr_range,
                           const RegistrationOptions& options,
                           const PassOptions& pass) {
  SimilarityReference reference;
  const double sigma_px =
      pass.smoothing_sigma_mm * pixels_per_isocenter_mm(problem, view.view.camera);
  // Blurred before it is cropped: the region's edge pixels see their true surroundings.
  reference.xray = crop(gaussian_blur(view.xray, sigma_px), view.view.roi);
  reference.used = used_pixels(view);
  reference.drr_range = drr_range;
  std::vector<std::string> found = problems(reference);
  for (std::string& text : found) text.insert(0, view_name(view));
  throw_if_any(found);
  return {view.view, view.renderer, make_similarity(options.similarity, reference), view.limit};
}

/// The poses that a pass searches: scaled parameters about the pass's start.
class PoseTarget final : public OptimizationTarget {
 public:
  PoseTarget(MultiViewObjective& objective, PoseFrame frame, const ParameterScaling& scaling)
      : objective_(objective), frame_(std::move(frame)), scaling_(scaling) {}

  std::optional<double> evaluate(const ScaledParameters& point) override {
    const ObjectiveValue value = objective_.evaluate(pose(point));
    drr_count_ += value.drr_count;
    rays_outside_ = value.rays_outside;
    if (!value.is_admissible) return std::nullopt;
    return value.similarity;
  }
  [[nodiscard]] RigidTransform pose(const ScaledParameters& point) const {
    return pose_from_parameters(frame_, scaling_.unscaled(point));
  }
  [[nodiscard]] std::int64_t drr_count() const { return drr_count_; }
  /// Of the latest evaluation.
  [[nodiscard]] std::int64_t rays_outside() const { return rays_outside_; }

 private:
  MultiViewObjective& objective_;
  PoseFrame frame_;
  ParameterScaling scaling_;
  std::int64_t drr_count_ = 0;
  std::int64_t rays_outside_ = 0;
};

}  // namespace

std::vector<std::string> problems(const RegistrationOptions& options) {
  std::vector<std::string> found = problems(options.similarity);
  const std::vector<std::string> names = optimizer_names();
  if (std::find(names.begin(), names.end(), options.optimizer) == names.end()) {
    std::string list;
    for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
    found.push_back("optimizer = '" + options.optimizer + "': must be one of " + list);
  }
  if (options.passes.empty()) found.emplace_back("passes = none: there must be at least one");
  for (std::size_t i = 0; i < options.passes.size(); ++i) {
    const std::string where = "pass " + std::to_string(i + 1) + ": ";
    const double sigma = options.passes[i].smoothing_sigma_mm;
    if (!(sigma >= 0.0) || !std::isfinite(sigma))
      found.push_back(where + "smoothing_sigma_mm = " + std::to_string(sigma) + ": must be >= 0");
    for (const std::string& text : problems(options.passes[i].optimizer))
      found.push_back(where + text);
  }
  if (options.max_evaluations < 1)
    found.push_back("max_evaluations = " + std::to_string(options.max_evaluations) +
                    ": must be >= 1");
  return found;
}

std::vector<PassOptions> paper_passes() {
  PassOptions smoothed;
  smoothed.smoothing_sigma_mm = 1.0;
  smoothed.optimizer = {5.0, 0.5};
  PassOptions sharp;
  sharp.optimizer = {2.0, 0.1};
  return {smoothed, sharp};
}

std::vector<std::string> preset_names() {
  return {"paper"};
}

RegistrationOptions preset_options(const std::string& name) {
  if (name == "paper") return {};
  std::string list;
  for (const std::string& known : preset_names()) list += (list.empty() ? "" : ", ") + known;
  throw InputError("preset", "'" + name + "'", "must be one of " + list);
}

std::vector<std::string> problems(const RegistrationProblem& problem) {
  std::vector<std::string> found;
  if (problem.views.empty()) found.emplace_back("views = none: there must be at least one");
  if (problem.scaling_points_ct.empty())
    found.emplace_back("scaling_points_ct = none: there must be at least one");
  for (const RegistrationView& view : problem.views) append_view_problems(view, found);
  return found;
}

struct RegistrationRunner::Impl {
  std::shared_ptr<const RegistrationProblem> problem;
  RegistrationOptions options;
  std::vector<View> views;
  std::vector<MultiViewObjective> objectives;  ///< one per pass
  std::shared_ptr<const Optimizer> optimizer;
  OptimizerResult search;  ///< reused

  /// Searches one pass from result.room_from_ct; false when no further pass makes sense.
  bool run_pass(std::size_t pass, RegistrationResult& result);
  void append_trace(std::size_t pass,
                    int evaluations_before,
                    const PoseTarget& target,
                    RegistrationResult& result) const;
};

void RegistrationRunner::Impl::append_trace(std::size_t pass,
                                            int evaluations_before,
                                            const PoseTarget& target,
                                            RegistrationResult& result) const {
  const PoseFrame frame = problem->frame();
  for (const OptimizerIteration& iteration : search.trace)
    result.trace.push_back({static_cast<int>(pass),
                            iteration.step_mm,
                            evaluations_before + iteration.evaluations,
                            iteration.value,
                            parameters_from_pose(frame, target.pose(iteration.point))});
}

bool RegistrationRunner::Impl::run_pass(std::size_t pass, RegistrationResult& result) {
  const std::optional<ParameterScaling> scaling =
      projected_motion_scaling(result.room_from_ct,
                               problem->center_ct_mm,
                               problem->scaling_points_ct,
                               views,
                               problem->isocenter_point);
  if (!scaling.has_value()) {
    result.stop_reason = StopReason::CtOutsideRoi;
    return false;
  }
  PoseTarget target(
      objectives[pass], PoseFrame::about(result.room_from_ct, problem->center_ct_mm), *scaling);
  optimizer->maximize(
      target, options.passes[pass].optimizer, options.max_evaluations - result.evaluations, search);
  append_trace(pass, result.evaluations, target, result);
  result.evaluations += search.evaluations;
  result.inadmissible += search.inadmissible;
  result.drr_count += target.drr_count();
  result.stop_reason = search.stop_reason;
  result.similarity = search.value;
  if (search.stop_reason == StopReason::StartInadmissible) {
    result.rays_outside = target.rays_outside();
    // The pass before ended on the very limit, and rounding put its end beyond.
    if (pass > 0) result.stop_reason = StopReason::PinnedAtLimit;
    return false;
  }
  result.room_from_ct = target.pose(search.point);
  return search.stop_reason == StopReason::StepBelowFinal ||
         search.stop_reason == StopReason::PinnedAtLimit;
}

RegistrationRunner::RegistrationRunner(std::shared_ptr<const RegistrationProblem> problem,
                                       const RegistrationOptions& options)
    : impl_(std::make_unique<Impl>()) {
  check(problem != nullptr, "a registration needs a problem");
  throw_if_any(problems(options));
  throw_if_any(problems(*problem));
  std::vector<ValueRange> drr_ranges;
  for (const RegistrationView& view : problem->views) {
    impl_->views.push_back(view.view);
    drr_ranges.push_back(drr_range_at_nominal(*problem, view));
  }
  for (const PassOptions& pass : options.passes) {
    std::vector<ObjectiveView> views;
    for (std::size_t i = 0; i < problem->views.size(); ++i)
      views.push_back(prepare_view(*problem, problem->views[i], drr_ranges[i], options, pass));
    impl_->objectives.emplace_back(std::move(views));
  }
  impl_->optimizer = make_optimizer(options.optimizer);
  impl_->options = options;
  impl_->problem = std::move(problem);
}

RegistrationRunner::RegistrationRunner(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RegistrationRunner::~RegistrationRunner() = default;
RegistrationRunner::RegistrationRunner(RegistrationRunner&&) noexcept = default;
RegistrationRunner& RegistrationRunner::operator=(RegistrationRunner&&) noexcept = default;

RegistrationRunner RegistrationRunner::share_preparation() const {
  auto impl = std::make_unique<Impl>();
  impl->problem = impl_->problem;
  impl->options = impl_->options;
  impl->views = impl_->views;
  impl->optimizer = impl_->optimizer;
  for (const MultiViewObjective& objective : impl_->objectives)
    impl->objectives.emplace_back(objective.views());
  return RegistrationRunner(std::move(impl));
}

RegistrationResult RegistrationRunner::run(const RigidTransform& start_room_from_ct) {
  const Clock::time_point begin = Clock::now();
  RegistrationResult result;
  result.start_room_from_ct = start_room_from_ct;
  result.room_from_ct = start_room_from_ct;
  result.similarity = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t pass = 0; pass < impl_->objectives.size(); ++pass)
    if (!impl_->run_pass(pass, result)) break;
  result.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  return result;
}

ObjectiveValue RegistrationRunner::similarity_at(const RigidTransform& room_from_ct) {
  return similarity_at(room_from_ct, impl_->objectives.size() - 1);
}

ObjectiveValue RegistrationRunner::similarity_at(const RigidTransform& room_from_ct,
                                                 std::size_t pass) {
  check(pass < impl_->objectives.size(), "no such pass");
  return impl_->objectives[pass].evaluate(room_from_ct);
}

const RegistrationProblem& RegistrationRunner::problem() const {
  return *impl_->problem;
}
const RegistrationOptions& RegistrationRunner::options() const {
  return impl_->options;
}

}  // namespace af::registration
