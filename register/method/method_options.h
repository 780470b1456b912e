// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "register/method/registration_options.h"

namespace af::registration {

/// How to register, as typed: a preset, and what replaces parts of it.
struct MethodOptions {
  std::optional<std::string> preset;  ///< see preset_name()
  std::vector<std::string> chains;    ///< chain_from_text(): replace the preset's chains and finish
  std::optional<std::string> finish;  ///< chain_from_text(): replaces the preset's finish
  std::optional<std::string> judge;   ///< one stage's text: replaces the portfolio's judge
  std::optional<std::string> similarity;     ///< for every stage
  std::optional<std::string> optimizer;      ///< for every stage
  std::optional<double> smoothing_sigma_mm;  ///< for each chain's first stage
  std::optional<int> max_evaluations;
  std::optional<std::string> region;  ///< "target": follows the target; "study": stays
  /// Radius, mm on the isocentre plane, of the discs about fiducials that registration does not
  /// see.
  double fiducial_mask_mm = 4.0;
  // A portfolio's judge rejects ends at or below the first value. An end at or above the second
  // ends the portfolio.
  std::optional<double> judge_least_value;
  std::optional<double> judge_enough_value;
  std::uint64_t seed = 1;
  int threads = 1;  ///< threads of one registration; 0: every processor of this process

  /// The preset that was typed. Otherwise it is robust, or paper when a measure or an optimiser was
  /// typed, because one measure or optimiser for every stage suits the paper's method only.
  [[nodiscard]] std::string preset_name() const;

  void describe(Fields& field);
  /// These options with preset and budget set. All chains, finish and judge are given as text,
  /// which includes the other replacements. Throws as resolve() does.
  [[nodiscard]] MethodOptions in_force() const;
};

/// The preset with the replacements. Throws InputError for unknown names and values out of range.
RegistrationOptions resolve(const MethodOptions& options);

}  // namespace af::registration
