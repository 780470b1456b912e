// SPDX-License-Identifier: Apache-2.0
#include "simulation/phantom.h"

#include "base/error.h"
#include "simulation/head_phantom.h"
#include "simulation/pelvis_phantom.h"
#include "simulation/spine_phantom.h"

namespace af {

std::vector<std::string> phantom_names() {
  return {"spine", "pelvis", "head"};
}

Phantom make_phantom(const std::string& name, bool has_metal) {
  if (name == "spine") return spine_phantom(has_metal);
  if (name == "pelvis") return pelvis_phantom(has_metal);
  if (name == "head") return head_phantom(has_metal);
  throw InputError("phantom", name, "must be spine, pelvis or head");
}

}  // namespace af
