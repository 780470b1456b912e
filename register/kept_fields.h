// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>

#include "base/thread_pool.h"
#include "drr/opened_field.h"
#include "register/case_renderers.h"
#include "study/study_file.h"

namespace af::registration {

/// A field that is open, with its renderers.
struct FieldInUse {
  OpenedField opened;
  std::optional<std::string> bone_sha256;  ///< payload of the bone's part, where that is used
  FieldRenderers renderers;
};

/// Fields that stay open from one case of a study to the next: cases of one patient at several
/// poses share them, and opening one takes longer than dozens of registrations. Keeps the indices
/// and decoded samples of fields that both the current case and a later one use, by the study's
/// `field` keys. All cases must be loaded with the same options, and with this object's threads.
/// \test KeptFields.AreThoseOfTheCaseAtHandThatALaterOneUses
class KeptFields {
 public:
  /// `cases`: all that will be loaded; `pool`: threads of the renderers, which outlive a case.
  KeptFields(std::span<const StudyCase> cases, std::shared_ptr<ThreadPool> pool);

  [[nodiscard]] const std::shared_ptr<ThreadPool>& pool() const { return pool_; }

  /// Makes a case the current one and releases fields that it does not use.
  void begin_case(const StudyCase& study_case);
  /// Null when the field must be opened.
  [[nodiscard]] std::shared_ptr<const FieldInUse> find(const std::string& path) const;
  /// A field that the case at hand uses, found or opened; not an atlas, whose renderers depend on
  /// the case's nominal pose.
  void add(const std::string& path, const std::shared_ptr<const FieldInUse>& field);

 private:
  std::shared_ptr<ThreadPool> pool_;
  std::map<std::string, int> cases_left_;  ///< that use a path and have not begun
  std::map<std::string, std::shared_ptr<const FieldInUse>> fields_;
};

}  // namespace af::registration
