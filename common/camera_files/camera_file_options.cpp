// SPDX-License-Identifier: Apache-2.0
#include "camera_files/camera_file_options.h"

#include "base/plausible.h"
#include "camera_files/camera_formats.h"

namespace af {

void CameraFileOptions::describe(Fields& field) {
  field("rig_format", format, "Format of the files, when their content does not tell")
      .choice(readable_camera_formats());
  field("rig_names",
        names,
        "Names of the cameras, in the files' order (default: from the file names)")
      .comma_separated();
  field("rig_size_px", size_px, "Columns and rows of the images, when the files do not state them")
      .comma_separated()
      .count(2)
      .within(1, 32768);
  field("rig_pixel_spacing_mm",
        pixel_spacing_mm,
        "Spacing of columns and rows on the detector, when the files do not state it (default: the "
        "detector is put at 1.5 times the isocentre's distance from the source; rays do not depend "
        "on it)")
      .comma_separated()
      .count(2)
      .within(kMinSpacingMm, kMaxSpacingMm);
  field("rig_isocenter_point",
        isocenter_point,
        "The rig's isocentre in its room, when the files do not state it (default: the point "
        "nearest to the cameras' central rays)")
      .finite();
  field("rig_unit_mm", unit_mm, "Length of the files' unit, when they may mean another than mm")
      .within(1e-3, 1e4);
  field("rig_detector_origin_mm",
        detector_origin_mm,
        "Where the centre of pixel (0, 0) lies on the detector, for formats that state the "
        "detector in mm only (default: the image is centred)")
      .comma_separated()
      .count(2)
      .within(-kMaxRoomMm, kMaxRoomMm);
  field("rig_source_detector_mm",
        source_detector_mm,
        "Distance from source to detector, when a DICOM file does not state it")
      .within(1.0, kMaxRoomMm);
  field(
      "rig_source_isocenter_mm",
      source_isocenter_mm,
      "Distance from source to isocentre (DICOM: to patient), when a DICOM file does not state it")
      .within(1.0, kMaxRoomMm);
  field("rig_positioner_deg",
        positioner_deg,
        "Primary (LAO is positive) and secondary (cranial is positive) positioner angle, when a "
        "DICOM file does not state them")
      .comma_separated()
      .count(2)
      .within(-180.0, 180.0);
  field("rig_flip",
        flip,
        "The X-rays are stored with their rows, or columns, in the other order than the files' "
        "convention has it")
      .choice({"rows", "columns"});
}

}  // namespace af
