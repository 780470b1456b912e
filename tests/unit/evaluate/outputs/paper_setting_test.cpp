// SPDX-License-Identifier: Apache-2.0
#include "evaluate/outputs/paper_setting.h"

#include <string>

#include <gtest/gtest.h>

namespace af::evaluation {
namespace {

using nlohmann::json;

const json kPapers = {{"detector_px", {256, 256}},
                      {"pixel_spacing_mm", {1.190625, 1.190625}},
                      {"source_detector_mm", 1020.0000000001},
                      {"max_rotation_deg", 10.000000000000002},
                      {"max_translation_mm", 100.0}};

TEST(PaperSetting, IsThePapersRangeAndCameraOnly) {
  EXPECT_TRUE(is_papers_setting(kPapers));
  const std::pair<const char*, json> others[] = {{"detector_px", {512, 512}},
                                                 {"detector_px", {256, 255}},
                                                 {"pixel_spacing_mm", {0.4, 0.4}},
                                                 {"source_detector_mm", 1500.0},
                                                 {"max_rotation_deg", 12.0},
                                                 {"max_translation_mm", 30.0}};
  for (const auto& [key, value] : others) {
    json other = kPapers;
    other[key] = value;
    EXPECT_FALSE(is_papers_setting(other)) << key;
    other.erase(key);
    EXPECT_FALSE(is_papers_setting(other)) << "without " << key;
  }
}

}  // namespace
}  // namespace af::evaluation
