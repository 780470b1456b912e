// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ct/ray_caster.h"
#include "support/itk_ray_cast.h"

namespace af::test {

/// The same CT with its voxels reordered so that the direction is the identity. InputError when an
/// axis of the CT is not along plus or minus the axis of the same number of the ct frame.
CtVolume in_identity_direction(const CtVolume& ct);

/// ITK's caster of a volume of identity direction, border included.
std::unique_ptr<const ItkRayCaster> itk_caster_of(const AttenuationVolume& volume);

ItkFan itk_fan_of(const RayFan& fan);

}  // namespace af::test
