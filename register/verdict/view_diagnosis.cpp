// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/view_diagnosis.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/joined.h"
#include "register/method/presets.h"
#include "register/verdict/pose_examiner.h"
#include "register/verdict/registration.h"
#include "register/verdict/verdict.h"

namespace af::registration {
namespace {

/// A change is reported if it explains this much more of the gradients, on average over the views;
/// a wrong change gains next to nothing.
constexpr double kLeastGain = 0.15;

std::string percent_text(double share) {
  return std::isfinite(share) ? std::to_string(std::lround(100.0 * std::max(0.0, share))) + " %"
                              : "nothing";
}

/// A change of the X-rays, not made, with which a pose would explain far more of them.
struct Remedy {
  std::string text;  ///< "the X-ray of view 'B' mirrored left-right"
  std::vector<ViewValue> view_values;
};

/// The mean coarse value, NaN counting as 0.
double mean_of(const std::vector<ViewValue>& values) {
  double sum = 0.0;
  for (const ViewValue& view : values) sum += std::isfinite(view.coarse) ? view.coarse : 0.0;
  return sum / static_cast<double>(values.size());
}

/// The lowest of one of the values, NaN counting as 0.
double lowest_of(const std::vector<ViewValue>& values, double ViewValue::*value) {
  double lowest = 1.0;
  for (const ViewValue& view : values)
    lowest = std::min(lowest, std::isfinite(view.*value) ? view.*value : 0.0);
  return lowest;
}

/// The image with its columns, its rows or both in the other order.
Image2d mirrored(const Image2d& image, bool columns, bool rows) {
  Image2d result = image;
  if (image.pixels.empty()) return result;
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column)
      result.at(column, row) = image.at(columns ? image.width - 1 - column : column,
                                        rows ? image.height - 1 - row : row);
  return result;
}

void mirror(RegistrationView& view, bool columns, bool rows) {
  view.xray = mirrored(view.xray, columns, rows);
  view.mask = mirrored(view.mask, columns, rows);
  view.mask_without_markers = mirrored(view.mask_without_markers, columns, rows);
}

void negate(RegistrationView& view) {
  for (float& value : view.xray.pixels) value = -value;
}

/// What the X-ray is when its intensities, not their logarithms, were inverted.
void invert_intensities(RegistrationView& view) {
  const auto [low, high] = std::minmax_element(view.xray.pixels.begin(), view.xray.pixels.end());
  const float brightest = std::exp(-*low);
  // Half the darkest level, about what a detector tells from nothing.
  const float least = std::max(0.5f * std::exp(-*high), 1e-4f * brightest);
  for (float& value : view.xray.pixels)
    value = -std::log(std::max(brightest - std::exp(-value), least) / brightest);
}

struct Change {
  std::string text;
  std::function<void(RegistrationProblem&)> make;
};

void append_changes_of_view(const RegistrationProblem& problem,
                            std::size_t view,
                            std::vector<Change>& changes) {
  const std::string name = "the X-ray of view '" + problem.views[view].view.camera.name + "' ";
  const auto add = [&](const char* how, const std::function<void(RegistrationView&)>& make) {
    changes.push_back({name + how, [make, view](RegistrationProblem& p) { make(p.views[view]); }});
  };
  const char* const inverted = "inverted (see xray_domain in the study, and which grey is bone)";
  add(inverted, negate);
  add(inverted, invert_intensities);
  add("mirrored left-right", [](RegistrationView& v) { mirror(v, true, false); });
  add("mirrored up-down", [](RegistrationView& v) { mirror(v, false, true); });
  add("turned by 180 degrees", [](RegistrationView& v) { mirror(v, true, true); });
}

void exchange_xrays(RegistrationView& a, RegistrationView& b) {
  std::swap(a.xray, b.xray);
  std::swap(a.mask, b.mask);
  std::swap(a.mask_without_markers, b.mask_without_markers);
}

std::vector<Change> changes_of(const RegistrationProblem& problem) {
  std::vector<Change> changes;
  for (std::size_t i = 0; i < problem.views.size(); ++i) {
    append_changes_of_view(problem, i, changes);
    for (std::size_t j = 0; j < i; ++j) {
      const CameraGeometry& a = problem.views[j].view.camera;
      const CameraGeometry& b = problem.views[i].view.camera;
      if (a.size_px != b.size_px) continue;
      changes.push_back(
          {"the X-rays of views '" + a.name + "' and '" + b.name + "' exchanged",
           [i, j](RegistrationProblem& p) { exchange_xrays(p.views[j], p.views[i]); }});
    }
  }
  return changes;
}

/// Two coarse chains that need few poses: the default method's first, and the same on tiles.
std::optional<RegistrationOptions> coarse_options(const RegistrationProblem& problem) {
  RegistrationOptions options = preset_options("robust");
  options.chains.resize(1);
  ChainOptions tiles = options.chains.front();
  tiles.name = "tiles";
  tiles.stages[1].similarity.name = "tncc";
  options.chains.push_back(std::move(tiles));
  options.finish.stages.clear();
  for (const RegistrationView& view : problem.views)
    if (static_cast<int>(view.coarse_levels.size()) < options.coarsest_level()) return std::nullopt;
  return options;
}

/// The best values that the changed problem comes to; none when it cannot be registered.
std::optional<std::vector<ViewValue>> values_with(const Change& change,
                                                  const RegistrationProblem& problem,
                                                  const RegistrationOptions& options,
                                                  const std::vector<RigidTransform>& starts) {
  const auto changed = std::make_shared<RegistrationProblem>(problem);
  change.make(*changed);
  std::optional<std::vector<ViewValue>> best;
  try {
    Registration registration(changed, options);
    PoseExaminer examiner(*changed, 0.0);
    for (const RigidTransform& start : starts) {
      std::vector<ViewValue> values = examiner.view_values(registration.search(start).room_from_ct);
      if (!best.has_value() || mean_of(values) > mean_of(*best)) best = std::move(values);
    }
  } catch (const InputError&) {  // an X-ray without gradients
    return std::nullopt;
  }
  return best;
}

std::optional<Remedy> remedy_of(const RegistrationProblem& problem,
                                const std::vector<RigidTransform>& starts,
                                const std::vector<ViewValue>& view_values) {
  // Changes are tried over the whole region, whose values do not compare with those in silhouettes.
  for (const ViewValue& value : view_values)
    if (value.in_silhouette) return std::nullopt;
  const auto options = coarse_options(problem);
  if (!options.has_value()) return std::nullopt;
  std::optional<Remedy> best;
  for (const Change& change : changes_of(problem)) {
    auto values = values_with(change, problem, *options, starts);
    if (!values.has_value() || lowest_of(*values, &ViewValue::coarse) < kLeastCoarseOfFound)
      continue;
    const double least =
        best.has_value() ? mean_of(best->view_values) : mean_of(view_values) + kLeastGain;
    if (mean_of(*values) > least) best = Remedy{change.text, std::move(*values)};
  }
  return best;
}

std::string shares_text(const RegistrationProblem& problem, const std::vector<ViewValue>& values) {
  std::string text;
  for (std::size_t i = 0; i < values.size(); ++i)
    text += (i == 0 ? "'" : ", '") + problem.views[i].view.camera.name + "' " +
            percent_text(values[i].coarse) + " (in detail " + percent_text(values[i].fine) + ")";
  return text;
}

void append_same_xrays(const RegistrationProblem& problem, std::vector<std::string>& messages) {
  for (std::size_t i = 0; i < problem.views.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (problem.views[i].xray.pixels == problem.views[j].xray.pixels)
        messages.push_back("views '" + problem.views[j].view.camera.name + "' and '" +
                           problem.views[i].view.camera.name +
                           "' have the same X-ray, pixel for pixel");
}

}  // namespace

ViewDiagnosis diagnose_views(const std::shared_ptr<const RegistrationProblem>& problem,
                             const RigidTransform& start_room_from_ct,
                             const RigidTransform& room_from_ct,
                             const std::vector<ViewValue>& view_values) {
  ViewDiagnosis diagnosis;
  append_same_xrays(*problem, diagnosis.messages);
  const bool has_copy = !diagnosis.messages.empty();
  for (std::size_t i = 0; i < view_values.size(); ++i) {
    if (disagrees(i, view_values))
      diagnosis.messages.push_back("view '" + problem->views[i].view.camera.name +
                                   "' does not agree with the others: shares of the X-rays' "
                                   "gradients that the pose explains: " +
                                   shares_text(*problem, view_values));
  }
  const bool is_sound = lowest_of(view_values, &ViewValue::coarse) >= kLeastCoarseOfFound &&
                        lowest_of(view_values, &ViewValue::fine) >= kLeastFineOfFound;
  // No change mends a copy: what seems to is a body's symmetry.
  if (is_sound || has_copy) return diagnosis;
  // Mirrored, a shaft is still a shaft, so silhouettes of bones would fit changed X-rays too.
  const bool in_silhouettes = std::ranges::any_of(view_values, &ViewValue::in_silhouette);
  if (in_silhouettes) return diagnosis;
  const auto remedy = remedy_of(*problem, {start_room_from_ct, room_from_ct}, view_values);
  if (remedy.has_value())
    diagnosis.messages.push_back(
        remedy->text + " would explain more: " + shares_text(*problem, remedy->view_values) +
        " instead of " + shares_text(*problem, view_values));
  return diagnosis;
}

Judgement judgement_of(const RegistrationResult& result,
                       std::span<const ViewValue> view_values,
                       const ViewDiagnosis& diagnosis) {
  Judgement judgement = judged_end(result.stop_reason, view_values, result.pinned_along);
  std::vector<std::string> reasons = diagnosis.messages;
  if (reasons.empty() || judgement.verdict != Verdict::Found)
    reasons.insert(reasons.begin(), judgement.reason);
  if (!diagnosis.messages.empty() && judgement.verdict == Verdict::Found)
    judgement.verdict = Verdict::Doubtful;
  if (!result.clipped_along.empty())
    reasons.push_back("the start lay outside the field's range along " + result.clipped_along +
                      " and was clipped into it");
  judgement.reason = joined(reasons, "; ");
  return judgement;
}

}  // namespace af::registration
