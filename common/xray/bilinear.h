// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "xray/image2d.h"

namespace af {

/// An image whose pixel (i, j) is the value of `image` at column `columns[i]`, row `rows[j]`. It is
/// bilinear between pixel centres. Beyond the outermost ones, the nearest counts.
Image2d resampled_bilinearly(const Image2d& image,
                             std::span<const double> columns,
                             std::span<const double> rows);

}  // namespace af
