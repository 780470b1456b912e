// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/view_diagnosis.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "base/error.h"
#include "register/method/presets.h"
#include "register/verdict/pose_examiner.h"
#include "register/verdict/registration.h"
#include "register/verdict/verdict.h"

namespace af::registration {
namespace {

/// A change is reported if it explains this much more of the gradients, averaged over the views. A
/// wrong change gains almost nothing.
constexpr double kLeastGain = 0.15;

std::string percent_text(double share) {
  return std::isfinite(share) ? std::to_string(std::lround(100.0 * std::max(0.0, share))) + " %"
                              : "nothing";
}

/// The mean coarse value. NaN counts as 0.
double mean_of(const std::vector<ViewValue>& values) {
  double sum = 0.0;
  for (const ViewValue& view : values) sum += std::isfinite(view.coarse) ? view.coarse : 0.0;
  return sum / static_cast<double>(values.size());
}

/// The lowest of one of the values. NaN counts as 0.
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

/// Turns the X-ray into what it is if its intensities, not their logarithms, were inverted.
void invert_intensities(RegistrationView& view) {
  const auto [low, high] = std::minmax_element(view.xray.pixels.begin(), view.xray.pixels.end());
  const float brightest = std::exp(-*low);
  // Half the darkest level is about what a detector distinguishes from nothing.
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

/// The values of the pose that the changed problem reaches from the nominal one. None when it
/// cannot be registered, or when one of them is certainly lower than where the pose explains well.
std::optional<std::vector<ViewValue>> values_with(const Change& change,
                                                  const RegistrationProblem& problem,
                                                  const RegistrationOptions& options,
                                                  const std::shared_ptr<ThreadPool>& threads) {
  const auto changed = std::make_shared<RegistrationProblem>(problem);
  change.make(*changed);
  try {
    Registration registration(changed, options, threads);
    const RegistrationResult end = registration.search(changed->nominal_room_from_ct);
    // The judge of the chains' ends gives the mean of the coarse values.
    if (!(end.similarity >= kWellExplained.coarse)) return std::nullopt;
    return PoseExaminer(changed, 0.0).view_values(end.room_from_ct);
  } catch (const InputError&) {  // an X-ray has no gradients
    return std::nullopt;
  }
}

std::optional<Remedy> best_remedy(const RegistrationProblem& problem,
                                  const std::shared_ptr<ThreadPool>& threads) {
  const auto options = coarse_options(problem);
  if (!options.has_value()) return std::nullopt;
  std::optional<Remedy> best;
  for (const Change& change : changes_of(problem)) {
    auto values = values_with(change, problem, *options, threads);
    if (!values.has_value() || lowest_of(*values, &ViewValue::coarse) < kWellExplained.coarse)
      continue;
    if (!best.has_value() || mean_of(*values) > mean_of(best->view_values))
      best = Remedy{change.text, std::move(*values)};
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

ViewDiagnoser::ViewDiagnoser(std::shared_ptr<const RegistrationProblem> problem,
                             std::shared_ptr<ThreadPool> threads)
    : problem_(std::move(problem)), threads_(std::move(threads)) {}

ViewDiagnosis ViewDiagnoser::diagnosis(const std::vector<ViewValue>& view_values) {
  ViewDiagnosis diagnosis;
  append_same_xrays(*problem_, diagnosis.messages);
  const bool has_copy = !diagnosis.messages.empty();
  for (std::size_t i = 0; i < view_values.size(); ++i) {
    if (disagrees(i, view_values))
      diagnosis.messages.push_back("view '" + problem_->views[i].view.camera.name +
                                   "' does not agree with the others: shares of the X-rays' "
                                   "gradients that the pose explains: " +
                                   shares_text(*problem_, view_values));
  }
  const bool is_sound = lowest_of(view_values, &ViewValue::coarse) >= kWellExplained.coarse &&
                        lowest_of(view_values, &ViewValue::fine) >= kWellExplained.fine;
  // No change mends a copy: what seems to is a body's symmetry.
  if (is_sound || has_copy) return diagnosis;
  // A mirrored shaft is still a shaft, so silhouettes of bones would fit changed X-rays too.
  // Changes are also tried over the whole region, whose values cannot be compared with those in
  // silhouettes.
  if (std::ranges::any_of(view_values, &ViewValue::in_silhouette)) return diagnosis;
  if (!remedy_.has_value()) remedy_ = best_remedy(*problem_, threads_);
  const std::optional<Remedy>& remedy = *remedy_;
  if (remedy.has_value() && mean_of(remedy->view_values) > mean_of(view_values) + kLeastGain)
    diagnosis.messages.push_back(
        remedy->text + " would explain more: " + shares_text(*problem_, remedy->view_values) +
        " instead of " + shares_text(*problem_, view_values));
  return diagnosis;
}

}  // namespace af::registration
