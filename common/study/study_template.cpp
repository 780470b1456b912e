// SPDX-License-Identifier: Apache-2.0
#include "study/study_template.h"

#include "base/error.h"
#include "study/rig_file.h"

namespace af {
namespace {

constexpr const char* kStudyText =
    R"(# A study: patients, their CTs and their X-rays. `af-inspect study.toml` reads everything it names and says what is
# wrong, with the line. Paths are relative to this file.
#
# Frames: ct is DICOM's patient frame (LPS: x to the patient's left, y to the back, z to the head; mm), whatever the
# order of the voxels; room is that of the cameras (mm). Pixels are (column, row); integers are pixel centres.
# Keys behind a '#' are optional.

# The X-ray cameras: treatment-room, c-arm-12in, or a file like the one that `af-inspect --template rig` prints.
rig = "treatment-room"

# --- one [[case]] per patient --------------------------------------------------------------------------------------
[[case]]
name = "patient-01"                              # in result tables; letters, digits, - and _
# note = "who took the X-rays, when, anything"   # free text for people
ct = "patient-01/ct.nii.gz"                      # in HU: NIfTI, MetaImage, NRRD or a DICOM folder
# What else the voxels are and what is to be done to them (docs/cts.md), as the options of the programs without --.
# ct_resample = true                             # a tilted gantry or uneven slices
# ct_values = "mu"                               # attenuation per mm; or "raw" with ct_raw_slope_per_mm, or "labels"
# ct_body_only = true                            # table and head holder become air
# Where the patient lies according to the set-up: x_room = nominal_room_from_ct * x_ct, rigid. The true pose is looked
# for about it, within the fields' range. The identity puts the CT's origin at the room's, head to +z.
nominal_room_from_ct = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
center_ct_mm = [0.0, 0.0, 0.0]                   # middle of the region to register; rotations turn about it
target_box_ct_mm = [[-30, -30, -30], [30, 30, 30]]  # low and high corner: TRE is the mean over this box

# To measure errors, one of these is needed, and with both the fiducials' pose is compared with the stated one:
# at least three fiducials not on one line, here and in every view in the same order ([] for one that a view hides) ...
# fiducials_ct_mm = [[-20.0, 5.0, 0.0], [18.0, -7.0, 9.0], [3.0, 22.0, -14.0], [-6.0, -12.0, 21.0]]
# ... or the true pose itself.
# gold_room_from_ct = [[1, 0, 0, 1.5], [0, 1, 0, -2.0], [0, 0, 1, 0.5], [0, 0, 0, 1]]

# A start without a guess: at least three points that are marked here and, roughly, in the X-rays
# (docs/start-without-a-guess.md).
# landmarks_ct_mm = [[-60.0, 10.0, 5.0], [55.0, -20.0, 12.0], [8.0, 70.0, -40.0]]

[[case.view]]                                    # one per X-ray; two or more cameras see depth
camera = "A"                                     # a camera of the rig
xray = "patient-01/A.mha"                        # DICOM, MetaImage, NIfTI, NRRD, TIFF or PNG, the camera's size
xray_domain = "intensity"                        # bright = unattenuated, -log is taken; or "attenuation"
roi_px = [156, 156, 200, 200]                    # column, row, width, height: the pixels that are compared
# fiducials_px = [[201.3, 255.0], [280.1, 231.7], [240.6, 301.2], [232.9, 207.4]]   # as many as fiducials_ct_mm
# landmarks_px = [[210.0, 240.5], [], [251.0, 330.0]]   # as many as landmarks_ct_mm; [] is one that is not visible
# field = "fields/patient-01-A.af.h5"            # made by af-precompute --study study.toml --case patient-01 --camera A
# mask = "patient-01/A-mask.png"                 # not zero = used; for steel, labels or collimators; or "auto", or both in a list
# How the X-ray's values are read (docs/xrays.md); af-inspect says what was done.
# xray_frame = 1                                 # of a DICOM file of several frames
# xray_polarity = "inverted"                     # or "as-stored"; without it as a DICOM file says
# air_level = "open-beam"                        # or "collimated-borders", "percentile", or a number
# dark_level = 100.0                             # subtracted first; or dark = "dark.mha"
# xray_spacing = "ignore"                        # when the file's pixel spacing is wrong, and the rig's right

[[case.view]]
camera = "B"
xray = "patient-01/B.mha"
xray_domain = "intensity"
roi_px = [156, 156, 200, 200]
# fiducials_px = [[198.2, 250.4], [275.8, 229.9], [244.1, 297.5], [230.3, 210.2]]
# field = "fields/patient-01-B.af.h5"

[[case]]
name = "patient-02"
ct = "patient-02/dicom"
nominal_room_from_ct = [[1, 0, 0, 12.5], [0, 1, 0, 140.0], [0, 0, 1, 230.0], [0, 0, 0, 1]]
center_ct_mm = [-12.5, -140.0, -230.0]
target_box_ct_mm = [[-42.5, -170, -260], [17.5, -110, -200]]

[[case.view]]
camera = "A"
xray = "patient-02/A.png"
xray_domain = "intensity"
roi_px = [156, 156, 200, 200]

[[case.view]]
camera = "B"
xray = "patient-02/B.png"
xray_domain = "intensity"
roi_px = [156, 156, 200, 200]
)";

constexpr const char* kRigHead =
    R"(# X-ray cameras, in room coordinates (mm). column x row must point along the beam, from source to detector; `af-inspect
# rig.toml` says so, and what else is wrong, with the line. Instead of the four geometry keys a camera may have
# projection_matrix = [[...], [...], [...]] (3 x 4: pixels from room mm), with size_px and pixel_spacing_mm.
# A lens or an image intensifier that distorts: distortion = [k1, k2, p1, p2, k3], OpenCV's; its X-rays are undistorted.
)";

}  // namespace

std::vector<std::string> template_names() {
  return {"study", "rig"};
}

std::string template_text(const std::string& name) {
  if (name == "study") return kStudyText;
  if (name == "rig") return kRigHead + builtin_rig_text("c-arm-12in");
  throw InputError("template", name, "must be study or rig");
}

}  // namespace af
