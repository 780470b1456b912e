// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/design_search.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "precompute/design/drr_time.h"

namespace af {
namespace {

constexpr double kPixels = 512.0 * 512.0;

/// A CT whose losses follow laws of their own, not the model's.
DesignForecast true_forecast(const FieldDesign& design) {
  const double viewpoints = design.slabs * (design.uv_nodes - 1.0) / 60.0;
  const double cells = design.st_nodes / 384.0;
  DesignForecast forecast;
  forecast.design = design;
  const double smoothing = design.look_up == "linear" ? 3.0 : 1.0;
  const double interpolation =
      1e-6 * (0.6 * std::pow(viewpoints, -2.4) + smoothing * std::pow(cells, -1.8));
  const double quantisation = 4e-6 * std::pow(viewpoints, -0.7) * std::pow(cells, -0.6) *
                              std::pow(design.codewords / 16384.0, -0.45);
  forecast.interpolation_db = -10.0 * std::log10(interpolation);
  forecast.quantisation_db = -10.0 * std::log10(quantisation);
  forecast.psnr_db = -10.0 * std::log10(interpolation + quantisation);
  const double tiles =
      0.4 / 16.0 * design.slabs * std::pow(1.0 * design.uv_nodes * design.st_nodes, 2.0);
  forecast.file_bytes = 32.0 * design.codewords + tiles * (std::log2(design.codewords) - 1.5) / 8.0;
  forecast.drr_ms = estimated_drr_ms(design, kPixels, 42000.0 * cells * cells);
  return forecast;
}

/// Measures the imagined CT, and counts how often.
class Measuring {
 public:
  MeasureDesign function() {
    return [this](const FieldDesign& design) {
      ++count_;
      std::vector<DesignPoint> points;
      for (const char* look_up : {"linear", "cubic"}) {
        FieldDesign looked_up = design;
        looked_up.look_up = look_up;
        const double cells = design.st_nodes / 384.0;
        points.push_back(
            {true_forecast(looked_up),
             0.4 / 16.0 * design.slabs * std::pow(1.0 * design.uv_nodes * design.st_nodes, 2.0),
             kPixels,
             42000.0 * cells * cells});
      }
      return points;
    };
  }
  [[nodiscard]] int count() const { return count_; }

 private:
  int count_ = 0;
};

DesignBudget target(double psnr_db) {
  DesignBudget budget;
  budget.target_psnr_db = psnr_db;
  return budget;
}

/// How far the last forecast may be off: by what the model's laws err over the small step from the
/// last measured design to the chosen one.
constexpr double kForecastDb = 0.3;
constexpr double kForecastShare = 0.05;

TEST(DesignSearch, ReachesTheTargetWithTheForecastItStates) {
  for (const double psnr_db : {46.0, 50.0, 54.0}) {
    Measuring measuring;
    const ChosenDesign chosen = search_design(target(psnr_db), {}, measuring.function());
    const DesignForecast truth = true_forecast(chosen.forecast.design);
    EXPECT_NEAR(truth.psnr_db, chosen.forecast.psnr_db, kForecastDb) << psnr_db;
    EXPECT_NEAR(truth.psnr_db, psnr_db, 2.0 * kForecastDb) << psnr_db;
    EXPECT_NEAR(truth.file_bytes, chosen.forecast.file_bytes, kForecastShare * truth.file_bytes);
    EXPECT_LE(measuring.count(), 5);
    EXPECT_EQ(chosen.measured.size(), static_cast<std::size_t>(measuring.count()));
  }
}

TEST(DesignSearch, KeepsTheSize) {
  for (const std::int64_t megabytes : {2, 8, 16}) {
    DesignBudget budget;
    budget.max_field_bytes = megabytes * 1000000;
    const ChosenDesign chosen = search_design(budget, {}, Measuring().function());
    const double bytes = true_forecast(chosen.forecast.design).file_bytes;
    EXPECT_LE(bytes, 1.02e6 * static_cast<double>(megabytes));
    EXPECT_GE(bytes, 0.7e6 * static_cast<double>(megabytes));
  }
}

TEST(DesignSearch, MoreSizeGivesMorePsnr) {
  double before = 0.0;
  for (const std::int64_t megabytes : {1, 2, 4, 8, 16, 32}) {
    DesignBudget budget;
    budget.max_field_bytes = megabytes * 1000000;
    const ChosenDesign chosen = search_design(budget, {}, Measuring().function());
    EXPECT_GT(chosen.forecast.psnr_db, before);
    before = chosen.forecast.psnr_db;
  }
}

TEST(DesignSearch, KeepsTheTime) {
  DesignBudget budget = target(49.0);
  budget.max_drr_ms = 1.0;
  const ChosenDesign chosen = search_design(budget, {}, Measuring().function());
  EXPECT_LE(chosen.forecast.drr_ms, 1.0);
  const ChosenDesign free = search_design(target(49.0), {}, Measuring().function());
  EXPECT_GE(chosen.forecast.file_bytes, free.forecast.file_bytes);
}

TEST(DesignSearch, KeepsThePartsThatAreStated) {
  SearchSpace space;
  space.fixed.slabs = 3;
  space.fixed.codewords = 1000;
  space.fixed.look_up = "linear";
  const ChosenDesign chosen = search_design(target(46.0), space, Measuring().function());
  EXPECT_EQ(chosen.forecast.design.slabs, 3);
  EXPECT_EQ(chosen.forecast.design.codewords, 1000);
  EXPECT_EQ(chosen.forecast.design.look_up, "linear");
}

TEST(DesignSearch, MakesNoMoreSlabsThanSlicesAllow) {
  SearchSpace space;
  space.most_slabs = 3;
  EXPECT_EQ(search_design(target(46.0), space, Measuring().function()).forecast.design.slabs, 1);
}

TEST(DesignSearch, NamesTheBestWhereNothingFits) {
  DesignBudget budget = target(58.0);
  budget.max_field_bytes = 500000;
  try {
    search_design(budget, {}, Measuring().function());
    FAIL() << "it must refuse";
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("no field meets the limits: at least 58 dB, at most 0.5 MB"),
              std::string::npos)
        << text;
    EXPECT_NE(text.find("the highest PSNR within size and time: "), std::string::npos) << text;
    EXPECT_NE(text.find("the smallest file with that PSNR: "), std::string::npos) << text;
  }
}

TEST(DesignModel, GivesThePointsThemselves) {
  DesignModel model;
  const FieldDesign design{6, 10, 448, 65536, "cubic"};
  model.add(Measuring().function()({4, 16, 384, 16384, "cubic"}));
  model.add(Measuring().function()(design));
  model.fit();
  const DesignForecast truth = true_forecast(design);
  // Sums and powers of a few doubles.
  constexpr double kRounding = 1e-9;
  EXPECT_NEAR(model.forecast(design).psnr_db, truth.psnr_db, kRounding);
  EXPECT_NEAR(model.forecast(design).file_bytes, truth.file_bytes, 1e6 * kRounding);
  EXPECT_NEAR(model.forecast(design).drr_ms, truth.drr_ms, kRounding);
}

}  // namespace
}  // namespace af
