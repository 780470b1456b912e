// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "field_use/opened_field.h"
#include "parallel/communicator.h"
#include "register/case_loading.h"
#include "register/problem/registration_problem.h"

namespace af {
struct CompressedAttenuationField;
}

namespace af::registration {

/// Collective. Renderers for a view and its coarser levels, looked up in a field or an atlas and
/// held once per node; with `bone` those of the tube's spectrum, whose levels are as many as both
/// fields have, and blurred as those of the field of all. An atlas holds the members that poses
/// near the nominal one need once per node; a search that goes farther opens others, each rank for
/// itself.
void use_field(const OpenedField& opened,
               const std::shared_ptr<const CompressedAttenuationField>& bone,
               const PoseFrame& nominal,
               const CaseLoadOptions& options,
               const Communicator& communicator,
               RegistrationView& view);

}  // namespace af::registration
