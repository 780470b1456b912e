// SPDX-License-Identifier: Apache-2.0
// A registration from one start to its verdict: what af-register, af-evaluate and the library do.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "base/thread_pool.h"
#include "register/method/registration.h"
#include "register/verdict/pose_examiner.h"
#include "register/verdict/uncertainty_estimator.h"
#include "register/verdict/view_diagnosis.h"

namespace af::registration {

/// Distances of a registration's start and end from the gold pose.
struct TargetErrors {
  std::string gold_source;  ///< "fiducials" or "study" (its gold_room_from_ct)
  double initial_tre_mm = 0.0;
  double tre_mm = 0.0;
};

/// One registration, and what is said of its end.
struct RegistrationRecord {
  std::int64_t start_index = 0;
  RegistrationResult result;
  std::vector<ViewValue> view_values;  ///< of PoseExaminer, at the end
  UncertaintyReport uncertainty;       ///< of UncertaintyEstimator, likewise
  ViewDiagnosis diagnosis;             ///< where X-rays were looked into: diagnose()
  std::optional<TargetErrors> errors;  ///< when the gold pose is known

  /// What the registration itself found; the rest is derived from it.
  auto members() { return std::tie(start_index, result, view_values, uncertainty); }
};

/// The verdict on a record: at least doubtful where the diagnosis found something.
Judgement judgement_of(const RegistrationRecord& record);

/// Looks into X-rays that do not fit the end (diagnose_views()).
void diagnose(const std::shared_ptr<const RegistrationProblem>& problem,
              RegistrationRecord& record);

/// Registers one case from any number of starts and examines the ends. For one thread at a time.
class Registrar {
 public:
  /// As RegistrationRunner and UncertaintyEstimator. `examines`: else records have neither
  /// view_values nor uncertainty.
  Registrar(const std::shared_ptr<const RegistrationProblem>& problem,
            RegistrationRunner runner,
            const UncertaintyOptions& uncertainty,
            const std::shared_ptr<ThreadPool>& pool = nullptr,
            bool examines = true);

  /// `start_index` is a key of random numbers.
  [[nodiscard]] RegistrationRecord run(const RigidTransform& start_room_from_ct,
                                       std::int64_t start_index = 0);
  [[nodiscard]] RegistrationRunner& runner() { return runner_; }
  [[nodiscard]] const RegistrationRunner& runner() const { return runner_; }

 private:
  RegistrationRunner runner_;
  std::optional<PoseExaminer> examiner_;
  std::optional<UncertaintyEstimator> estimator_;
};

}  // namespace af::registration
