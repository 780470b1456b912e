// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "evaluate/methods/evaluated_methods.h"
#include "parallel/communicator.h"
#include "register/method/registration.h"

namespace af::evaluation {

/// One renderer with everything that is needed to register a case with it.
struct LoadedMethod {
  std::string renderer;  ///< "field" or "raycast"
  registration::RegistrationRunner runner;
  std::shared_ptr<const registration::RegistrationProblem> problem;  ///< the runner's
};

/// Collective. The methods of a case, in the order of chosen_renderers(); hashes of the inputs go
/// to `input_sha256`, as "CASE: what". Look-up is corrected where `correction` says so.
/// `judging_level`: as CaseLoadOptions has it. Throws as load_case() does.
std::vector<LoadedMethod> load_methods(const MethodOptions& options,
                                       const registration::CorrectionOptions& correction,
                                       const Study& study,
                                       const StudyCase& study_case,
                                       const Communicator& world,
                                       std::map<std::string, std::string>& input_sha256,
                                       int judging_level = 0);

}  // namespace af::evaluation
