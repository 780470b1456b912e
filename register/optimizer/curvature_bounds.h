// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "register/optimizer/optimizer.h"

namespace af::registration {

/// `curvature`, with its sizes along the directions that it shares with `scale` kept between
/// `least` and `most` of the scale's, so that it bends downwards everywhere. The scale itself where
/// that is not positive definite. \test CurvatureBounds.KeepWhatIsWithin
ScaledMatrix kept_between(const ScaledMatrix& curvature,
                          const ScaledMatrix& scale,
                          double least,
                          double most);

}  // namespace af::registration
