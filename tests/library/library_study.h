// SPDX-License-Identifier: Apache-2.0
// What make_library_study and the tests of the library agree on.
#pragma once

#include <array>

namespace af::test {

/// rx, ry, rz (degrees), tx, ty, tz (mm) of the study's DRRs.
inline constexpr std::array<double, 6> kLibraryPose = {2.0, -1.5, 3.0, 4.0, -5.0, 6.0};
inline constexpr std::array<double, 3> kPivotRoomMm = {3.0, -2.0, 1.0};

}  // namespace af::test
