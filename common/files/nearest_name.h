// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>
#include <string>
#include <string_view>

namespace af {

/// The known name that somebody who typed `name` probably meant; empty when none is similar.
std::string nearest_name(std::string_view name, const std::set<std::string>& known);

}  // namespace af
