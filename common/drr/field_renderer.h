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

/// Names of the look-ups that programs offer, and one line that explains them.
std::vector<std::string> field_look_up_names();
std::string field_look_up_help();

/// The look-up that a search uses in a field meant for `own`: `cubic-sum` instead of `cubic` where
/// there are several slabs, otherwise `own`. A search also needs the slopes, and `cubic` inserts
/// nodes into all three images. Over 64 poses of five anatomies, searches by `cubic-sum` end as
/// near to the truth (docs/other-designs.md#eight-slabs).
std::string look_up_of_searches(const std::string& own, std::size_t slab_count);

/// The renderer for a name of field_look_up_names(). Throws InputError for any other name. The
/// threads of `pool` share a large DRR, except for "nearest" and "quadrilinear".
std::shared_ptr<const DrrRenderer> make_field_renderer(
    std::shared_ptr<const CompressedAttenuationField> field,
    const std::string& look_up,
    const std::shared_ptr<ThreadPool>& pool = nullptr);

/// The same for a decoded field, which has neither "nearest" nor "quadrilinear".
std::shared_ptr<const DrrRenderer> make_field_renderer(
    std::shared_ptr<const FieldLevel> level_0,
    const std::string& look_up,
    const std::shared_ptr<ThreadPool>& pool = nullptr);

}  // namespace af
