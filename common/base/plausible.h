// SPDX-License-Identifier: Apache-2.0
// Limits on the numbers of real scanners, rooms and patients. A number beyond them means wrong
// units or a damaged file, and products of such numbers overflow.
#pragma once

#include <cmath>
#include <cstdint>

namespace af {

inline constexpr double kMinSpacingMm = 0.01;  ///< of voxels and pixels
inline constexpr double kMaxSpacingMm = 100.0;
inline constexpr double kMaxCtOriginMm = 1e4;                        ///< of each coordinate
inline constexpr std::uint64_t kMaxVoxels = std::uint64_t{1} << 32;  ///< 8 GB of int16
inline constexpr double kMaxHu = 1e6;      ///< int16 is clamped to; nothing is beyond this
inline constexpr double kMaxRoomMm = 1e6;  ///< of each coordinate of points and translations

/// NaN is not plausible, because it fails both comparisons.
inline bool is_plausible_spacing_mm(double spacing_mm) {
  return spacing_mm >= kMinSpacingMm && spacing_mm <= kMaxSpacingMm;
}
inline bool is_plausible_room_mm(double coordinate_mm) {
  return std::abs(coordinate_mm) <= kMaxRoomMm;
}

inline constexpr const char* kPlausibleSpacing = "must be 0.01 to 100 mm";
inline constexpr const char* kPlausibleRoom = "must be finite and within 1e6 mm (1 km)";

}  // namespace af
