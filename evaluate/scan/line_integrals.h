// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "evaluate/scan/scan_geometry.h"
#include "xray/image2d.h"

namespace af {

/// What every pixel of a scan counts without the object, above its dark level, and where it counts
/// anything.
struct AirLevel {
  Image2d air;
  std::vector<unsigned char> is_lit;  ///< 0 behind the aperture, per pixel
  std::vector<unsigned char> is_air;  ///< 1 where no view of the object shadows it, per pixel
  double brightest_share = 1.0;  ///< share of the flat in the brightest pixels; 1 without a flat
};

/// Mean and standard deviation over the views, per pixel, above the dark level.
struct PixelStatistics {
  Image2d mean;
  Image2d deviation;
};

/// Statistics of images (counts above dark) of one size.
PixelStatistics pixel_statistics(const std::vector<const Image2d*>& images);

/// The air level of a scan without a flat image: a cubic polynomial of column and row, times one
/// factor per line across the rotation axis (stripes of the detector). It is fitted to the
/// logarithm of the pixels that no view shadows. The fit begins with the ends of the lines, which
/// see past any object that a scan can reconstruct, and adds what agrees with it. Dark areas that
/// touch those ends are the aperture. Throws InputError when too few pixels show air, or only those
/// at one side. \test AirLevel.IsFoundAroundAnObject
AirLevel estimated_air_level(const PixelStatistics& statistics, AxisAlong axis_along);

/// The air level of a flat image (counts above dark). The scan's statistics tell which pixels see
/// air: those whose share of the flat is within 5 % of the brightest. As the flat may have another
/// exposure, the brightest share must be within 0.9 and 1.1, or the shares must agree to 2 %. An
/// object that reaches beyond the detector leaves no air. The beam is then assumed to be the
/// flat's. \test LineIntegrals.FromAFlatOfAnotherExposureAreThoseOfTheObject
AirLevel air_level_of_flat(const Image2d& flat, const PixelStatistics& statistics);

/// A view's mean ratio of counts to air over the pixels that see air, because the tube's output
/// changes from view to view. 1 where no pixel sees air; 0 or less for a view that counts nothing.
double beam_of(const Image2d& counts, const AirLevel& level);

/// What stands for a pixel without any counts under the logarithm: half a count. Where the open
/// beam has less than 50, numbers are no counts (transmissions of 0 to 1), and it is 1e-5 of the
/// open beam.
double least_count_of(const AirLevel& level);

/// -log(counts / (air * beam_of(counts))). Pixels behind the aperture get the value of the nearest
/// lit pixel of their line across the axis. Counts below `least_count` are raised to it. \test
/// LineIntegrals.AreThoseOfTheObjectUnderStripesAndDrift
Image2d line_integrals_of(const Image2d& counts,
                          const AirLevel& level,
                          AxisAlong axis_along,
                          double least_count);

}  // namespace af
