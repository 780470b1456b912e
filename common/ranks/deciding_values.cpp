// SPDX-License-Identifier: Apache-2.0
#include "ranks/deciding_values.h"

#include <array>

#include "base/build_info.h"
#include "base/number_text.h"
#include "files/sha256.h"

namespace af {
namespace {

std::string program_build() {
  constexpr std::size_t kDigits = 16;
  static const std::string build = std::string(program_version()) + " build " +
                                   sha256_of_file("/proc/self/exe").substr(0, kDigits);
  return build;
}

std::string text(const std::string& value) {
  return value;
}

std::string text(const Eigen::Vector3d& numbers) {
  return "[" + number_text(numbers.x()) + ", " + number_text(numbers.y()) + ", " +
         number_text(numbers.z()) + "]";
}

/// The message about a value where `other` was expected; empty when they are the same.
std::string difference(const std::string& other, const std::string& value) {
  return value == other ? "" : text(value);
}

std::string difference(const Eigen::Vector3d& other, const Eigen::Vector3d& value) {
  return is_same_place(other, value) ? "" : text(value);
}

std::string difference(const CtIdentity& other, const CtIdentity& value) {
  return ct_difference(other, value);
}

template <typename One, typename Other>
std::string difference(const One& /*other*/, const Other& value) {
  return text(value);
}

std::string text(const DecidingValue& value) {
  return std::visit([](const auto& one) { return text(one); }, value);
}

DecidingValue deciding_value_of(const nlohmann::json& json) {
  if (json.is_object()) return ct_identity_of(json);
  if (!json.is_array()) return json.get<std::string>();
  const auto numbers = json.get<std::array<double, 3>>();
  return Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
}

nlohmann::json json_of(const std::string& value) {
  return value;
}

nlohmann::json json_of(const Eigen::Vector3d& numbers) {
  return {numbers.x(), numbers.y(), numbers.z()};
}

nlohmann::json json_of(const CtIdentity& ct) {
  return to_json(ct);
}

}  // namespace

DecidingValues deciding_values(const OptionTexts& options, const InputIdentities& inputs) {
  DecidingValues values(options.begin(), options.end());
  values["program"] = program_build();
  for (const auto& [name, input] : inputs) {
    if (const auto* const hash = std::get_if<std::string>(&input))
      values["SHA-256 of " + name] = *hash;
    else
      values["CT '" + name + "'"] = std::get<CtIdentity>(input);
  }
  return values;
}

std::vector<std::string> differences(const DecidingValues& earlier, const DecidingValues& now) {
  std::vector<std::string> found;
  const auto add = [&](const std::string& name, const std::string& value, const std::string& was) {
    found.push_back(name + " = " + value + ": the unfinished work was begun with " + was);
  };
  for (const auto& [name, value] : now) {
    const auto before = earlier.find(name);
    if (before == earlier.end()) {
      add(name, text(value), "nothing");
      continue;
    }
    const std::string differs = std::visit(
        [](const auto& was, const auto& is) { return difference(was, is); }, before->second, value);
    if (!differs.empty()) add(name, differs, text(before->second));
  }
  for (const auto& [name, value] : earlier)
    if (!now.contains(name)) add(name, "nothing", text(value));
  return found;
}

nlohmann::json to_json(const DecidingValues& values) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [name, value] : values)
    json[name] = std::visit([](const auto& one) { return json_of(one); }, value);
  return json;
}

DecidingValues deciding_values_of(const nlohmann::json& json) {
  DecidingValues values;
  for (const auto& [name, value] : json.items()) values[name] = deciding_value_of(value);
  return values;
}

}  // namespace af
