// SPDX-License-Identifier: Apache-2.0
#include "evaluate/outputs/paper_setting.h"

#include <cmath>
#include <string_view>

#include "text/number_json.h"

namespace af::evaluation {
namespace {

/// Sizes are compared as they are stated, not to the last bit.
bool is_about(const nlohmann::json& value, double expected) {
  constexpr double kRelative = 1e-3;
  return std::abs(number_of(value) - expected) <= kRelative * expected;
}

}  // namespace

bool is_papers_setting(const nlohmann::json& field) {
  constexpr double kPixels = 256.0;
  constexpr double kPixelMm = 1.190625;
  constexpr double kSourceDetectorMm = 1020.0;
  constexpr double kRotationDeg = 10.0;
  constexpr double kTranslationMm = 100.0;
  for (const char* key : {"detector_px", "pixel_spacing_mm"}) {
    const nlohmann::json pair = field.value(key, nlohmann::json());
    if (!pair.is_array() || pair.size() != 2) return false;
    const double expected = std::string_view(key) == "detector_px" ? kPixels : kPixelMm;
    if (!is_about(pair.at(0), expected) || !is_about(pair.at(1), expected)) return false;
  }
  return is_about(field.value("source_detector_mm", nlohmann::json()), kSourceDetectorMm) &&
         is_about(field.value("max_rotation_deg", nlohmann::json()), kRotationDeg) &&
         is_about(field.value("max_translation_mm", nlohmann::json()), kTranslationMm);
}

}  // namespace af::evaluation
