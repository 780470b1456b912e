// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <fstream>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "evaluate/outputs/failed_start.h"
#include "evaluate/outputs/sample_summary_json.h"
#include "evaluate/registration/registration_statistics.h"
#include "evaluate/report/evaluation_run.h"
#include "evaluate/report/html_text.h"
#include "evaluate/report/number_html.h"
#include "evaluate/report/report_style.h"
#include "evaluate/report/sections_report.h"
#include "files/output_file.h"
#include "support/test_paths.h"

namespace af::evaluation {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

TEST(HtmlText, EscapesWhatMeansSomethingToHtml) {
  EXPECT_EQ(escaped("<script>\"a\" & 'b'</script>"),
            "&lt;script&gt;&quot;a&quot; &amp; &#39;b&#39;&lt;/script&gt;");
}

TEST(HtmlText, Base64EqualsTheVectorsOfRfc4648) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foob"), "Zm9vYg==");
  EXPECT_EQ(base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64(std::string("\xff\x00\xfe", 3)), "/wD+");
}

TEST(HtmlText, TableEscapesTitlesAndAlignsNumbers) {
  HtmlTable table({{"a < b", false}, {"n", true}});
  table.add_row({"x", "1"}, "reference");
  EXPECT_THAT(table.html(), HasSubstr("a &lt; b"));
  EXPECT_THAT(table.html(), HasSubstr("<tr class=\"reference\"><td>x</td><td class=\"number\">1"));
}

TEST(HtmlText, UrlsKeepPathsAndEscapeTheRest) {
  EXPECT_EQ(url_of("../a-b/c_d.csv"), "../a-b/c_d.csv");
  EXPECT_EQ(url_of("a study/50%#1?.csv"), "a%20study/50%25%231%3F.csv");
  EXPECT_EQ(url_of("\xc3\xa4"), "%C3%A4");
}

TEST(SummarySection, SaysWhichRunsHaveSimulatedXrays) {
  std::vector<EvaluationRun> runs;
  for (const char* name : {"one", "two", "three", "four", "five"})
    runs.push_back({"", "registration", {{"simulation", nullptr}}, name});
  EXPECT_THAT(summary_section(runs), Not(HasSubstr("simulated")));
  runs[1].summary["simulation"] = runs[3].summary["simulation"] = json::object();
  EXPECT_THAT(
      summary_section(runs),
      HasSubstr("<strong>The X-rays of 2 of 5 runs of registrations are simulated</strong> (two, "
                "four), with"));
  for (EvaluationRun& run : runs) run.summary["simulation"] = json::object();
  EXPECT_THAT(summary_section(runs), HasSubstr("<strong>The X-rays are simulated</strong>, with"));
}

// Its TREs of 40 mm say nothing: the place is right.
TEST(SummarySection, SaysOfOneViewWhatItsMrpdSays) {
  RegistrationRow row;
  row.case_name = "a";
  row.renderer = "field";
  row.initial_tre_mm = 3.0;
  row.tre_mm = 40.0;
  row.errors.mrpd_mm = 0.4;
  row.has_one_view = true;
  const std::vector<RegistrationRow> rows = {row};
  const auto sentences = [&](int views) {
    const EvaluationRun run{"",
                            "registration",
                            {{"simulation", nullptr},
                             {"success_tre_mm", 2.5},
                             {"cases", {{{"case", "a"}, {"views", views}}}},
                             {"field_against_raycast", nullptr},
                             {"renderers", {renderer_statistics(rows, "field", {})}}},
                            "run"};
    return summary_section({run});
  };
  EXPECT_THAT(sentences(1), HasSubstr("1 of 1 registration (100"));
  EXPECT_THAT(sentences(1), HasSubstr("<div class=\"value\">100"));
  EXPECT_THAT(sentences(1), HasSubstr("reprojection distance (mRPD) below 2.5 mm"));
  EXPECT_THAT(sentences(2), HasSubstr("0 of 1 registration (0"));
  EXPECT_THAT(sentences(2), HasSubstr("<div class=\"value\">0\xC2\xA0%"));
}

TEST(RepeatCommand, NamesTheStartAndKeepsBothRenderersWhereRayCastingDependsOnFields) {
  const json both = {{"repeat",
                      {{"command", "cd /w && af-evaluate registration --study s.toml"},
                       {"renderer", "both"},
                       {"output", "/w/run/repeats"}}}};
  EXPECT_EQ(repeat_command(both, "skull", "field", 12),
            "cd /w && af-evaluate registration --study s.toml --case skull --renderer field "
            "--only-start 12 --output /w/run/repeats/skull-field-12");
  EXPECT_THAT(repeat_command(both, "a b", "raycast", 3),
              HasSubstr("--case 'a b' --renderer both --only-start 3 --output "
                        "/w/run/repeats/a_b-raycast-3"));
  json alone = both;
  alone["repeat"]["renderer"] = "raycast";
  EXPECT_THAT(repeat_command(alone, "skull", "raycast", 3), HasSubstr("--renderer raycast"));
  EXPECT_EQ(repeat_command({{"repeat", nullptr}}, "skull", "theirs", 3), "");
  EXPECT_EQ(repeat_command(json::object(), "skull", "field", 3), "");
}

TEST(ReportScript, NeedsNothingFromOutside) {
  EXPECT_THAT(std::string(report_script()), HasSubstr("aria-sort"));
  for (const char* part : {"fetch(", "XMLHttpRequest", "import", "eval(", "</script"})
    EXPECT_THAT(std::string(report_script()), Not(HasSubstr(part)));
}

TEST(ReportStyle, NeedsNothingFromOutside) {
  EXPECT_THAT(std::string(report_style()), Not(HasSubstr("url(")));
  EXPECT_THAT(std::string(report_style()), Not(HasSubstr("@import")));
  EXPECT_THAT(std::string(report_style()), HasSubstr("prefers-color-scheme: dark"));
}

TEST(NumberHtml, ShowsWhatDoesNotExistAsADash) {
  EXPECT_EQ(decimals(json(nullptr), 2), "–");
  EXPECT_EQ(decimals(json("inf"), 2), "∞");
  EXPECT_EQ(decimals(json(1.005), 1), "1.0");
}

TEST(NumberHtml, NeverRoundsAFailureAway) {
  EXPECT_EQ(percent(1.0), "100\u00a0%");
  EXPECT_EQ(percent(0.997), "99.7\u00a0%");
  EXPECT_EQ(percent(0.9), "90\u00a0%");
  EXPECT_EQ(percent(0.004), "0.4\u00a0%");
  EXPECT_EQ(percent(0.0), "0\u00a0%");
}

TEST(NumberHtml, ChoosesTheUnitOfTimes) {
  EXPECT_EQ(seconds_text(0.00123), "1.2 ms");
  EXPECT_EQ(seconds_text(0.0426), "43 ms");
  EXPECT_EQ(seconds_text(0.2), "0.20 s");
  EXPECT_EQ(seconds_text(42.58), "42.6 s");
}

TEST(SummaryJson, KeepsWhatJsonLacks) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(number_of(json::parse(number_json(infinity).dump())), infinity);
  EXPECT_TRUE(std::isnan(number_of(json::parse(number_json(std::nan("")).dump()))));
  EXPECT_EQ(number_of(number_json(0.1)), 0.1);
}

/// A folder with `text` as NAME/summary.json.
void write_summary(const test::ScratchFolder& folder,
                   const std::string& name,
                   const std::string& text) {
  std::filesystem::create_directories(folder / name);
  write_text_file(folder / name / "summary.json", text);
}

std::string minimal_summary(const std::string& kind) {
  return json({{"format", "attenuation-fields evaluation"}, {"format_version", 1}, {"kind", kind}})
      .dump();
}

TEST(XraySection, NamesEveryEffectOfStressAndWhichCtTheXraysShow) {
  EvaluationRun run;
  run.kind = "registration";
  run.summary["simulation"] = {{"program_version", "1.0"}, {"options_toml", ""}};
  EXPECT_NE(xray_section({run}).find("through the CT itself"), std::string::npos);
  EXPECT_EQ(xray_section({run}).find("--stress"), std::string::npos);

  run.summary["simulation"]["stress"] = {{{"name", "rods"}, {"text", "2 rods < 5 mm"}},
                                         {{"name", "motion"}, {"text", "by up to 6 mm"}}};
  const std::string text = xray_section({run});
  EXPECT_EQ(text.find("through the CT itself"), std::string::npos);
  EXPECT_NE(text.find("<strong>rods</strong>: 2 rods &lt; 5 mm"), std::string::npos);
  EXPECT_NE(text.find("<strong>motion</strong>: by up to 6 mm"), std::string::npos);
}

/// The section on X-rays that were simulated with these effects.
std::string xray_text_with(const std::vector<std::string>& effects, const std::string& options) {
  EvaluationRun run;
  run.kind = "registration";
  run.summary["simulation"] = {{"program_version", "1.0"}, {"options_toml", options}};
  for (const std::string& effect : effects)
    run.summary["simulation"]["stress"].push_back({{"name", effect}, {"text", "so much"}});
  return xray_section({run});
}

TEST(XraySection, SaysWhatTheXraysWereTakenOf) {
  const auto expect_ct = [](const std::vector<std::string>& effects, const std::string& expected) {
    for (const char* options : {"ideal = false\n", "ideal = true\n"})
      EXPECT_NE(xray_text_with(effects, options).find(expected), std::string::npos)
          << options << xray_text_with(effects, options);
  };
  expect_ct({}, "through the CT itself,");
  for (const char* effect : {"rods", "fiducials", "heel", "scatter", "noise", "calibration"})
    expect_ct({effect}, "through the CT itself,");
  expect_ct({"degraded-ct"},
            "through the original CT (the CT that is registered is a degraded one)");
  expect_ct({"motion"}, "through the CT after a motion that deformed it (");
  EXPECT_EQ(xray_text_with({"motion"}, "").find("original CT"), std::string::npos);
  expect_ct({"degraded-ct", "motion"},
            "through the original CT after a motion that deformed it (the CT that is registered is "
            "a degraded one, from before the motion)");
}

TEST(XraySection, DoesNotCallXraysLineIntegralsThatStressMadeOthers) {
  const std::string ideal = "ideal = true\n";
  EXPECT_NE(xray_text_with({}, ideal).find("they are line integrals"), std::string::npos);
  EXPECT_EQ(xray_text_with({"noise"}, ideal).find("they are line integrals"), std::string::npos);
  EXPECT_NE(xray_text_with({"noise"}, ideal).find("but those named below"), std::string::npos);
}

TEST(FindRuns, FindsRunsBelowAFolderOnceAndInAFixedOrder) {
  const test::ScratchFolder folder;
  write_summary(folder, "b/quality", minimal_summary("image-quality"));
  write_summary(folder, "a/quality", minimal_summary("image-quality"));
  write_summary(folder, "c", minimal_summary("registration"));
  write_summary(folder, "other", "{\"format\": \"of another program\"}");
  const auto runs = find_runs({folder.path(), folder / "a"});
  ASSERT_EQ(runs.size(), 3u);
  EXPECT_EQ(runs[0].kind, "registration");
  EXPECT_EQ(runs[1].folder.parent_path().filename(), "a");
  EXPECT_EQ(runs[2].folder.parent_path().filename(), "b");
}

TEST(FindRuns, NamesRunsByWhatTellsThemApartAndLinksToTheirFiles) {
  const test::ScratchFolder folder;
  write_summary(folder, "skull/registration", minimal_summary("registration"));
  write_summary(folder, "thorax 2/registration", minimal_summary("registration"));
  auto runs = find_runs({folder.path()});
  EXPECT_EQ(runs[0].name, "skull");
  EXPECT_EQ(runs[1].name, "thorax 2");
  runs[1].page_folder = std::filesystem::weakly_canonical(folder / "skull");
  EXPECT_EQ(runs[1].link("starts.csv"), "../thorax%202/registration/starts.csv");
  EXPECT_EQ(find_runs({folder / "skull"})[0].name, "registration");
  // Side by side in one folder: nothing is left out.
  write_summary(folder, "flat/first", minimal_summary("registration"));
  write_summary(folder, "flat/second", minimal_summary("registration"));
  EXPECT_EQ(find_runs({folder / "flat"})[0].name, "first");
  EXPECT_EQ(find_runs({folder / "flat"})[1].name, "second");
  // One run in another's folder: both have a name.
  write_summary(folder, "skull", minimal_summary("image-quality"));
  for (const EvaluationRun& run : find_runs({folder / "skull"})) EXPECT_FALSE(run.name.empty());
}

TEST(FindRuns, LeavesOutRepeatsOfSingleStartsUnlessTheyAreNamed) {
  const test::ScratchFolder folder;
  write_summary(folder, "run", minimal_summary("registration"));
  json repeat = json::parse(minimal_summary("registration"));
  repeat["only_start"] = 12;
  write_summary(folder, "run/repeats/skull-field-12", repeat.dump());
  EXPECT_EQ(find_runs({folder.path()}).size(), 1u);
  EXPECT_EQ(find_runs({folder / "run/repeats/skull-field-12"}).size(), 1u);
}

TEST(FindRuns, RefusesWhatIsNotASoundRun) {
  const test::ScratchFolder folder;
  EXPECT_THROW(find_runs({folder / "missing"}), FileError);
  EXPECT_THROW(find_runs({folder.path()}), InputError);
  write_summary(folder, "truncated", minimal_summary("registration").substr(0, 40));
  EXPECT_THROW(find_runs({folder / "truncated"}), FileError);
  write_summary(folder, "list", "[1, 2]");
  EXPECT_THROW(find_runs({folder / "list"}), FileError);
  write_summary(folder, "strange", minimal_summary("strange"));
  EXPECT_THROW(find_runs({folder / "strange"}), FileError);
  json newer = json::parse(minimal_summary("registration"));
  newer["format_version"] = 2;
  write_summary(folder, "newer", newer.dump());
  EXPECT_THROW(find_runs({folder / "newer"}), FileError);
}

TEST(FindRuns, ARunGivesOnlyItsOwnFiles) {
  const test::ScratchFolder folder;
  write_summary(folder, "run", minimal_summary("registration"));
  write_text_file(folder / "secret", "secret");
  const auto runs = find_runs({folder.path()});
  EXPECT_THAT(runs[0].file("summary.json"), HasSubstr("registration"));
  for (const char* name : {"../secret", "/etc/hostname", "", ".", "..", "sub/file", "missing.png"})
    EXPECT_THROW(std::ignore = runs[0].file(name), FileError) << name;
}

TEST(FindRuns, ARunGivesNothingThatALinkBringsFromElsewhere) {
  const test::ScratchFolder folder;
  write_summary(folder, "run", minimal_summary("registration"));
  write_text_file(folder / "secret", "secret");
  write_text_file(folder / "run/own.csv", "a\n1\n");
  std::filesystem::create_symlink("../secret", folder / "run/link.png");
  std::filesystem::create_symlink("own.csv", folder / "run/link.csv");
  std::filesystem::create_directory_symlink("..", folder / "run/up");
  std::filesystem::create_directory(folder / "run/folder.png");
  const auto runs = find_runs({folder.path()});
  EXPECT_EQ(runs[0].table("link.csv").number(0, "a"), 1.0);
  EXPECT_THROW(std::ignore = runs[0].file("link.png"), FileError);
  EXPECT_THROW(std::ignore = runs[0].file("folder.png"), FileError);
  EXPECT_THROW(std::ignore = runs[0].table("up/secret"), FileError);
  EXPECT_THROW(std::ignore = runs[0].table("../secret"), FileError);
  EXPECT_THROW(std::ignore = runs[0].file(std::string("own.csv\0x", 9)), FileError);
  EXPECT_THROW(std::ignore = runs[0].has_file(std::string(300, 'n')), FileError);
  EXPECT_FALSE(runs[0].has_file("missing.csv"));
}

TEST(FindRuns, ASummaryThatIsALinkToElsewhereIsRefused) {
  const test::ScratchFolder folder;
  write_summary(folder, "mine", minimal_summary("registration"));
  std::filesystem::create_directory(folder / "theirs");
  std::filesystem::create_symlink("../mine/summary.json", folder / "theirs/summary.json");
  EXPECT_EQ(find_runs({folder / "mine"}).size(), 1u);
  EXPECT_THROW(find_runs({folder / "theirs"}), FileError);
}

TEST(FindRuns, LinksLeadBelowTheRunOnly) {
  const test::ScratchFolder folder;
  write_summary(folder, "run", minimal_summary("registration"));
  auto runs = find_runs({folder.path()});
  runs[0].page_folder = std::filesystem::weakly_canonical(folder.path());
  EXPECT_EQ(runs[0].link("slicer/a b"), "run/slicer/a%20b");
  for (const char* name : {"../other", "//host/x", "/etc/hostname", "a/../../other", ""})
    EXPECT_THROW(std::ignore = runs[0].link(name), FileError) << name;
}

TEST(NumberHtml, ShowsNothingButNumbersAsTheyStand) {
  EXPECT_EQ(plain(json(512)), "512");
  EXPECT_EQ(plain(json(0.25)), "0.25");
  for (const json& value : {json("<b>"), json(nullptr), json::array({1}), json(true)})
    EXPECT_EQ(plain(value), "–");
  EXPECT_EQ(count_of(json(7)), 7);
  for (const json& value : {json(-1), json(1.5), json(1e300), json("7"), json(nullptr)})
    EXPECT_THROW(count_of(value), FileError) << value;
}

TEST(SimilaritySection, EscapesTheTextsOfTheRun) {
  const test::ScratchFolder folder;
  write_summary(folder, "run", minimal_summary("similarity-curves"));
  write_text_file(folder / "run/similarity-curves.svg", "<svg/>");
  auto runs = find_runs({folder.path()});
  const json peak = {{"parameter", "<i>"},
                     {"unit", "<b>"},
                     {"is_at_edge", false},
                     {"offset", 0.1},
                     {"width", 1.0},
                     {"width_mm_at_target", 1.0}};
  runs[0].summary["case"] = "<u>";
  runs[0].summary["renderers"] = {
      {{"renderer", "field"}, {"maxima", {peak}}, {"broadest_rotation", "<s>"}}};
  const std::string html = similarity_section(runs);
  for (const char* tag : {"<i>", "<b>mm", "<u>", "<s>", "1.00 <b>"})
    EXPECT_THAT(html, Not(HasSubstr(tag)));
  for (const char* text : {"&lt;i&gt;", "0.10 &lt;b&gt;", "&lt;u&gt;", "is &lt;s&gt;."})
    EXPECT_THAT(html, HasSubstr(text));
}

}  // namespace
}  // namespace af::evaluation
