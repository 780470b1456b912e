// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "base/described_fields.h"
#include "base/thread_pool.h"
#include "ct/ct_volume.h"
#include "evaluate/scan/scan_geometry.h"
#include "xray/image2d.h"

namespace af {

/// Attenuation on a grid, 1/mm, i fastest. Noise and streaks are kept, so it may be negative.
struct MuVolume {
  CtGrid grid;
  std::vector<float> mu_per_mm;
};

/// One view of a scan.
struct ScanView {
  double angle_rad = 0.0;
  CameraGeometry camera;  ///< with its source on the circle at angle_rad
  const Image2d* line_integrals = nullptr;
};

struct FdkOptions {
  double voxel_mm = 0.0;      ///< 0: a pixel's size at the axis
  double smoothing_px = 0.8;  ///< standard deviation of a Gaussian along the filtered lines, pixels

  void describe(Fields& field);
};

/// The grid of the cylinder about the axis that the full circle sees, and of what surrounds it in
/// the box: identity direction, centred on the axis and on the heights that the detector sees.
CtGrid scan_grid(const CircularScan& scan, double voxel_mm);

/// Filtered back projection of a full circle (Feldkamp, Davis, Kress, JOSA A 1:612, 1984). Each
/// image is first resampled to the plane through the axis that is square to its central ray. Its
/// own camera is used for this, so a detector may be shifted, turned and tilted in every view.
/// Views may stand at uneven angles. What a displaced detector (is_displaced()) misses in one view,
/// another one sees half a turn later. An object that reaches beyond the detector is assumed to end
/// softly beside it. Outside the cylinder that the full circle sees, the result is 0.
/// \test FdkAlong.ADisplacedDetectorSeesTwiceAsFar, FdkAlong.OfABallGivesItsAttenuationWhereItIs
MuVolume reconstruct_fdk(const CircularScan& scan,
                         std::span<const ScanView> views,
                         const CtGrid& grid,
                         const FdkOptions& options,
                         ThreadPool& pool);

/// HU of an attenuation map with this mu_water: 1000 (mu / mu_water - 1), rounded, within int16.
CtVolume ct_of(const MuVolume& volume, double mu_water_per_mm);

/// Half of the attenuation (1/mm) that 1 of 200 voxels of the cylinder exceeds. Used as the water
/// of a HU scale, it keeps every material of a scan within the scale, whatever the scan's energy.
double reference_mu_per_mm(const MuVolume& volume);

/// The share of all attenuation that lies in voxels below `cut_mu_per_mm`. Noise about 0 does not
/// count, because negative values are subtracted.
double light_share(const MuVolume& volume, double cut_mu_per_mm);

/// The water of the HU scale of a CT to register: reference_mu_per_mm(), halved until the voxels
/// that AttenuationModel takes for air hold at most 5 % of the attenuation. Otherwise a little
/// metal in much plastic would turn the plastic into air. It is never so low that the densest
/// voxels leave the scale.
/// \test LightShare.KeepsPlasticBesideMetal
double registration_water_mu_per_mm(const MuVolume& volume);

}  // namespace af
