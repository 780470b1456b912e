// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/thread_pool.h"
#include "drr/drr_renderer.h"
#include "drr/field_level.h"
#include "field/compressed_attenuation_field.h"

namespace af {

/// The ways of looking DRRs up that programs offer, and one line that explains them.
std::vector<std::string> field_look_up_names();
std::string field_look_up_help();

/// How a search looks a field up that is meant for `own`: by `cubic-sum` where several slabs are
/// meant for `cubic`. A search needs the slopes, too, and `cubic` puts nodes between those of all
/// three images. Over 64 poses of five anatomies ends by `cubic-sum` are as near to the truth
/// (docs/rate-against-truth.md#the-default-design).
std::string look_up_of_searches(const std::string& own, std::size_t slab_count);

/// The renderer for a name of field_look_up_names(); InputError for any other name. The threads of
/// `pool` share a large DRR, except for "nearest" and "quadrilinear".
std::shared_ptr<const DrrRenderer> make_field_renderer(
    std::shared_ptr<const CompressedAttenuationField> field,
    const std::string& look_up,
    const std::shared_ptr<ThreadPool>& pool = nullptr);

/// The same of a decoded field, whose names have no "nearest" and no "quadrilinear".
std::shared_ptr<const DrrRenderer> make_field_renderer(
    std::shared_ptr<const FieldLevel> level_0,
    const std::string& look_up,
    const std::shared_ptr<ThreadPool>& pool = nullptr);

}  // namespace af
