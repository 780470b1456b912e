// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "evaluate/simulate/phantom_parts.h"

namespace af {

/// A synthetic trunk from T8 to L4 in DICOM LPS (left +x, back +y, head +z), with the body of T12
/// at the origin, which is also the centre of the volume of 358 x 358 x 280 mm. It has nine
/// vertebrae (cortical shell, cancellous inside, waist, pedicles, laminae, articular, transverse
/// and spinous processes), discs, five pairs of ribs that start at the vertebrae, fat, muscle, lung
/// bases, heart, liver, stomach with gas, spleen, kidneys and aorta. Left and right differ: the
/// liver is right, gas, spleen and aorta are left, and the spine bends. Sizes are typical of
/// adults, not of one person; nothing is taken from patient data. Metal: pedicle screws from T11 to
/// L1, and two rods. `anatomy` turns it into another patient. The bones that can be moved are T9 to
/// L3, which no face of the volume cuts.
Phantom spine_phantom(bool has_metal, const Anatomy& anatomy = {});

/// The body of T12, the middle vertebra, with its pedicles.
RegistrationTarget spine_phantom_target();

/// Centres of the vertebral bodies, from L4 up to T8 (ct, mm).
std::vector<Eigen::Vector3d> spine_phantom_vertebra_centers();

}  // namespace af
