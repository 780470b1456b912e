// SPDX-License-Identifier: Apache-2.0
// Pictures of a CT in which a person reads off points of the ct frame.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "ct/ct_volume.h"
#include "figures/picture.h"
#include "geometry/ct_box.h"

namespace af {

/// What a study says about places in its CT.
struct CtMarks {
  std::optional<CtBox> target;
  std::vector<Eigen::Vector3d> landmarks_ct_mm;
};

/// The largest values along the three axes, then the axial, coronal and sagittal slices through the
/// middle of the target or of the CT. All have a grid of ct coordinates and the patient's letters.
std::vector<PicturePanel> ct_overview(const CtVolume& ct, const CtMarks& marks);

/// Draws STEM-ct.png (ct_overview()), STEM-ct-axial.png (axial slices from feet to head) and, if
/// there are landmarks, STEM-ct-landmarks.png (the three slices through each). All have a grid of
/// ct coordinates (LPS, mm) and the patient's letters. None is mirrored: axial slices are seen from
/// the feet, coronal ones from the front, sagittal ones from the patient's left. Returns the files.
std::vector<std::filesystem::path> draw_ct_pictures(const CtVolume& ct,
                                                    const CtMarks& marks,
                                                    const std::filesystem::path& folder,
                                                    const std::string& stem);

}  // namespace af
