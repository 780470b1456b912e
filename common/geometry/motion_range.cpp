// SPDX-License-Identifier: Apache-2.0
#include "geometry/motion_range.h"

#include <algorithm>
#include <sstream>
#include <string_view>

namespace af {

/// Length of a parameter's name without its unit: "rx".
constexpr std::size_t kNameLength = 2;

MotionRange::MotionRange(double max_rotation_rad, double max_translation_mm)
    : low{Eigen::Vector3d::Constant(-max_rotation_rad),
          Eigen::Vector3d::Constant(-max_translation_mm)},
      high{Eigen::Vector3d::Constant(max_rotation_rad),
           Eigen::Vector3d::Constant(max_translation_mm)} {}

std::string parameter_names(const ParameterSet& parameters) {
  std::string names;
  for (std::size_t i = 0; i < parameters.size(); ++i)
    if (parameters[i])
      names.append(names.empty() ? "" : ", ").append(kParameterNames[i], kNameLength);
  return names;
}

ParameterSet MotionRange::beyond(const PoseParameters& parameters) const {
  // The conversion from degrees rounds. A start given exactly at the limit must still lie within.
  constexpr double kRounding = 1e-12;
  const auto is_between = [](double value, double lowest, double most) {
    return value >= lowest - kRounding && value <= most + kRounding;
  };
  ParameterSet found;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    found[i] =
        !is_between(parameters.rotation_rad[axis], low.rotation_rad[axis], high.rotation_rad[axis]);
    found[i + 3] = !is_between(
        parameters.translation_mm[axis], low.translation_mm[axis], high.translation_mm[axis]);
  }
  return found;
}

double MotionRange::max_rotation_rad() const {
  return std::max(-low.rotation_rad.minCoeff(), high.rotation_rad.maxCoeff());
}

double MotionRange::max_translation_mm() const {
  return std::max(-low.translation_mm.minCoeff(), high.translation_mm.maxCoeff());
}

MotionRange MotionRange::symmetric_part() const {
  if (is_symmetric()) return *this;
  const auto reach = [](const Eigen::Vector3d& lowest, const Eigen::Vector3d& most) {
    return std::max(0.0, std::min(-lowest.maxCoeff(), most.minCoeff()));
  };
  return {reach(low.rotation_rad, high.rotation_rad),
          reach(low.translation_mm, high.translation_mm)};
}

bool MotionRange::is_symmetric() const {
  const auto is_one_number = [](const Eigen::Vector3d& lowest, const Eigen::Vector3d& most) {
    return lowest == -most && most == Eigen::Vector3d::Constant(most.x());
  };
  return is_one_number(low.rotation_rad, high.rotation_rad) &&
         is_one_number(low.translation_mm, high.translation_mm);
}

MotionRange MotionRange::scaled(double factor) const {
  const auto times = [&](const PoseParameters& bound) {
    return PoseParameters{factor * bound.rotation_rad, factor * bound.translation_mm};
  };
  return {times(low), times(high)};
}

PoseParameters MotionRange::clamped(const PoseParameters& parameters, double share) const {
  const auto clamp = [&](const Eigen::Vector3d& value,
                         const Eigen::Vector3d& lowest,
                         const Eigen::Vector3d& most) {
    const Eigen::Vector3d middle = 0.5 * (lowest + most);
    const Eigen::Vector3d half = share * (0.5 * (most - lowest));
    return Eigen::Vector3d(value.cwiseMax(middle - half).cwiseMin(middle + half));
  };
  return {clamp(parameters.rotation_rad, low.rotation_rad, high.rotation_rad),
          clamp(parameters.translation_mm, low.translation_mm, high.translation_mm)};
}

std::string MotionRange::text() const {
  std::ostringstream out;
  out.precision(4);
  if (is_symmetric()) {
    out << "+-" << max_rotation_rad() * kDegPerRad << " degrees, +-" << max_translation_mm()
        << " mm";
    return out.str();
  }
  const std::array<double, 6> from = low.deg_and_mm();
  const std::array<double, 6> to = high.deg_and_mm();
  for (std::size_t i = 0; i < from.size(); ++i) {
    out << (i == 0   ? ""
            : i == 3 ? " degrees, "
                     : " ")
        << std::string_view(kParameterNames[i], kNameLength) << ' ' << from[i] << " to " << to[i];
    if (i + 1 == from.size()) out << " mm";
  }
  return out.str();
}

std::vector<std::string> problems(const MotionRange& range) {
  std::vector<std::string> found;
  constexpr double kMostTurnDeg = 180.0;
  constexpr double kMostShiftMm = 1000.0;
  if (range.is_symmetric()) {
    if (!(range.max_rotation_rad() >= 0.0 && range.max_rotation_rad() <= 60.0 * kRadPerDeg))
      found.push_back(
          "max_rotation_deg = " + std::to_string(range.max_rotation_rad() * kDegPerRad) +
          ": must be between 0 and 60");
    if (!(range.max_translation_mm() >= 0.0 && range.max_translation_mm() <= kMostShiftMm))
      found.push_back("max_translation_mm = " + std::to_string(range.max_translation_mm()) +
                      ": must be between 0 and 1000");
    return found;
  }
  const std::array<double, 6> from = range.low.deg_and_mm();
  const std::array<double, 6> to = range.high.deg_and_mm();
  for (std::size_t i = 0; i < from.size(); ++i) {
    const double most = i < 3 ? kMostTurnDeg : kMostShiftMm;
    if (from[i] >= -most && to[i] <= most && from[i] <= to[i]) continue;
    found.push_back("range of " + std::string(kParameterNames[i]) + " = " +
                    std::to_string(from[i]) + " to " + std::to_string(to[i]) +
                    ": must ascend, between -" + std::to_string(static_cast<int>(most)) + " and " +
                    std::to_string(static_cast<int>(most)));
  }
  return found;
}

PoseParameters pose_at(const MotionRange& range, const std::array<double, 6>& share) {
  const auto between = [](double low, double high, double x) { return low + (high - low) * x; };
  PoseParameters parameters;
  for (int i = 0; i < 3; ++i) {
    const auto p = static_cast<std::size_t>(i);
    parameters.rotation_rad[i] =
        between(range.low.rotation_rad[i], range.high.rotation_rad[i], share[p]);
    parameters.translation_mm[i] =
        between(range.low.translation_mm[i], range.high.translation_mm[i], share[p + 3]);
  }
  return parameters;
}

PoseParameters corner_pose(const MotionRange& range, unsigned corner) {
  const auto bound = [&](unsigned parameter) -> const PoseParameters& {
    return (corner >> parameter & 1u) != 0 ? range.high : range.low;
  };
  PoseParameters parameters;
  for (unsigned axis = 0; axis < 3; ++axis) {
    parameters.rotation_rad[axis] = bound(axis).rotation_rad[axis];
    parameters.translation_mm[axis] = bound(axis + 3).translation_mm[axis];
  }
  return parameters;
}

PoseParameters random_pose(const MotionRange& range, HashRandom& random) {
  std::array<double, 6> share{};
  for (double& of_axis : share) of_axis = random.uniform();
  return pose_at(range, share);
}

}  // namespace af
