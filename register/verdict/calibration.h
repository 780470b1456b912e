// SPDX-License-Identifier: Apache-2.0
// What the measured registrations of jobs/uncertainty.py say about predictions. These are constants
// that are fitted to some patients and judged on others (docs/uncertainty.md).
#pragma once

#include <span>
#include <string>

#include "register/verdict/verdict.h"

namespace af::registration {

/// Factors by which to multiply a sandwich covariance, so that 95 % of the cases to which they were
/// fitted lie inside what it then predicts.
struct CovarianceInflation {
  double pose;  ///< for the region of the pose, decided by the worst of six directions; at least 1
  double tre;   ///< for TREs, which sum over all directions
};

/// The factors for a measure, and for the shares of the X-rays' gradients that the pose explains.
/// Content that no rigid pose explains, such as moved anatomy, shifts the optimum more than its
/// scatter shows. One view has constants of its own. NaN where nothing can be judged. \test
/// Calibration.WidensWhatThePoseDoesNotExplain \test Calibration.WidensOneViewByItsOwnConstants
CovarianceInflation covariance_inflation(const std::string& similarity,
                                         std::span<const ViewValue> view_values);

/// Standard deviation (mm at the isocentre) of the shift of a view's image that arises because DRRs
/// are interpolated from samples `spacing_mm` apart there. The shift is the same from every start,
/// and does not show in the residuals of the pose that it moved. \test
/// Calibration.CoarserSamplesShiftImagesMore
double interpolation_shift_mm(double spacing_mm);

/// The features that distinguish a success from a failure.
struct ConfidenceFeatures {
  std::span<const ViewValue> view_values;  ///< with backgrounds
  double sandwich_tre_mm = 0.0;  ///< as predicted, before inflation; NaN counts as no prediction
};

/// Probability that the TRE is below 2.5 mm, or with one view, which hardly shows depth, that the
/// mRPD is. It is a logistic regression on explained_excess() and on the logarithm of the predicted
/// TRE. Values within silhouettes enter by the logarithm of their excess. With one view the
/// regression is on the excess and the logarithm of its part of the share. NaN where there is no
/// excess. A view that cannot be judged does not count.
/// \test Calibration.ConfidenceFallsWithEveryDoubt
/// \test Calibration.AViewThatShowsNothingLeavesLittleConfidence
/// \test Calibration.ConfidenceWithinSilhouettesFallsWithEveryDoubt
/// \test Calibration.ConfidenceOfOneViewLooksAtWhatPosesBesideExplain
double success_confidence(const ConfidenceFeatures& features);

}  // namespace af::registration
