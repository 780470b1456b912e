// SPDX-License-Identifier: Apache-2.0
#include "precompute/build/orbit_text.h"

#include <map>
#include <optional>
#include <sstream>

#include "base/error.h"
#include "base/parsed_number.h"

namespace af {

Orbit orbit_of_text(const std::string& option, const std::string& text) {
  const auto refuse = [&](const std::string& why) {
    throw UsageError(option + " " + text + ": " + why +
                     "; as axis=z,from=-90,to=90 or axis=z,from=-90,to=90,step=20, degrees, and "
                     "members=by-source or by-pose");
  };
  Orbit orbit;
  std::map<std::string, double> angles_deg;
  bool has_axis = false;
  bool has_members = false;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    const std::size_t equals = std::min(part.find('='), part.size());
    const std::string key = part.substr(0, equals);
    const std::string value = equals < part.size() ? part.substr(equals + 1) : "";
    if (key == "axis" && !has_axis) {
      const std::size_t axis = value.size() == 1 ? std::string("xyz").find(value) : value.npos;
      if (axis == std::string::npos) refuse("the axis is x, y or z of the room");
      orbit.axis = static_cast<int>(axis);
      has_axis = true;
      continue;
    }
    if (key == "members" && !has_members) {
      if (value != "by-source" && value != "by-pose") refuse("members are by-source or by-pose");
      orbit.members_by = value == "by-pose" ? Orbit::MembersBy::Pose : Orbit::MembersBy::Source;
      has_members = true;
      continue;
    }
    const bool is_known = key == "from" || key == "to" || key == "step";
    if (!is_known || angles_deg.contains(key)) refuse("'" + part + "' is not understood");
    const std::optional<double> angle = finite_number(value);
    if (!angle) refuse("'" + part + "' needs a number");
    angles_deg[key] = *angle;
  }
  for (const char* needed : {"from", "to"})
    if (!angles_deg.contains(needed)) refuse(std::string("'") + needed + "' is missing");
  if (!has_axis) refuse("'axis' is missing");
  if (angles_deg["to"] < angles_deg["from"]) refuse("'to' is below 'from'");
  orbit.from_rad = angles_deg["from"] * kRadPerDeg;
  orbit.to_rad = angles_deg["to"] * kRadPerDeg;
  if (!angles_deg.contains("step")) return orbit;
  if (!(angles_deg["step"] > 0.0)) refuse("the step must be positive");
  orbit.step_rad = angles_deg["step"] * kRadPerDeg;
  return orbit;
}

}  // namespace af
