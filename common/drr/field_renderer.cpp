// SPDX-License-Identifier: Apache-2.0
#include "drr/field_renderer.h"

#include <array>

#include "base/named_rows.h"
#include "drr/af_drr.h"
#include "drr/two_pass_af_drr.h"

namespace af {
namespace {

using FieldPointer = std::shared_ptr<const CompressedAttenuationField>;
using RendererPointer = std::shared_ptr<const DrrRenderer>;
using PoolPointer = std::shared_ptr<ThreadPool>;

struct KnownLookUp {
  const char* name;
  const char* help;
  RendererPointer (*make)(FieldPointer field, const PoolPointer& pool);
};

template <FieldInterpolation interpolation>
RendererPointer make_literal(FieldPointer field, const PoolPointer& /*pool*/) {
  return std::make_shared<const AfDrr>(std::move(field), interpolation);
}
template <AxisInterpolation st, AxisInterpolation uv>
RendererPointer make_two_pass(FieldPointer field, const PoolPointer& pool) {
  return std::make_shared<const TwoPassAfDrr>(std::move(field), TwoPassOptions{st, uv}, pool);
}

using enum AxisInterpolation;

/// Every way of looking up there is; a new one joins here.
constexpr std::array kLookUps = {
    KnownLookUp{"nearest", "nearest node", make_literal<FieldInterpolation::Nearest>},
    KnownLookUp{"linear", "linear, in two passes", make_two_pass<Linear, Linear>},
    KnownLookUp{"cubic", "cubic over (s,t)", make_two_pass<Cubic, Linear>},
    KnownLookUp{"cubic-uv", "cubic over (s,t) and (u,v)", make_two_pass<Cubic, Cubic>},
    KnownLookUp{"quadrilinear",
                "over each ray's 16 nodes, the definition",
                make_literal<FieldInterpolation::Quadrilinear>},
};

}  // namespace

std::vector<std::string> field_look_up_names() {
  return names_of(kLookUps);
}

std::string field_look_up_help() {
  return help_of(kLookUps);
}

RendererPointer make_field_renderer(FieldPointer field,
                                    const std::string& look_up,
                                    const PoolPointer& pool) {
  return required_row(kLookUps, "look-up", look_up).make(std::move(field), pool);
}

}  // namespace af
