// SPDX-License-Identifier: Apache-2.0
// Which patient a case belongs to. The patient is the unit that is sampled.
#pragma once

#include <cstddef>
#include <string>

namespace af::evaluation {

/// How many digits a name ends with.
std::size_t digits_at_end(const std::string& name);

/// The patient of a case: its name without a trailing "-pN", which says which true pose.
std::string patient_of_case(const std::string& case_name);

}  // namespace af::evaluation
