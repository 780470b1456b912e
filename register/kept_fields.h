// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>

#include "drr/opened_field.h"
#include "study/study_file.h"

namespace af::registration {

/// Fields that stay open from one case of a study to the next. Cases of one patient at several
/// poses share them, and opening one takes longer than dozens of registrations. Keeps the indices
/// and decoded samples of fields that both the current case and a later one use, by the study's
/// `field` keys.
/// \test KeptFields.AreThoseOfTheCaseAtHandThatALaterOneUses
class KeptFields {
 public:
  /// `cases`: all cases that will be loaded.
  explicit KeptFields(std::span<const StudyCase> cases);

  /// Makes a case the current one and releases fields that it does not use.
  void begin_case(const StudyCase& study_case);
  /// Null when the field must be opened.
  [[nodiscard]] std::shared_ptr<const OpenedField> find(const std::string& path) const;
  /// Adds a field that the current case uses, found or opened.
  void add(const std::string& path, const std::shared_ptr<const OpenedField>& field);

 private:
  std::map<std::string, int> cases_left_;  ///< how many cases use a path and have not begun
  std::map<std::string, std::shared_ptr<const OpenedField>> fields_;
};

}  // namespace af::registration
