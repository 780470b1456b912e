// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "evaluate/simulate/phantom_parts.h"

namespace af {

/// A synthetic pelvis in DICOM LPS, with the origin midway between the hip joints. It has ilia with
/// crests, pubic and ischial bones around the obturator foramina, sacrum with foramina, coccyx, L4
/// and L5, femora with marrow, fat, muscles, bladder, and bowel with gas on the left. The target is
/// the left acetabulum. Sizes are typical of adults; nothing is taken from patient data. Metal: a
/// total hip prosthesis on the left, with cup, liner, ball, stem and two screws. `anatomy` turns it
/// into another patient.
Phantom pelvis_phantom(bool has_metal, const Anatomy& anatomy = {});

}  // namespace af
