// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include <Eigen/Core>

#include "xray/image2d.h"

namespace af {

/// What a DICOM X-ray says besides its pixels.
struct DicomXrayDescription {
  int stored_bits = 12;  ///< 8 to 16, of 16 allocated ones
  std::string patient_id;
  std::string description;
  Eigen::Vector2d imager_spacing_mm = Eigen::Vector2d::Ones();  ///< column, row
  double source_detector_mm = 0.0;
  double source_patient_mm = 0.0;
  /// Where the detector stands about the patient: 0 in front of it, 90 at its left (LAO), 180
  /// behind it.
  double primary_angle_deg = 0.0;
  double secondary_angle_deg = 0.0;  ///< positive towards the head (CRA)
  /// Of increasing column and row, unit, DICOM's patient coordinates.
  Eigen::Vector3d column_direction_ct = Eigen::Vector3d::Zero();  ///< 0: not stated
  Eigen::Vector3d row_direction_ct = Eigen::Vector3d::Zero();
};

/// The positioner's angles of a beam (unit vector from source to detector, DICOM's patient
/// coordinates): primary, secondary.
Eigen::Vector2d positioner_angles_deg(const Eigen::Vector3d& beam_direction_ct);

/// DICOM's letters of a direction (unit, patient coordinates), the largest part first: "L", "PL";
/// parts below a tenth are left out.
std::string patient_orientation_letters(const Eigen::Vector3d& direction_ct);

/// Writes intensities (whole grey levels) as one frame of DICOM XA: MONOCHROME1, so low values are
/// white: 2^bits - 1 - level is stored; LIN; explicit little endian. UIDs follow from the content.
/// Appears only when whole.
void write_dicom_xray(const Image2d& levels,
                      const std::filesystem::path& path,
                      const DicomXrayDescription& description);

}  // namespace af
