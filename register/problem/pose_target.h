// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "register/problem/multi_view_objective.h"
#include "register/problem/parameter_scaling.h"

namespace af::registration {

/// The poses that a stage searches: scaled parameters about the stage's start, judged by its
/// objective. \test PoseTarget.DerivativesAreThoseOfItsValue
class PoseTarget final : public OptimizationTarget {
 public:
  PoseTarget(MultiViewObjective& objective, PoseFrame frame, const ParameterScaling& scaling);

  std::optional<double> evaluate(const ScaledParameters& point) override;
  void evaluate_all(std::span<const ScaledParameters> points,
                    std::span<std::optional<double>> values) override;
  std::optional<TargetValue> evaluate_with(const ScaledParameters& point,
                                           Derivatives derivatives) override;
  /// Clamps to the motion ranges of all views.
  [[nodiscard]] ScaledParameters nearest_admissible(const ScaledParameters& point) const override;

  [[nodiscard]] RigidTransform pose(const ScaledParameters& point) const;
  [[nodiscard]] std::int64_t drr_count() const { return drr_count_; }
  /// Of the latest evaluation.
  [[nodiscard]] std::int64_t rays_outside() const { return rays_outside_; }

 private:
  void count(const ObjectiveValue& value);

  MultiViewObjective& objective_;
  PoseFrame frame_;
  ParameterScaling scaling_;
  std::int64_t drr_count_ = 0;
  std::int64_t rays_outside_ = 0;
  std::vector<RigidTransform> poses_;   ///< reused
  std::vector<ObjectiveValue> values_;  ///< reused
};

}  // namespace af::registration
