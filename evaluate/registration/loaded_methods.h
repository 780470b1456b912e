// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "evaluate/registration/evaluated_methods.h"
#include "ranks/communicator.h"
#include "ranks/input_identity.h"
#include "register/kept_fields.h"
#include "register/verdict/registration.h"

namespace af::evaluation {

/// One renderer, with everything needed to register a case with it.
struct LoadedMethod {
  std::string renderer;  ///< "field" or "raycast"
  registration::Registration registration;
};

/// What a case was loaded from, as "CASE: what". Rank 0 only.
struct LoadedInputs {
  InputIdentities identities;
  std::map<std::string, std::string> notes;  ///< how each was read, as af-register says it
};

/// Collective. The methods of a case, in the order of chosen_renderers(). Hashes and notes of the
/// inputs go to `inputs`. Look-up is corrected where `correction` says so. `judging_level`: as in
/// CaseLoadOptions. `kept_fields`: shared by a loop over cases. Throws as load_case() does.
std::vector<LoadedMethod> load_methods(
    const MethodOptions& options,
    const registration::CorrectionOptions& correction,
    const Study& study,
    const StudyCase& study_case,
    const Communicator& world,
    LoadedInputs& inputs,
    int judging_level = 0,
    const std::shared_ptr<registration::KeptFields>& kept_fields = {});

}  // namespace af::evaluation
