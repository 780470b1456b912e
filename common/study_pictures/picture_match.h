// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "image/image2d.h"

namespace af {

/// The means of squares of `factor` x `factor` pixels; what does not fill a square is left out.
/// `factor` is at least 1.
Image2d block_means(const Image2d& image, int factor);

/// One of the eight ways to lay a picture: rows turned to columns first, then flips.
struct PictureLaying {
  const char* name;  ///< "flipped left to right"
  bool swaps_axes;   ///< columns become rows
  bool flips_columns;
  bool flips_rows;
};

/// How well an X-ray, laid in some way, looks like the DRR.
struct LayingMatch {
  PictureLaying laying;
  double correlation = 0.0;  ///< normalised, the best over shifts
};

/// The match of every laying of the X-ray with a DRR of the same size, both brought to at most 48
/// pixels on a side and shifted against each other by up to a quarter. Ways that swap the axes are
/// tried on square pictures only. The first is the X-ray as it is.
std::vector<LayingMatch> laying_matches(const Image2d& xray, const Image2d& drr);

/// The tell-tale of a flipped or turned X-ray, in words: another way matches by more than 0.1 (in
/// correlation) better than the X-ray as it is, and by itself well. Empty when there is none.
std::string laying_telltale(const std::vector<LayingMatch>& matches);

}  // namespace af
