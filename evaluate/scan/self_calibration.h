// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "base/thread_pool.h"
#include "evaluate/scan/fdk.h"
#include "evaluate/scan/scan_geometry.h"
#include "evaluate/scan/view_alignment.h"

namespace af {

struct SelfCalibrationOptions {
  int harmonics = 8;       ///< of the view angle, for column, row and rotation
  int rounds = 6;          ///< at the finer of two resolutions
  double coarse_px = 6.0;  ///< of the band pass, pixels of the working resolution
  int working_px = 200;    ///< the larger side of the images that rounds work on, at most
  int search_px = 120;     ///< likewise while searching what projections hardly determine
  /// Source to detector is searched within this share of the stated one. None: the scan's
  /// tolerance.
  std::optional<double> focal_share;
  double tilt_deg = 1.0;  ///< the tilt is searched within this

  void describe(Fields& field);

  /// What may change with the angle: at most one harmonic per 8 of the used views, and a drift
  /// where the views are consecutive.
  [[nodiscard]] AngleBasis basis_for(const CircularScan& scan, std::size_t used_views) const;
};

/// The images of a scan (line integrals), all of one size, and where they are lit.
struct ScanImages {
  CircularScan scan;
  std::vector<Image2d> line_integrals;  ///< one per angle
  std::vector<unsigned char> is_lit;

  /// Means of factor x factor pixels. A coarse pixel is lit when all of it is.
  [[nodiscard]] ScanImages binned(int factor) const;
};

/// One view, compared with its prediction from views that do not include it.
struct JudgedView {
  int view = 0;
  ViewAlignment alignment;
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();  ///< divided by the response
};

/// What held-out views say about a calibration.
struct HeldOutResidual {
  std::vector<JudgedView> views;
  double rms_px = 0.0;            ///< length of the shift, root mean square over the views
  double rms_mm_at_axis = 0.0;    ///< the same at the axis
  double rotation_rms_rad = 0.0;  ///< likewise, for the detector's rotation in its plane
  double cost = 0.0;              ///< mean over the views, see ViewAlignment
};

/// Predicts the `judged` views from a reconstruction of the `used` ones and compares them. Pixels
/// whose rays leave the part that a full circle reconstructs do not count.
/// \test SelfCalibration.FindsAKnownWobble
HeldOutResidual held_out_residual(const ScanImages& images,
                                  const ScanCalibration& calibration,
                                  const std::vector<int>& used,
                                  const std::vector<int>& judged,
                                  const SelfCalibrationOptions& options,
                                  ThreadPool& pool);

/// Reconstructs some of the views.
MuVolume reconstruct_views(const ScanImages& images,
                           const ScanCalibration& calibration,
                           const std::vector<int>& used,
                           const FdkOptions& options,
                           ThreadPool& pool);

/// The pixels whose rays, within `radius_mm` of the axis, stay where every view of the circle sees.
std::vector<unsigned char> fully_seen_pixels(const CircularScan& scan,
                                             const ScanCalibration& calibration,
                                             const std::vector<unsigned char>& is_lit,
                                             double radius_mm);

/// The radius about the axis (mm) within which nearly everything that attenuates lies.
double object_radius_mm(const MuVolume& volume);

/// The stated geometry, or the same moved across the axis to the views' common centre of
/// attenuation, whichever predicts better. The centre of everything that a full circle sees is on
/// the axis, unless the object reaches beyond the detector. This is the best estimate without
/// self-calibration.
ScanCalibration stated_calibration(const ScanImages& images,
                                   const std::vector<int>& used,
                                   const SelfCalibrationOptions& options,
                                   ThreadPool& pool);

/// Finds the geometry by which the views agree with each other. Each half of the `used` views is
/// predicted from the other's reconstruction, and cameras move to where the images are. The
/// detector's distance and tilt, which projections hardly determine, are searched by the same
/// residual. Throws InputError when a scan turning the other way would agree better, because then
/// step or handedness of the images is wrong. `report` receives a line per step.
ScanCalibration self_calibrate(const ScanImages& images,
                               const std::vector<int>& used,
                               const SelfCalibrationOptions& options,
                               ThreadPool& pool,
                               const std::function<void(const std::string&)>& report);

}  // namespace af
