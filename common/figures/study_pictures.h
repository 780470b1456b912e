// SPDX-License-Identifier: Apache-2.0
// Pictures that let a person see whether a study's cameras, X-rays and poses fit together, before
// anything is registered.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ct/ct_volume.h"
#include "drr/drr_renderer.h"
#include "study/study_file.h"

namespace af {

/// What was drawn of a case, and what looks wrong.
struct StudyPictures {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> facts;  ///< "camera A: left edge R, ...", and what its field holds
  /// Mirrored cameras, X-rays that look flipped or scaled, fields that miss rays.
  std::vector<std::string> telltales;
  std::vector<std::string> problems;  ///< views at which a DRR is empty
};

/// Makes the renderer for a view of a camera. No ray of the view may be outside at the pose.
using ViewRenderer = std::function<std::shared_ptr<const DrrRenderer>(
    const View& view, const RigidTransform& room_from_ct)>;

/// Rays cast through a CT, for every view.
ViewRenderer cast_views(const CtVolume& ct);

/// Draws STEM-CAMERA.png for each view of a case, and STEM-room.png. The former shows the X-ray and
/// DRRs at the nominal pose and, if the case has landmarks, at the pose that they give. It also
/// shows patient letters at the edges, the region, the landmarks, and the limit of the field's
/// cover if the field exists. The latter shows sources, detectors and CT box. `renderer_of` makes
/// the DRRs. Detectors with more than `most_pixels` on a side are shrunk. Nothing is ever flipped.
/// Throws as reading the X-rays and the fields does.
StudyPictures draw_study_pictures(const Study& study,
                                  const StudyCase& study_case,
                                  const CtGrid& ct,
                                  const ViewRenderer& renderer_of,
                                  int most_pixels,
                                  const std::filesystem::path& folder,
                                  const std::string& stem);

}  // namespace af
