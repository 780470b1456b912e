// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

namespace af::evaluation {

/// Area under the curve of true against false positives (ROC) when values above a threshold are
/// called positive. It is the probability that a positive has a higher value than a negative, where
/// equal ones count half (Mann and Whitney 1947; Hanley and McNeil, Radiology 143(1), 1982). NaN
/// without positives or negatives. \test RocArea.OfHandComputedCases
double roc_area(std::span<const double> positives, std::span<const double> negatives);

}  // namespace af::evaluation
