// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/registration.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <utility>

#include "base/error.h"
#include "base/fork_aware_mutex.h"
#include "base/joined.h"
#include "base/thread_pool.h"
#include "geometry/target_box.h"
#include "geometry/tre.h"
#include "library/field_facts.h"
#include "library/translation.h"
#include "register/case_loading.h"
#include "register/method/method_options.h"
#include "register/method/presets.h"
#include "register/search/pose_search.h"
#include "register/verdict/registration.h"
#include "study/case_gold_standard.h"
#include "study/landmark_start.h"
#include "study/study_file.h"

namespace attenuation_fields {

namespace library = af::library;
namespace registration = af::registration;

namespace {

registration::MethodOptions method_options(const RegistrationOptions& options) {
  registration::MethodOptions method;
  if (!options.preset.empty()) method.preset = options.preset;
  method.chains = options.chains;
  method.similarity = options.similarity;
  method.optimizer = options.optimizer;
  method.max_evaluations = options.max_evaluations;
  method.region = options.region;
  method.seed = options.seed;
  method.threads = options.threads;
  return method;
}

registration::UncertaintyOptions uncertainty_options(const RegistrationOptions& options) {
  registration::UncertaintyOptions result;
  result.is_left_out = options.no_uncertainty;
  result.calibration_error_px = options.calibration_error_px;
  af::throw_if_any(af::field_problems(result));
  return result;
}

Uncertainty uncertainty_of(const registration::UncertaintyReport& report) {
  Uncertainty result;
  std::size_t next = 0;
  for (std::size_t row = 0; row < 6; ++row)
    for (std::size_t column = row; column < 6; ++column, ++next)
      result.covariance[row][column] = result.covariance[column][row] =
          report.covariance_deg_mm[next];
  result.tre_rms_mm = report.tre_rms_mm;
  result.tre_95_mm = report.tre_95_mm;
  result.confidence = report.confidence;
  return result;
}

registration::RegistrationOptions resolved_method(const RegistrationOptions& options) {
  registration::RegistrationOptions method = resolve(method_options(options));
  method.correction.is_wanted = options.correct;
  return method;
}

registration::CaseLoadOptions load_options(const RegistrationOptions& options,
                                           const registration::RegistrationOptions& method,
                                           const std::shared_ptr<af::ThreadPool>& pool) {
  if (options.renderer != "field" && options.renderer != "raycast")
    throw af::InputError("renderer", options.renderer, "must be field or raycast");
  const bool casts = options.renderer == "raycast";
  if (casts && options.skip_ct_check)
    throw af::InputError("skip_ct_check = set: ray casting needs the CT; leave it out");
  if (options.correct && options.skip_ct_check)
    throw af::InputError(
        "correct = set: must not be given with skip_ct_check, because it casts rays through the "
        "CT");
  if (options.skip_ct_check && method.silhouette_mm() > 0.0)
    throw af::InputError(registration::kSilhouettesNeedTheCt);
  if (options.correct && casts) throw af::InputError(registration::kCorrectsRayCasting);
  registration::CaseLoadOptions result;
  result.renderer = casts ? registration::RendererKind::RayCast : registration::RendererKind::Field;
  result.field_paths = options.fields;
  result.attenuation = {options.water_mu_per_mm, options.air_below_hu};
  result.ray_caster.step_mm = method.correction.cast_step_mm(options.step_mm);
  af::throw_if_any(problems(result.attenuation));
  af::throw_if_any(problems(result.ray_caster));
  result.skip_ct_check = options.skip_ct_check;
  result.fiducial_mask_mm = method_options(options).fiducial_mask_mm;
  result.region_follows_target = method.region_follows_target;
  result.coarsest_level = method.coarsest_level();
  // search() needs this one for all rotations, which only ray casting shows.
  if (casts) result.coarsest_level = registration::kCoarsestLevel;
  result.judging_level = registration::PoseExaminer::coarsest_level();
  if (options.correct) result.correction_levels = method.last_levels();
  result.pool = pool;
  return result;
}

registration::PoseSearchOptions search_options(const SearchOptions& options) {
  registration::PoseSearchOptions result{
      options.modes, options.orientations, options.rotation_deg, options.translation_mm};
  af::Fields fields = af::fields_of(result);
  fields.at("search_modes").name = "modes";
  af::throw_if_any(af::field_problems(fields));
  return result;
}

/// The problem with as many coarse levels as af-register loads for such a search.
registration::RegistrationProblem searched_problem(const registration::Registration& registered,
                                                   const registration::PoseSearchOptions& search) {
  registration::RegistrationProblem problem = *registered.problem;
  const auto levels =
      static_cast<std::size_t>(std::max({registered.method.coarsest_level(),
                                         registration::PoseExaminer::coarsest_level(),
                                         coarsest_level(search)}));
  for (registration::RegistrationView& view : problem.views)
    view.coarse_levels.resize(std::min(view.coarse_levels.size(), levels));
  return problem;
}

/// The image of these pixels. Throws InputError unless there is a value for every pixel of the
/// camera.
af::Image2d whole_detector(const af::CameraGeometry& camera, std::span<const float> pixels) {
  af::Image2d image(camera.size_px.x(), camera.size_px.y());
  if (pixels.size() != image.pixels.size())
    throw af::InputError("X-ray of '" + camera.name + "'",
                         std::to_string(pixels.size()) + " values",
                         "must be " + std::to_string(image.width) + " x " +
                             std::to_string(image.height) + ", the camera's pixels");
  std::copy(pixels.begin(), pixels.end(), image.pixels.begin());
  return image;
}

}  // namespace

std::vector<std::string> preset_names() {
  return registration::preset_names();
}

std::string preset_help() {
  return registration::preset_help();
}

struct RegistrationCase::Impl {
  std::string name;
  PoseFrame frame;
  std::vector<std::string> warnings;
  af::Study study;
  std::optional<af::GoldStandard> gold;
  std::vector<Eigen::Vector3d> target_points;
  std::shared_ptr<af::ThreadPool> pool;
  registration::UncertaintyOptions uncertainty;
  double fiducial_mask_mm = 0.0;
  std::vector<af::ViewXrayReader> xray_readers;
  std::optional<registration::Registration> registration;
  af::ForkAwareMutex mutex;  ///< of registration and xray_readers

  /// The current problem. May be called while a registration runs.
  [[nodiscard]] std::shared_ptr<const registration::RegistrationProblem> problem() const {
    const std::lock_guard lock(problem_mutex_);
    return problem_;
  }

  /// Registers this problem from now on. Leaves everything as it is if it cannot be registered.
  void use(const std::shared_ptr<const registration::RegistrationProblem>& problem,
           const registration::RegistrationOptions& method) {
    registration::Registration made(problem, method, pool);
    made.examine_ends(uncertainty, pool);
    const std::lock_guard lock(problem_mutex_);
    registration.emplace(std::move(made));
    problem_ = problem;
  }

  [[nodiscard]] std::optional<double> tre_mm(const af::RigidTransform& pose) const {
    if (!gold.has_value()) return std::nullopt;
    return af::mean_tre_mm(pose, gold->room_from_ct, target_points);
  }

  /// `is_diagnosed`: looks into X-rays that do not fit, as af-register does for its best end.
  Registration run(const af::RigidTransform& start, std::int64_t start_index, bool is_diagnosed) {
    registration::RegistrationRecord record = registration->run(start, start_index);
    if (is_diagnosed) registration->diagnose(record);
    const registration::RegistrationResult& result = record.result;
    const auto judgement = registration::judgement_of(record);
    Registration found;
    found.start_index = start_index;
    found.start = library::pose_of(result.start_room_from_ct);
    found.pose = library::pose_of(result.room_from_ct);
    found.start_parameters = parameters_of(result.start_room_from_ct);
    found.parameters = parameters_of(result.room_from_ct);
    found.verdict = registration::to_string(judgement.verdict);
    found.reason = judgement.reason;
    found.similarity = result.similarity;
    found.chain = result.chain;
    found.stop_reason = registration::to_string(result.stop_reason);
    found.evaluations = result.evaluations;
    found.inadmissible = result.inadmissible;
    found.drr_count = result.drr_count;
    for (std::size_t i = 0; i < record.view_values.size(); ++i)
      found.views.push_back({registration->problem->views[i].view.camera.name,
                             record.view_values[i].coarse,
                             record.view_values[i].fine});
    found.uncertainty = uncertainty_of(record.uncertainty);
    found.initial_tre_mm = tre_mm(result.start_room_from_ct);
    found.tre_mm = tre_mm(result.room_from_ct);
    found.seconds = result.seconds;
    return found;
  }

 private:
  [[nodiscard]] std::array<double, 6> parameters_of(const af::RigidTransform& pose) const {
    return af::parameters_from_pose(registration->problem->frame(), pose).deg_and_mm();
  }

  mutable af::ForkAwareMutex problem_mutex_;
  std::shared_ptr<const registration::RegistrationProblem> problem_;
};

RegistrationCase::RegistrationCase(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}

RegistrationCase RegistrationCase::load(const std::filesystem::path& study_path,
                                        const std::string& case_name,
                                        const RegistrationOptions& options) {
  return load(study_path, case_name, options, Beam{});
}

RegistrationCase RegistrationCase::load(const std::filesystem::path& study_path,
                                        const std::string& case_name,
                                        const RegistrationOptions& options,
                                        const Beam& beam) {
  return library::translated_reading([&] {
    const registration::RegistrationOptions method = resolved_method(options);
    af::throw_if_any(af::thread_problems(options.threads));
    const auto pool = std::make_shared<af::ThreadPool>(af::thread_count(options.threads));
    registration::CaseLoadOptions loading = load_options(options, method, pool);
    loading.beam = library::checked_beam(beam);
    for (const auto& [camera, field] : options.opened_fields) {
      loading.opened_fields[camera] = field.facts_->opened;
      loading.field_paths[camera] = field.facts_->opened->path();
    }
    auto impl = std::make_shared<Impl>();
    impl->study = af::read_study(study_path, &impl->warnings);
    const af::Study& study = impl->study;
    const af::StudyCase& study_case = study.find_case(case_name);
    impl->name = study_case.name;
    impl->frame = library::frame_of(study_case.frame());
    impl->gold = af::known_gold(study, study_case);
    impl->target_points = af::target_points(study_case.target_box_ct);
    registration::LoadedCase loaded =
        registration::load_case(study, study_case, loading, af::Communicator::alone());
    impl->warnings.insert(impl->warnings.end(), loaded.warnings.begin(), loaded.warnings.end());
    impl->pool = pool;
    impl->uncertainty = uncertainty_options(options);
    impl->fiducial_mask_mm = loading.fiducial_mask_mm;
    impl->xray_readers = std::move(loaded.xray_readers);
    impl->use(loaded.problem, method);
    return RegistrationCase(std::move(impl));
  });
}

const std::string& RegistrationCase::name() const {
  return impl_->name;
}

std::vector<std::string> RegistrationCase::set_xray(const std::string& camera,
                                                    std::span<const float> xray) {
  return set_xrays({{camera, xray}});
}

std::vector<std::string> RegistrationCase::set_xrays(
    const std::map<std::string, std::span<const float>>& xrays) {
  return library::translated([&] {
    const std::lock_guard turn(impl_->mutex);
    std::map<std::string, af::Image2d> images;
    for (const auto& [camera, pixels] : xrays)
      images.emplace(camera, whole_detector(impl_->study.rig.camera(camera), pixels));
    std::vector<std::string> warnings;
    const auto problem = registration::with_xrays(*impl_->registration->problem,
                                                  impl_->xray_readers,
                                                  impl_->fiducial_mask_mm,
                                                  std::move(images),
                                                  warnings);
    impl_->use(problem, registration::RegistrationOptions(impl_->registration->method));
    return warnings;
  });
}

std::vector<CaseView> RegistrationCase::views() const {
  const auto problem = impl_->problem();
  std::vector<CaseView> views;
  for (const registration::RegistrationView& view : problem->views) {
    const af::RegionOfInterest& roi = view.view.roi;
    views.push_back({library::camera_of(view.view.camera),
                     {roi.column, roi.row, roi.width, roi.height},
                     view.xray.pixels,
                     view.mask.pixels,
                     problem});
  }
  return views;
}

const PoseFrame& RegistrationCase::frame() const {
  return impl_->frame;
}

const std::vector<std::string>& RegistrationCase::warnings() const {
  return impl_->warnings;
}

std::optional<Pose> RegistrationCase::gold() const {
  if (!impl_->gold.has_value()) return std::nullopt;
  return library::pose_of(impl_->gold->room_from_ct);
}

std::optional<double> RegistrationCase::tre_mm(const Pose& pose) const {
  return library::translated([&] { return impl_->tre_mm(library::transform_of(pose, "pose")); });
}

std::optional<Pose> RegistrationCase::landmark_start() const {
  return library::translated([&]() -> std::optional<Pose> {
    const af::StudyCase& study_case = impl_->study.find_case(impl_->name);
    if (!af::has_landmarks(study_case)) return std::nullopt;
    return library::pose_of(af::landmark_pose(impl_->study, study_case).room_from_ct);
  });
}

Pose RegistrationCase::usual_start() const {
  const std::optional<Pose> by_landmarks = landmark_start();
  return by_landmarks.has_value() ? *by_landmarks : frame().pose({}, {});
}

std::vector<PoseMode> RegistrationCase::search(const SearchOptions& options) const {
  return library::translated([&] {
    const registration::PoseSearchOptions wanted = search_options(options);
    const std::lock_guard turn(impl_->mutex);
    const registration::RegistrationProblem problem =
        searched_problem(*impl_->registration, wanted);
    const registration::PoseSearch search(
        problem, wanted, impl_->registration->method.silhouette_mm(), impl_->pool);
    std::vector<PoseMode> found;
    for (const registration::PoseMode& mode : search.modes())
      found.push_back({library::pose_of(mode.room_from_ct), mode.likeness});
    return found;
  });
}

Registration RegistrationCase::run(const Pose& start, std::int64_t start_index) const {
  return library::translated([&] {
    const af::RigidTransform room_from_ct = library::transform_of(start, "start");
    const std::lock_guard turn(impl_->mutex);
    return impl_->run(room_from_ct, start_index, true);
  });
}

std::vector<Registration> RegistrationCase::run_all(std::span<const Pose> starts) const {
  return library::translated([&] {
    std::vector<af::RigidTransform> transforms;
    for (std::size_t i = 0; i < starts.size(); ++i)
      transforms.push_back(library::transform_of(starts[i], "start " + std::to_string(i)));
    const std::lock_guard turn(impl_->mutex);
    std::vector<Registration> found;
    for (std::size_t i = 0; i < transforms.size(); ++i)
      found.push_back(impl_->run(transforms[i], static_cast<std::int64_t>(i), false));
    return found;
  });
}

std::optional<double> RegistrationCase::similarity(const Pose& pose) const {
  return library::translated([&]() -> std::optional<double> {
    const af::RigidTransform room_from_ct = library::transform_of(pose, "pose");
    const std::lock_guard turn(impl_->mutex);
    const registration::ObjectiveValue value = impl_->registration->similarity_at(room_from_ct);
    return value.is_admissible ? std::optional(value.similarity) : std::nullopt;
  });
}

}  // namespace attenuation_fields
