// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// `curvature` with its sizes along the directions that it shares with `scale` kept between `least`
/// and `most` of the scale's, so that it bends downwards where it did not. The scale should be
/// positive definite, which is not checked: where no finite directions come of one that is not, the
/// result is the scale itself. \test CurvatureBounds.KeepWhatIsWithin
ScaledMatrix kept_between(const ScaledMatrix& curvature,
                          const ScaledMatrix& scale,
                          double least,
                          double most);

}  // namespace af::registration
