// SPDX-License-Identifier: Apache-2.0
// What the measured registrations of jobs/uncertainty.py say of predictions: constants that are
// fitted to some patients and judged on others (docs/uncertainty.md).
#pragma once

#include <span>
#include <string>

#include "register/verdict/verdict.h"

namespace af::registration {

/// Factors by which to multiply a sandwich covariance, so that 95 % of the cases fitted lie inside
/// what it then foretells.
struct CovarianceInflation {
  double pose;  ///< for the region of the pose, whose worst of six directions decides; at least 1
  double tre;   ///< for TREs, which add up what all directions do
};

/// Given the measure and the shares of the X-rays' gradients that the pose explains: content that
/// no rigid pose explains, such as moved anatomy, shifts the optimum more than its scatter shows.
/// One view has constants of its own. NaN where nothing can be judged. \test
/// Calibration.WidensWhatThePoseDoesNotExplain \test Calibration.WidensOneViewByItsOwnConstants
CovarianceInflation covariance_inflation(const std::string& similarity,
                                         std::span<const ViewValue> view_values);

/// Standard deviation (mm at the isocentre) of the shift of a view's image that comes from DRRs
/// being interpolated from samples `spacing_mm` apart there: the same from every start, and not
/// among the residuals of the pose that it moved. \test Calibration.CoarserSamplesShiftImagesMore
double interpolation_shift_mm(double spacing_mm);

/// What tells a success from a failure.
struct ConfidenceFeatures {
  std::span<const ViewValue> view_values;  ///< with backgrounds
  double sandwich_tre_mm = 0.0;  ///< as predicted, before inflation; NaN counts as no prediction
};

/// Probability that the TRE is below 2.5 mm, with one view that the mRPD is (its depth hardly
/// shows): by logistic regression on explained_excess(), of values within silhouettes its
/// logarithm, and on the logarithm of the predicted TRE; of one view on the excess and the
/// logarithm of its part of the share. NaN where there is no excess. A view that cannot be judged
/// does not count. \test
/// Calibration.ConfidenceFallsWithEveryDoubt \test
/// Calibration.AViewThatShowsNothingLeavesLittleConfidence \test
/// Calibration.ConfidenceWithinSilhouettesFallsWithEveryDoubt \test
/// Calibration.ConfidenceOfOneViewLooksAtWhatPosesBesideExplain
double success_confidence(const ConfidenceFeatures& features);

}  // namespace af::registration
