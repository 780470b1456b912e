// SPDX-License-Identifier: Apache-2.0
#include "drr/field_renderer.h"

#include <array>

#include "base/error.h"
#include "base/named_rows.h"
#include "drr/ray_by_ray_af_drr.h"
#include "drr/two_pass_af_drr.h"

namespace af {
namespace {

using FieldPointer = std::shared_ptr<const CompressedAttenuationField>;
using LevelPointer = std::shared_ptr<const FieldLevel>;
using RendererPointer = std::shared_ptr<const DrrRenderer>;
using PoolPointer = std::shared_ptr<ThreadPool>;

struct KnownLookUp {
  const char* name = nullptr;
  const char* help = nullptr;
  /// The look-up that searches take instead where there are several slabs. Null: this one.
  const char* of_searches = nullptr;
  RendererPointer (*make)(FieldPointer field, const PoolPointer& pool) = nullptr;
  RendererPointer (*make_decoded)(LevelPointer level_0, const PoolPointer& pool) = nullptr;
};

template <FieldInterpolation interpolation>
RendererPointer make_literal(FieldPointer field, const PoolPointer& /*pool*/) {
  return std::make_shared<const RayByRayAfDrr>(std::move(field), interpolation);
}
template <typename Pointer, TwoPassOptions options>
RendererPointer make_two_pass(Pointer samples, const PoolPointer& pool) {
  return std::make_shared<const TwoPassAfDrr>(std::move(samples), options, pool);
}
template <TwoPassOptions options>
constexpr KnownLookUp two_pass(const char* name,
                               const char* help,
                               const char* of_searches = nullptr) {
  return {name,
          help,
          of_searches,
          make_two_pass<FieldPointer, options>,
          make_two_pass<LevelPointer, options>};
}

using enum AxisInterpolation;

/// Every way of looking up. A new one is added here.
constexpr std::array kLookUps = {
    KnownLookUp{
        "nearest", "nearest node", nullptr, make_literal<FieldInterpolation::Nearest>, nullptr},
    two_pass<TwoPassOptions{Linear, Linear}>("linear", "linear, in two passes"),
    two_pass<TwoPassOptions{Linear, Linear, true}>("cubic-sum", "linear, on a quarter more nodes"),
    two_pass<TwoPassOptions{Cubic, Linear}>("cubic", "cubic over (s,t)", "cubic-sum"),
    two_pass<TwoPassOptions{Cubic, Cubic}>("cubic-uv", "cubic over (s,t) and (u,v)"),
    KnownLookUp{"quadrilinear",
                "16 nodes of each ray, slow",
                nullptr,
                make_literal<FieldInterpolation::Quadrilinear>,
                nullptr},
};

}  // namespace

std::vector<std::string> field_look_up_names() {
  return names_of(kLookUps);
}

std::string field_look_up_help() {
  return help_of(kLookUps);
}

std::string look_up_of_searches(const std::string& own, std::size_t slab_count) {
  const char* of_several = required_row(kLookUps, "look-up", own).of_searches;
  return slab_count > 1 && of_several != nullptr ? of_several : own;
}

RendererPointer make_field_renderer(FieldPointer field,
                                    const std::string& look_up,
                                    const PoolPointer& pool) {
  return required_row(kLookUps, "look-up", look_up).make(std::move(field), pool);
}

RendererPointer make_field_renderer(LevelPointer level_0,
                                    const std::string& look_up,
                                    const PoolPointer& pool) {
  const KnownLookUp& known = required_row(kLookUps, "look-up", look_up);
  if (known.make_decoded == nullptr)
    throw InputError(
        "look-up", "'" + look_up + "'", "a decoded field is not looked up in this way");
  return known.make_decoded(std::move(level_0), pool);
}

}  // namespace af
