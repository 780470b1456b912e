// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include <Eigen/Core>

#include "xray/image2d.h"

namespace af {

/// What a DICOM X-ray says besides its pixels.
struct DicomXrayDescription {
  int stored_bits = 12;  ///< 8 to 16, of 16 allocated bits
  std::string patient_id;
  std::string description;
  Eigen::Vector2d imager_spacing_mm = Eigen::Vector2d::Ones();  ///< column, row
  double source_detector_mm = 0.0;
  double source_patient_mm = 0.0;
  /// Where the detector stands about the patient: 0 in front of it, 90 at its left (LAO), 180
  /// behind it.
  double primary_angle_deg = 0.0;
  double secondary_angle_deg = 0.0;  ///< positive towards the head (CRA)
  /// Unit directions of increasing column and row, in DICOM's patient coordinates.
  Eigen::Vector3d column_direction_ct = Eigen::Vector3d::Zero();  ///< 0: not stated
  Eigen::Vector3d row_direction_ct = Eigen::Vector3d::Zero();
};

/// The positioner's angles of a beam: primary, secondary. The beam is a unit vector from source to
/// detector, in DICOM's patient coordinates.
Eigen::Vector2d positioner_angles_deg(const Eigen::Vector3d& beam_direction_ct);

/// DICOM's letters for a direction (unit, patient coordinates), the largest part first: "L", "PL".
/// Parts below a tenth are left out.
std::string patient_orientation_letters(const Eigen::Vector3d& direction_ct);

/// Writes intensities (whole grey levels) as one frame of DICOM XA: LIN, explicit little endian. It
/// is MONOCHROME1, so low values are white: 2^bits - 1 - level is stored. UIDs follow from the
/// content. The file appears only when complete.
void write_dicom_xray(const Image2d& levels,
                      const std::filesystem::path& path,
                      const DicomXrayDescription& description);

}  // namespace af
