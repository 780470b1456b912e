// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "evaluate/scan/scan_options.h"
#include "evaluate/scan/self_calibration.h"
#include "ranks/provenance.h"
#include "study/study_file.h"

namespace af::tools {

/// A scan whose geometry has been found and judged, with the reconstruction of the even views.
struct CalibratedScan {
  std::string name;
  int enlarged = 1;  ///< how many times larger all lengths are than in the scan's file
  ScanImages images;
  ScanCalibration calibration;
  HeldOutResidual as_stated;   ///< of the odd views, before calibration
  HeldOutResidual calibrated;  ///< after it; its shifts tell how far the gold pose can be trusted
  CtVolume ct;                 ///< from the even views
  double water_mu_per_mm = 0.0;
  double object_radius_mm = 0.0;
};

/// Views whose angles differ by about a quarter turn.
struct ViewPair {
  int first;
  int second;
};

/// Pairs of odd views, the first ones evenly around the circle.
std::vector<ViewPair> odd_view_pairs(const CircularScan& scan, int pairs);

/// The pixels of a view to use: lit ones where nothing moved. `residual` as in ViewAlignment.
Image2d mask_of(const CircularScan& scan,
                const std::vector<unsigned char>& is_lit,
                const std::vector<float>& residual,
                double most_deviations);

/// Writes X-rays, masks, pictures, rig, CT, study, calibration and residuals of a scan into
/// `folder`. Returns what was found, as text for people.
std::string write_scan_study(const ScanOptions& options,
                             const CalibratedScan& scan,
                             const Provenance& provenance,
                             const std::filesystem::path& folder);

}  // namespace af::tools
