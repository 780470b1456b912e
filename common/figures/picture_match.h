// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "xray/image2d.h"

namespace af {

/// The means of squares of `factor` x `factor` pixels. What does not fill a square is left out.
/// `factor` is at least 1.
Image2d block_means(const Image2d& image, int factor);

/// One of the eight ways to lay a picture: rows become columns first, then it is flipped.
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

/// The match of every laying of the X-ray with a DRR of the same size. Both are shrunk to at most
/// 48 pixels on a side, and shifted against each other by up to a quarter. Ways that swap the axes
/// are tried on square pictures only. The first is the X-ray as it is.
std::vector<LayingMatch> laying_matches(const Image2d& xray, const Image2d& drr);

/// Words for the tell-tale of a flipped or turned X-ray: another way matches well, and by more than
/// 0.1 (in correlation) better than the X-ray as it is. Empty when there is none.
std::string laying_telltale(const std::vector<LayingMatch>& matches);

/// How well an X-ray looks like the DRR when it is enlarged about its middle by a factor. Below 1
/// the DRR is enlarged instead, so that two whole pictures are always compared.
struct ScaleMatch {
  double factor = 1.0;
  double correlation = 0.0;  ///< as in LayingMatch
};

/// The match for factors from a half to twice. The first is the X-ray as it is.
std::vector<ScaleMatch> scale_matches(const Image2d& xray, const Image2d& drr);

/// Words for the tell-tale of a wrong pixel spacing: a factor that poses hardly explain (beyond
/// 1.25) matches well, and clearly better than the X-ray as it is and than all factors near 1.
/// Empty when there is none.
std::string scale_telltale(const std::vector<ScaleMatch>& matches);

}  // namespace af
