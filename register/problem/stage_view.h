// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "drr/drr_renderer.h"
#include "register/similarity/similarity_measure.h"

namespace af::registration {

/// How a stage of a registration sees a detector.
struct StageGrid {
  int pixel_step = 1;      ///< a stage pixel is the mean of pixel_step x pixel_step detector pixels
  double roi_scale = 1.0;  ///< the region's sides over those of the view's, about its centre
  double blur_sigma_px = 0.0;  ///< of the X-ray, in detector pixels, the mean's own blur included
};

/// The view of a stage: the region, scaled about its centre and cut at the detector's edges, seen
/// by pixels of pixel_step detector pixels (View::coarser). It never reaches beyond the detector,
/// so a field made for the detector holds every ray.
View stage_view(const View& view, const StageGrid& grid);

/// The X-ray of a whole detector as the DRRs of stage_view(view, grid) see it: block means, blurred
/// in all by blur_sigma_px, cropped to the region last, so that its edge pixels know their
/// surroundings. A stage pixel is used when its whole block is (`mask`: whole detector, non-zero =
/// used; empty: all). drr_range is left at its default.
SimilarityReference stage_reference(const Image2d& xray,
                                    const Image2d& mask,
                                    const View& view,
                                    const StageGrid& grid);

}  // namespace af::registration
