// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/thread_pool.h"
#include "register/problem/registration_problem.h"
#include "register/verdict/verdict.h"

namespace af::registration {

/// What looks wrong with the X-rays of a result.
struct ViewDiagnosis {
  std::vector<std::string> messages;  ///< one for each thing found, for people
};

/// A change of the X-rays that is not made, and what a pose would explain of them with it.
struct Remedy {
  std::string text;  ///< "the X-ray of view 'B' mirrored left-right"
  std::vector<ViewValue> view_values;
};

/// Looks into the X-rays of a case where they do not fit the ends of its registrations. Nothing of
/// the case changes. For one thread at a time.
/// \test ViewDiagnoser.NamesTheViewAndWhatWouldMendIt
class ViewDiagnoser {
 public:
  /// Without `threads` only the calling thread works.
  explicit ViewDiagnoser(std::shared_ptr<const RegistrationProblem> problem,
                         std::shared_ptr<ThreadPool> threads = nullptr);

  /// `view_values`: those of PoseExaminer, at an end. Where one of them is low, reports the change
  /// of X-rays that explains most, if that is far more than this end does. Values within
  /// silhouettes are not compared. Always reports views with the same X-ray.
  ///
  /// The X-rays are tried inverted, mirrored left-right and up-down, turned by 180 degrees and
  /// exchanged, one change at a time, each with a coarse registration from the nominal pose. The
  /// outcome depends on the case alone, neither on the end nor on those diagnosed before, and is
  /// kept from the first time that it is needed.
  /// \test ViewDiagnoser.TriesChangesOncePerCase
  [[nodiscard]] ViewDiagnosis diagnosis(const std::vector<ViewValue>& view_values);

 private:
  std::shared_ptr<const RegistrationProblem> problem_;
  std::shared_ptr<ThreadPool> threads_;
  /// None: not looked for yet. Holding none: no change lets a pose explain enough of every view.
  std::optional<std::optional<Remedy>> remedy_;
};

}  // namespace af::registration
