// SPDX-License-Identifier: Apache-2.0
#include "evaluate/outputs/result_figures.h"

#include <cmath>
#include <cstdlib>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "figures/gnuplot_figure.h"
#include "files/output_file.h"
#include "support/file_size_limit.h"
#include "support/test_paths.h"
#include "text/csv_table.h"

namespace af::evaluation {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(GnuplotFigure, WritesTheSameBytesEveryTime) {
  const test::ScratchFolder folder;
  for (const char* name : {"a", "b"}) {
    GnuplotFigure figure("A title with 'quotes' & <angles>", 400, 300);
    figure.add_data("points", {{1, 2}, {2, std::nan("")}, {3, 4}});
    figure.add("plot $points using 1:2 with points");
    figure.draw(folder / name);
  }
  EXPECT_EQ(read_text_file(folder / "a.svg"), read_text_file(folder / "b.svg"));
  EXPECT_EQ(read_text_file(folder / "a.png"), read_text_file(folder / "b.png"));
  EXPECT_THAT(read_text_file(folder / "a.svg"),
              HasSubstr("<title>A title with 'quotes' &amp; &lt;angles></title>"));
  EXPECT_THAT(read_text_file(folder / "a.png"), testing::StartsWith("\x89PNG"));
}

TEST(GnuplotFigure, NamesGnuplotsMessageAndLeavesNothingWhenAScriptIsWrong) {
  const test::ScratchFolder folder;
  GnuplotFigure figure("wrong", 400, 300);
  figure.add("plot nonsense(");
  try {
    figure.draw(folder / "wrong");
    FAIL() << "drew nonsense";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("wrong.svg"));
    EXPECT_THAT(error.what(), HasSubstr("nonsense("));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(GnuplotFigure, NeedsNoFolderForTemporaryFiles) {
  const test::ScratchFolder folder;
  const char* const usual = std::getenv("TMPDIR");
  const std::string before = usual == nullptr ? "" : usual;
  setenv("TMPDIR", "/nowhere", 1);
  GnuplotFigure figure("anywhere", 400, 300);
  figure.add("plot x");
  EXPECT_NO_THROW(require_gnuplot());
  EXPECT_NO_THROW(figure.draw(folder / "a"));
  if (usual == nullptr)
    unsetenv("TMPDIR");
  else
    setenv("TMPDIR", before.c_str(), 1);
}

TEST(GnuplotFigure, IsWrittenWholeOrNotAtAll) {
  const test::ScratchFolder folder;
  GnuplotFigure figure("full disk", 400, 300);
  figure.add("plot x");
  for (const rlim_t limit : {2000u, 6000u}) {
    const test::FileSizeLimit full_disk(limit);
    EXPECT_THROW(figure.draw(folder / "a"), FileError) << limit;
    EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << limit;
  }
}

TEST(GnuplotFigure, CannotBeLedToRunCommandsByItsTexts) {
  EXPECT_EQ(gnuplot_quoted("a'b\nsystem('x')"), "'a''b system(''x'')'");
}

std::vector<OutcomeGroup> example_groups() {
  std::vector<OutcomeGroup> groups = {{"field", {}}, {"ray casting", {}}};
  for (OutcomeGroup& group : groups)
    for (std::uint64_t i = 0; i < 240; ++i) {
      HashRandom random(group.label.size(), i);
      const double initial_mm = static_cast<double>(i) / 15.0;
      const bool fails = random.uniform() * 16 < initial_mm - 5;
      group.outcomes.push_back(
          {initial_mm, fails ? random.uniform(2, 25) : 0.4 + 0.2 * std::abs(random.normal())});
    }
  groups[0].outcomes[200].tre_mm = std::nan("");
  return groups;
}

TEST(Figures, AreDrawnWithTitlesAndUnits) {
  const test::ScratchFolder folder;
  const auto groups = example_groups();
  std::vector<PsnrGroup> fields = {{"camera A", {}}, {"camera B", {}}};
  for (std::uint64_t i = 0; i < 100; ++i) {
    fields[0].psnr_db.push_back(42.5 + 1.5 * HashRandom(1, i).normal());
    fields[1].psnr_db.push_back(43.5 + 1.0 * HashRandom(2, i).normal());
  }
  fields[1].psnr_db[3] = std::numeric_limits<double>::infinity();
  draw_psnr_boxes(fields, PaperLevels::Shown, folder / "psnr");
  draw_success_rates(groups, 8, 2.0, folder / "success");
  draw_tre_histogram(groups, folder / "histogram");
  draw_tre_scatter(groups, 16.0, folder / "scatter");
  EXPECT_THAT(read_text_file(folder / "psnr.svg"), HasSubstr("PSNR (dB)"));
  EXPECT_THAT(read_text_file(folder / "success.svg"), HasSubstr("initial TRE (mm)"));
  EXPECT_THAT(read_text_file(folder / "histogram.svg"), HasSubstr("share of starts (%)"));
  EXPECT_THAT(read_text_file(folder / "scatter.svg"), HasSubstr("final TRE (mm)"));
  for (const char* name : {"psnr", "success", "histogram", "scatter"})
    EXPECT_THAT(read_text_file(folder / (std::string(name) + ".svg")), Not(HasSubstr("nan")));
}

TEST(Figures, HaveTheirNumbersBesideThem) {
  const test::ScratchFolder folder;
  const std::vector<OutcomeGroup> groups = {
      {"field", {{1.0, 0.3}, {1.5, 4.9}, {3.0, std::nan("")}, {9.0, 0.1}}}};
  draw_success_rates(groups, 2, 2.0, folder / "success");
  draw_tre_histogram(groups, folder / "histogram");
  draw_tre_scatter(groups, 16.0, folder / "scatter");
  draw_psnr_boxes({{"camera A", {40.5, 41.0}}}, PaperLevels::Hidden, folder / "psnr");

  const CsvTable success = CsvTable::read(folder / "success.csv");
  ASSERT_EQ(success.row_count(), 2u);
  EXPECT_EQ(success.number(0, "rate"), 0.5);
  EXPECT_EQ(success.text(1, "successes"), "0");
  const CsvTable histogram = CsvTable::read(folder / "histogram.csv");
  ASSERT_EQ(histogram.row_count(), 21u);
  EXPECT_EQ(histogram.number(1, "share"), 0.25) << "0.25 to 0.5 mm";
  EXPECT_EQ(histogram.text(20, "high_mm"), "inf");
  EXPECT_EQ(histogram.number(20, "share"), 0.25) << "without a pose";
  EXPECT_EQ(CsvTable::read(folder / "scatter.csv").text(2, "tre_mm"), "nan");
  EXPECT_EQ(CsvTable::read(folder / "psnr.csv").number(1, "psnr_db"), 41.0);
}

TEST(Figures, DrawAPartOfVeryManyStartsAndSaySo) {
  const test::ScratchFolder folder;
  OutcomeGroup group{"field", {}};
  for (int i = 0; i < 8001; ++i) group.outcomes.push_back({1.0, 0.001 * i});
  draw_tre_scatter({group}, 16.0, folder / "scatter");
  EXPECT_THAT(read_text_file(folder / "scatter.svg"), HasSubstr("one start in 3"));
  const CsvTable drawn = CsvTable::read(folder / "scatter.csv");
  EXPECT_EQ(drawn.row_count(), 2667u);
  EXPECT_EQ(drawn.text(2666, "tre_mm"), number_text(0.001 * 7998));
}

TEST(Figures, AreDrawnForEmptyGroups) {
  const test::ScratchFolder folder;
  const std::vector<OutcomeGroup> groups = {{"field", {{1.0, std::nan("")}}}};
  EXPECT_NO_THROW(draw_tre_histogram(groups, folder / "histogram"));
  EXPECT_NO_THROW(draw_success_rates(groups, 8, 2.0, folder / "success"));
  EXPECT_NO_THROW(draw_success_rates({{"field", {{40.0, 1.0}}}}, 8, 2.0, folder / "beyond"));
  EXPECT_NO_THROW(draw_tre_scatter(groups, 16.0, folder / "scatter"));
  EXPECT_NO_THROW(draw_psnr_boxes({{"camera A", {}}}, PaperLevels::Hidden, folder / "psnr"));
}

}  // namespace
}  // namespace af::evaluation
