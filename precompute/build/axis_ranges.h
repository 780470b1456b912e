// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <string_view>

namespace af {

/// Bounds of three axes, as typed: degrees or mm.
struct AxisRanges {
  std::array<double, 3> low = {0.0, 0.0, 0.0};
  std::array<double, 3> high = {0.0, 0.0, 0.0};
};

/// The bounds of "rx=-15:15,ry=5,rz=-30:30" for the letter 'r': LOW:HIGH, or one number for both
/// sides of zero. Axes that are not named get -`otherwise` to `otherwise`. Throws UsageError,
/// naming `option`, for an axis that is unknown or named twice, for text that is no number, and for
/// descending bounds.
AxisRanges axis_ranges(const std::string& option,
                       const std::string& text,
                       char letter,
                       double otherwise);

}  // namespace af
