// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>

#include "xray/image2d.h"

namespace af {

/// What surrounds the picture of an X-ray: borders that the detector does not read, collimator
/// blades, the round edge of an image intensifier.
struct XrayBorders {
  struct Circle {
    double column_px = 0.0;
    double row_px = 0.0;
    double radius_px = 0.0;
    double rms_px = 0.0;  ///< deviation of the field's edge from it
  };

  Image2d mask;  ///< 1 = the irradiated field, 0 = border
  std::array<int, 4> dead_px = {
      0, 0, 0, 0};               ///< constant columns or rows: left, top, right, bottom
  double aperture_share = 0.0;   ///< share of all pixels: dark beyond a convex edge
  double opaque_share = 0.0;     ///< share of bodies at the edge, as dark as what lies beyond it
  int straight_sides = 0;        ///< sides of the field's edge longer than 15 % of the picture's
  int margin_px = 0;             ///< penumbra that was removed along the edge
  std::optional<Circle> circle;  ///< when a circle describes the edge
  std::string doubt;             ///< why something dark at the edge was left in; may be empty

  [[nodiscard]] double masked_share() const;
  /// True when any pixel is masked.
  [[nodiscard]] bool is_any() const { return masked_share() > 0.0; }
  /// "masked 31.2 %: ..."
  [[nodiscard]] std::string text() const;
};

/// Finds the irradiated field of an X-ray whose values are intensities, on any scale, with a
/// detector's offset of at most half the open beam. Dead borders are rows and columns of one value.
/// Beyond a collimator or an aperture the picture is as dark as its darkest parts, while the field
/// itself is convex, whatever made it (blades, a circle, an iris). A dark part that reaches the
/// edge therefore counts as border only outside the convex hull of the rest. Anatomy that leaves
/// the picture dents the field and stays in, unless it takes a whole corner. Within the hull, only
/// small bodies at the edge that are as dark as the border are masked. If this would mask more than
/// `kMostMasked`, nothing is masked and `doubt` says so.
XrayBorders find_xray_borders(const Image2d& intensity);

/// Values of the field's pixels within `width_px` of its masked edge, or of the picture's edge
/// where nothing beside it is masked. `mask` has the image's size; an empty one masks nothing.
std::vector<float> values_along_edge(const Image2d& intensity, const Image2d& mask, int width_px);

}  // namespace af
