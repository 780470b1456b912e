// SPDX-License-Identifier: Apache-2.0
#include "ct/ct_read_options.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ct/attenuation_volume.h"
#include "ct/hu_values.h"

namespace af {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(HuConversion, LeavesHuAlone) {
  EXPECT_TRUE(HuConversion().is_identity());
  EXPECT_TRUE(HuConversion(CtReadOptions()).is_identity());
  EXPECT_EQ(HuConversion().hu(-37.5), -37.5);
}

TEST(HuConversion, OfAttenuationGivesItBackThroughTheAttenuationModel) {
  CtReadOptions options;
  options.values = "mu";
  AttenuationModel model;
  for (const double mu_per_mm : {0.004, 0.02, 0.0437}) {
    const double hu = HuConversion(options).hu(mu_per_mm);
    const double units = model.relative_attenuation(static_cast<std::int16_t>(std::lround(hu)));
    EXPECT_NEAR(
        units * model.mu_per_mm_per_unit(), mu_per_mm, 0.5 * model.mu_per_mm_per_unit() + 1e-12);
  }
  options.values_water_mu_per_mm = 0.025;
  EXPECT_NEAR(HuConversion(options).hu(0.025), 0.0, 1e-9);
}

TEST(HuConversion, OfRawNumbersIsAStraightLine) {
  CtReadOptions options;
  options.values = "raw";
  options.raw_slope_per_mm = 1e-5;
  options.raw_offset_per_mm = 0.001;
  // mu = 0.04 + 0.001 per mm.
  EXPECT_NEAR(HuConversion(options).hu(4000.0), 1000.0 * (0.041 / 0.02 - 1.0), 1e-9);
}

TEST(HuConversion, OfLabelsIsTheirTableAndAirForOthers) {
  CtReadOptions options;
  options.values = "labels";
  options.label_hu = {"3=700", "1=-80.5"};
  const HuConversion conversion(options);
  EXPECT_EQ(conversion.hu(3.0), 700.0);
  EXPECT_EQ(conversion.hu(1.0), -80.5);
  EXPECT_EQ(conversion.hu(0.0), -1000.0);
  EXPECT_EQ(conversion.hu(2.0), -1000.0);
  EXPECT_TRUE(std::isnan(conversion.hu(std::numeric_limits<double>::quiet_NaN())))
      << "refused later";
}

TEST(CtReadOptions, RefuseContradictions) {
  EXPECT_THAT(problems(CtReadOptions()), IsEmpty());
  CtReadOptions options;
  options.values = "raw";
  EXPECT_THAT(problems(options), ElementsAre(HasSubstr("raw_slope_per_mm = 0")));
  options.raw_slope_per_mm = 1.0;
  EXPECT_THAT(problems(options), IsEmpty());
  options.values = "mu";
  EXPECT_THAT(problems(options), ElementsAre(HasSubstr("raw_slope_per_mm = 1")));
  options = {};
  options.values = "labels";
  EXPECT_THAT(problems(options), ElementsAre(HasSubstr("label_hu = none")));
  for (const char* bad : {"3", "3=", "=7", "3=x", "3.5=7", "3=99999", "3=7=8"}) {
    options.label_hu = {bad};
    EXPECT_THAT(problems(options), ElementsAre(HasSubstr("must be LABEL=HU"))) << bad;
  }
}

TEST(CtReadOptions, SayWhatDiffersFromTheDefault) {
  CtReadOptions options;
  options.series_uid = "1.2.3";
  EXPECT_EQ(options.text(), "");
  options.resamples = true;
  options.keeps_body_only = true;
  EXPECT_EQ(options.text(), "resampled if tilted or uneven; body only");
}

}  // namespace
}  // namespace af
