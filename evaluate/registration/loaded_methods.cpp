// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/loaded_methods.h"

#include <utility>

#include "base/error.h"
#include "ranks/terminal.h"
#include "register/case_loading.h"

namespace af::evaluation {
namespace {

registration::CaseLoadOptions load_options(const MethodOptions& options,
                                           const std::string& renderer,
                                           int coarsest_level,
                                           const std::vector<double>& level_blur_sigma_mm) {
  registration::CaseLoadOptions result;
  result.coarsest_level = coarsest_level;
  result.level_blur_sigma_mm = level_blur_sigma_mm;
  result.renderer =
      renderer == "field" ? registration::RendererKind::Field : registration::RendererKind::RayCast;
  if (renderer == "field") result.field_paths = options.fields.by_camera();
  result.fiducial_mask_mm = options.method.fiducial_mask_mm;
  result.attenuation = options.attenuation;
  result.ray_caster = options.ray_caster;
  result.beam = options.beam;
  return result;
}

/// Blurs of a problem's levels, averaged over the views.
std::vector<double> level_blurs_mm(const registration::RegistrationProblem& problem) {
  std::vector<double> blurs(problem.views.front().coarse_levels.size(), 0.0);
  for (const registration::RegistrationView& view : problem.views)
    for (std::size_t i = 0; i < blurs.size(); ++i)
      blurs[i] += view.coarse_levels[i].blur_sigma_mm / static_cast<double>(problem.views.size());
  return blurs;
}

}  // namespace

std::vector<LoadedMethod> load_methods(
    const MethodOptions& options,
    const registration::CorrectionOptions& correction,
    const Study& study,
    const StudyCase& study_case,
    const Communicator& world,
    LoadedInputs& inputs,
    int judging_level,
    const std::shared_ptr<registration::KeptFields>& kept_fields) {
  std::vector<LoadedMethod> methods;
  const registration::RegistrationOptions method =
      all_or_none(world, [&] { return registration::resolve(options.method); });
  const auto pool = std::make_shared<ThreadPool>(thread_count(options.method.threads));
  // Ray casting after a field takes the blurs of the field's levels, so that both run the same
  // method.
  std::vector<double> blurs_mm;
  for (const std::string& renderer : options.chosen_renderers()) {
    registration::RegistrationOptions its_method = method;
    if (renderer == "field") its_method.correction = correction;
    registration::CaseLoadOptions loading =
        load_options(options, renderer, method.coarsest_level(), blurs_mm);
    if (its_method.correction.is_wanted) loading.correction_levels = method.last_levels();
    // Both renderers get this step, so that ends can be compared.
    loading.ray_caster.step_mm = correction.cast_step_mm(options.ray_caster.step_mm);
    loading.judging_level = judging_level;
    loading.region_follows_target = method.region_follows_target;
    loading.pool = pool;
    if (renderer == "field") loading.kept_fields = kept_fields;
    const registration::LoadedCase loaded =
        registration::load_case(study, study_case, loading, world);
    blurs_mm = level_blurs_mm(*loaded.problem);
    for (const std::string& text : loaded.warnings) warn(world, text);
    for (const auto& [name, note] : loaded.input_notes)
      if (name.starts_with("field "))
        inform(world,
               std::string(study_case.name).append(": ").append(name).append(": ").append(note));
    for (const auto& [name, hash] : loaded.inputs)
      inputs.identities[study_case.name + ": " + name] = hash;
    for (const auto& [name, note] : loaded.input_notes)
      inputs.notes[study_case.name + ": " + name] = note;
    all_or_none(world, [&] {
      methods.push_back({renderer, registration::Registration(loaded.problem, its_method, pool)});
    });
  }
  return methods;
}

}  // namespace af::evaluation
