// SPDX-License-Identifier: Apache-2.0
#include "drr/field_renderer.h"

#include "base/error.h"
#include "drr/af_drr.h"
#include "drr/two_pass_af_drr.h"

namespace af {

const std::vector<std::string>& field_look_up_names() {
  static const std::vector<std::string> names{
      "nearest", "linear", "cubic", "cubic-uv", "quadrilinear"};
  return names;
}

std::shared_ptr<const DrrRenderer> make_field_renderer(
    std::shared_ptr<const CompressedAttenuationField> field,
    const std::string& look_up,
    std::shared_ptr<ThreadPool> pool) {
  using enum AxisInterpolation;
  const auto make = [&](const TwoPassOptions& options) {
    return std::make_shared<const TwoPassAfDrr>(std::move(field), options, std::move(pool));
  };
  if (look_up == "nearest")
    return std::make_shared<const AfDrr>(std::move(field), FieldInterpolation::Nearest);
  if (look_up == "quadrilinear")
    return std::make_shared<const AfDrr>(std::move(field), FieldInterpolation::Quadrilinear);
  if (look_up == "linear") return make(TwoPassOptions{Linear, Linear});
  if (look_up == "cubic") return make(TwoPassOptions{Cubic, Linear});
  if (look_up == "cubic-uv") return make(TwoPassOptions{Cubic, Cubic});
  throw InputError("look-up", look_up, "must be nearest, linear, cubic, cubic-uv or quadrilinear");
}

}  // namespace af
