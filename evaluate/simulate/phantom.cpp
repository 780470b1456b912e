// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/phantom.h"

#include <array>

#include "base/joined.h"
#include "base/named_rows.h"
#include "evaluate/simulate/head_phantom.h"
#include "evaluate/simulate/pelvis_phantom.h"
#include "evaluate/simulate/spine_phantom.h"

namespace af {

namespace {

struct KnownPhantom {
  const char* name;
  const char* help;
  Phantom (*make)(bool has_metal, const Anatomy& anatomy);
};

/// Every phantom. A new one is added here.
constexpr std::array kPhantoms = {
    KnownPhantom{"spine", "trunk from T8 to L4 with ribs and organs", spine_phantom},
    KnownPhantom{"pelvis", "L4 to the upper thighs", pelvis_phantom},
    KnownPhantom{"head", "vault to C4", head_phantom},
};

}  // namespace

std::vector<std::string> phantom_names() {
  return names_of(kPhantoms);
}

std::string phantom_help() {
  return help_of(kPhantoms);
}

std::string bone_help() {
  return joined(kPhantoms, "; ", [](const KnownPhantom& phantom) {
    return std::string(phantom.name) + ": " + joined(names_of(phantom.make(false, {}).bones));
  });
}

Phantom make_phantom(const std::string& name,
                     bool has_metal,
                     std::optional<std::int64_t> anatomy_seed) {
  return required_row(kPhantoms, "phantom", name)
      .make(has_metal,
            anatomy_seed ? Anatomy(name, static_cast<std::uint64_t>(*anatomy_seed)) : Anatomy());
}

}  // namespace af
