// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/registrar.h"

#include <utility>

namespace af::registration {

Judgement judgement_of(const RegistrationRecord& record) {
  return judgement_of(record.result, record.view_values, record.diagnosis);
}

void diagnose(const std::shared_ptr<const RegistrationProblem>& problem,
              RegistrationRecord& record) {
  const RegistrationResult& result = record.result;
  if (!record.view_values.empty() && result.evaluations > 0)
    record.diagnosis =
        diagnose_views(problem, result.start_room_from_ct, result.room_from_ct, record.view_values);
}

Registrar::Registrar(const std::shared_ptr<const RegistrationProblem>& problem,
                     RegistrationRunner runner,
                     const UncertaintyOptions& uncertainty,
                     const std::shared_ptr<ThreadPool>& pool,
                     bool examines)
    : runner_(std::move(runner)) {
  if (!examines) return;
  examiner_.emplace(*problem, runner_.options().silhouette_mm());
  estimator_.emplace(problem, runner_.options(), uncertainty, pool);
}

RegistrationRecord Registrar::run(const RigidTransform& start_room_from_ct,
                                  std::int64_t start_index) {
  RegistrationRecord record;
  record.start_index = start_index;
  record.result = runner_.run(start_room_from_ct, start_index);
  if (!examiner_) return record;
  record.view_values = examiner_->view_values(record.result.room_from_ct, estimator_->is_on());
  record.uncertainty = estimator_->report(record.result, record.view_values);
  return record;
}

}  // namespace af::registration
