// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "register/optimizer/optimizer.h"

namespace af::test {

/// A function as an optimiser's target; it keeps every point asked for.
class FunctionTarget final : public registration::LeastSquaresTarget {
 public:
  using Value = std::function<std::optional<double>(const registration::ScaledParameters&)>;
  using Equations = std::function<registration::TargetValue(const registration::ScaledParameters&)>;

  using Nearest =
      std::function<registration::ScaledParameters(const registration::ScaledParameters&)>;

  /// `nearest` clamps a point to the known limits; without it there are none.
  explicit FunctionTarget(Value value, Equations equations = {}, Nearest nearest = {})
      : value_(std::move(value)), equations_(std::move(equations)), nearest_(std::move(nearest)) {}

  [[nodiscard]] registration::ScaledParameters nearest_admissible(
      const registration::ScaledParameters& point) const override {
    return nearest_ ? nearest_(point) : point;
  }

  std::optional<double> evaluate(const registration::ScaledParameters& point) override {
    points.push_back(point);
    return value_(point);
  }
  std::optional<registration::TargetValue> evaluate_with_gradient(
      const registration::ScaledParameters& point) override {
    return evaluate_with_normal_equations(point);
  }
  std::optional<registration::TargetValue> evaluate_with_normal_equations(
      const registration::ScaledParameters& point) override {
    const std::optional<double> value = evaluate(point);
    if (!value.has_value()) return std::nullopt;
    registration::TargetValue result = equations_(point);
    result.value = *value;
    return result;
  }

  std::vector<registration::ScaledParameters> points;

 private:
  Value value_;
  Equations equations_;
  Nearest nearest_;
};

}  // namespace af::test
