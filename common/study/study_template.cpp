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
# Points of the CT can be read off the pictures of `af-inspect patient-01/ct.nii.gz --pictures pictures`.
center_ct_mm = [0.0, 0.0, 0.0]                   # middle of the region to register; rotations turn about it
target_box_ct_mm = [[-30, -30, -30], [30, 30, 30]]  # low and high corner: TRE is the mean over this box
# Where the patient lies according to the set-up: x_room = nominal_room_from_ct * x_ct, rigid. The true pose is looked
# for about it, within the fields' range. Without it the landmarks' pose is taken (below); without these, too,
# center_ct_mm lies at the rig's isocentre, with the patient's axes along the room's: here x left, y back, z head.
# nominal_room_from_ct = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]

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
roi_px = [156, 156, 200, 200]                    # column, row, width, height: what is compared; else about the target box
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

constexpr const char* kScanText =
    R"(# A circular cone-beam scan, for af-scan and jobs/real-xrays.sh. Lengths in mm, angles in degrees.
#
# Frame: the object. +z is the rotation axis; the camera of angle 0 has its source at (0, -source_to_axis_mm, 0) and
# looks along +y; that of angle a is this one turned by a about +z. If the object turns and the camera stands still,
# the camera turns the other way: change the sign. Pixels are (column, row), the first is 0, integers are pixel centres.
# Keys behind a '#' are optional.
name = "my-scan"                                 # letters, digits, - and _
source_to_axis_mm = 308.7                        # SOD, SAD; RTK: SID. Not from source to image
axis_to_detector_mm = 149.0                      # SDD - SOD: from the axis on to the detector, not from the source
# distance_tolerance = 0.1                       # the detector may stand so far off, as a share; without it it was measured
pixel_spacing_mm = [0.37, 0.37]                  # of columns and rows, on the detector
size_px = [350, 350]                             # columns, rows
rotation_axis = "rows"                           # +z is up in the images (along decreasing rows); or "columns": to the right
# beam_foot_px = [174.5, 174.5]                  # where the perpendicular from the source meets the detector; its middle

# The angles: evenly spaced, all the way round; or, instead of all three keys, angles_deg = [0.0, 1.0, ...], or
# a file of them beside this one, a number per view: angles_file = "angles.txt".
view_count = 360
step_deg = 1.0                                   # below 0: the other way round
# first_angle_deg = 0.0

# The images: PNG, TIFF, MetaImage, NRRD, NIfTI or DICOM, all in one folder. {} is the index of the file, {:04} with four
# digits. A name without braces is one file of all views. Or files_file = "files.txt" beside this file, a line per view.
files = "Projection{}.png"
# first_index = 0
# index_step = 1                                 # 3: every third file is a view
xray_domain = "intensity"                        # bright = unattenuated; or "attenuation": line integrals -ln(I / I0),
                                                 # with attenuation_scale = 1e-4 where they are stored times 10000
# What the detector counts without beam, and without the object; or images of them in the same folder, dark = "dark.png"
# and flat = "flat.png". Without flat or flat_level air must be seen on both sides of the object.
# dark_level = 100.0
# flat_level = 40000.0
)";

constexpr const char* kRigHead =
    R"(# X-ray cameras, in room coordinates (mm). column x row must point along the beam, from source to detector; `af-inspect
# rig.toml` says so, and what else is wrong, with the line. Instead of the four geometry keys a camera may have
# projection_matrix = [[...], [...], [...]] (3 x 4: pixels from room mm), with size_px and pixel_spacing_mm.
# A lens or an image intensifier that distorts: distortion = [k1, k2, p1, p2, k3], OpenCV's; its X-rays are undistorted.
)";

}  // namespace

std::vector<std::string> template_names() {
  return {"study", "rig", "scan"};
}

std::string template_text(const std::string& name) {
  if (name == "study") return kStudyText;
  if (name == "rig") return kRigHead + builtin_rig_text("c-arm-12in");
  if (name == "scan") return kScanText;
  throw InputError("template", name, "must be study, rig or scan");
}

}  // namespace af
