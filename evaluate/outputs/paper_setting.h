// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

namespace af::evaluation {

/// Whether a field, as summaries of image quality describe it, has the paper's motion range (+-10
/// deg, +-100 mm) and a camera of the paper's kind (256x256 pixels of 1.19 mm, 1020 mm from the
/// source: `c-arm-12in`). PSNR falls with the range and depends on the camera, so the paper's 43 dB
/// may be shown beside such fields only. false when the summary, of an earlier version, does not
/// say. \test PaperSetting.IsThePapersRangeAndCameraOnly
bool is_papers_setting(const nlohmann::json& field);

}  // namespace af::evaluation
