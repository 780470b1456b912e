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

/// What makes the DRR of a view of a camera at a pose. Each ray of the view is inside.
using ViewRenderer = std::function<std::shared_ptr<const DrrRenderer>(
    const View& view, const RigidTransform& room_from_ct)>;

/// Rays cast through a CT, for every view.
ViewRenderer cast_views(const CtVolume& ct);

/// Draws STEM-CAMERA.png for each view of a case (X-ray and DRRs at the nominal pose and, where the
/// case has landmarks, at the pose that they give; patient letters at the edges, region, landmarks,
/// the limit of the field's cover where the field exists) and STEM-room.png (sources, detectors and
/// CT box). DRRs are those of `renderer_of`. Detectors with more than `most_pixels` on a side are
/// shrunk. Nothing is ever flipped. Errors as of reading the X-rays and the fields.
StudyPictures draw_study_pictures(const Study& study,
                                  const StudyCase& study_case,
                                  const CtGrid& ct,
                                  const ViewRenderer& renderer_of,
                                  int most_pixels,
                                  const std::filesystem::path& folder,
                                  const std::string& stem);

}  // namespace af
