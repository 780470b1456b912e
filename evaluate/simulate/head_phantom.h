// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "evaluate/simulate/phantom_parts.h"

namespace af {

/// A synthetic head in DICOM LPS, with the origin near the sella. It has a vault with diploe,
/// frontal, maxillary, sphenoid and mastoid air, orbits, nose with septum, zygomatic arches,
/// petrous bones, teeth, mandible, C1 to C4, brain with ventricles, and airway. The left frontal
/// sinus is larger. The target is the skull base. Sizes are typical of adults; nothing is taken
/// from patient data. Metal: fillings in six teeth, and a plate with four screws on the left of the
/// vault. `anatomy` turns it into another patient.
Phantom head_phantom(bool has_metal, const Anatomy& anatomy = {});

}  // namespace af
