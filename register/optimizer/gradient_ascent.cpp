// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/gradient_ascent.h"

#include <algorithm>
#include <array>
#include <deque>

#include "register/optimizer/search_run.h"

namespace af::registration {
namespace {

constexpr std::size_t kMemory = 6;
/// A step counts when the value rises by this share of what the gradient promises.
constexpr double kSufficientRise = 1e-4;
/// First step after the memory was dropped, in units of the final step.
constexpr double kRestartLength = 8.0;

/// One accepted step and the fall of the gradient along it.
struct Change {
  ScaledParameters step;
  ScaledParameters fall;
};

/// The two-loop recursion: inverse curvature times gradient.
ScaledParameters ascent_direction(const std::deque<Change>& changes,
                                  const ScaledParameters& gradient) {
  ScaledParameters direction = gradient;
  std::array<double, kMemory> shares{};
  for (std::size_t i = changes.size(); i-- > 0;) {
    shares[i] = changes[i].step.dot(direction) / changes[i].step.dot(changes[i].fall);
    direction -= shares[i] * changes[i].fall;
  }
  if (!changes.empty()) {
    const Change& last = changes.back();
    direction *= last.step.dot(last.fall) / last.fall.squaredNorm();
  }
  for (std::size_t i = 0; i < changes.size(); ++i) {
    const double share = changes[i].fall.dot(direction) / changes[i].step.dot(changes[i].fall);
    direction += (shares[i] - share) * changes[i].step;
  }
  return direction;
}

/// The step, bounded by the longest length allowed. The first step of a search has that length.
ScaledParameters bounded_step(const std::deque<Change>& changes,
                              const ScaledParameters& gradient,
                              double longest_mm) {
  ScaledParameters direction = ascent_direction(changes, gradient);
  const double length = direction.norm();
  if (!(length > 0.0)) return ScaledParameters::Zero();
  if (changes.empty() || length > longest_mm) return direction * (longest_mm / length);
  return direction;
}

void remember(const ScaledParameters& step,
              const ScaledParameters& fall,
              std::deque<Change>& changes) {
  // Only changes of positive curvature keep the approximation positive definite.
  if (!(step.dot(fall) > 1e-12 * step.norm() * fall.norm())) return;
  changes.push_back({step, fall});
  if (changes.size() > kMemory) changes.pop_front();
}

}  // namespace

void gradient_ascent(DifferentiableTarget& target,
                     const OptimizerOptions& options,
                     const SearchBudget& budget,
                     OptimizerResult& result) {
  SearchRun run(target, budget, result);
  const SearchRun::WithDerivatives with_gradient = [&](const ScaledParameters& point) {
    return target.evaluate_with_gradient(point);
  };
  std::optional<TargetValue> at = run.begin(with_gradient);
  if (!at) return;
  std::deque<Change> changes;
  bool met_limit = false;
  ScaledParameters step = bounded_step(changes, at->gradient, options.initial_step_mm);
  for (;;) {
    const double length = step.norm();
    const ScaledParameters point = run.stepped(step);
    const ScaledParameters moved = point - result.point;
    const SearchRun::Evaluation next = run.evaluate(point, with_gradient);
    if (next.outcome == SearchRun::Outcome::Ended) {
      run.trace(length);
      return;
    }
    const bool is_inadmissible = next.outcome == SearchRun::Outcome::Inadmissible;
    const bool rises =
        !is_inadmissible &&
        next.target.value > result.value + kSufficientRise * std::max(0.0, moved.dot(at->gradient));
    if (rises) {
      run.accept(point, next.target.value);
      remember(moved, at->gradient - next.target.gradient, changes);
      at = next.target;
      step = bounded_step(changes, at->gradient, options.initial_step_mm);
      met_limit = false;
    } else {
      step /= 2.0;
      met_limit = is_inadmissible;
    }
    run.trace(length);
    if (step.norm() >= options.final_step_mm) continue;
    if (changes.empty()) {
      run.converge(met_limit, options.final_step_mm);
      return;
    }
    // A memory of well-known directions gives short steps too, so the gradient decides last.
    changes.clear();
    step = at->gradient.normalized() * (kRestartLength * options.final_step_mm);
  }
}

}  // namespace af::registration
