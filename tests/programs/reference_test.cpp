// SPDX-License-Identifier: Apache-2.0
// docs/reference/ must be what the programs print about themselves and what the code knows of its
// files. field-format.md is written by hand, and must have the code's rules. After a change:
// AF_WRITE_REFERENCE=1 build/release/tests/reference_tests
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "field/field_layout.h"
#include "files/output_file.h"
#include "register/results/registration_columns.h"
#include "register/results/registration_results.h"
#include "study/study_template.h"
#include "support/run_program.h"

namespace af {
namespace {

namespace fs = std::filesystem;

/// Expects the page in the tree to be `text`, or writes it when AF_WRITE_REFERENCE is set.
void expect_page(const std::string& name, const std::string& text) {
  const fs::path path = fs::path(AF_SOURCE_FOLDER) / "docs" / "reference" / name;
  if (std::getenv("AF_WRITE_REFERENCE") != nullptr) write_text_file(path, text);
  EXPECT_EQ(fs::exists(path) ? read_text_file(path) : "", text)
      << path << " differs from the code: AF_WRITE_REFERENCE=1 " << AF_REFERENCE_PROGRAM;
}

/// A dataset's row in field-format.md, without the description.
std::string row_of(const field_layout::DatasetRule& rule) {
  std::ostringstream out;
  out << "| `" << rule.name << "` | " << to_string(rule.type) << " | ";
  for (std::size_t i = 0; i < rule.extents.size(); ++i)
    out << (i == 0 ? "" : " x ") << (i == 0 && rule.is_first_extent_free ? "up to " : "")
        << rule.extents[i];
  out << " | " << rule.units << " | " << rule.frame << " | ";
  return out.str();
}

std::string code_list(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "`" : ", `") + name + "`";
  return text;
}

std::string file_page() {
  using namespace registration;
  std::ostringstream page;
  page << "# Files\n\nThis page is made from the code (`tests/programs/reference_test.cpp`).\n\n"
       << "## study.toml\n\n`af-inspect --template study` prints this:\n\n```toml\n"
       << template_text("study") << "```\n\n## rig.toml\n\n`af-inspect --template rig` prints "
       << "this:\n\n```toml\n"
       << template_text("rig") << "```\n\n## scan.toml\n\n`af-inspect --template scan` prints "
       << "this ([how it is used](../real-xrays.md)):\n\n```toml\n"
       << template_text("scan") << "```\n\n## Fields (`.af.h5`)\n\n"
       << "[field-format.md](field-format.md) states their format.\n"
       << "\n## Results of af-register\n\nIn the folder of `--output`: "
       << code_list(result_file_names())
       << ", one `CAMERA-overlay.png` per view, and `slicer/`. Which of them are there depends on "
       << "the verdict ([register/README.md](../../register/README.md)).\n\n"
       << "## registrations.csv\n\nOne row per registration, with these columns; `af-evaluate` "
       << "and `--correct` add more between them ([errors.md](../errors.md) defines the "
       << "errors):\n\n"
       << code_list(columns_of(registration_cells({}, {}, {})))
       << "\n\nWith `--correct`: " << code_list(columns_of(correction_cells({})))
       << ".\n\nWithout `--no-uncertainty` ([uncertainty.md](../uncertainty.md)): "
       << code_list(columns_of(judge_cells({}))) << ", "
       << code_list(columns_of(uncertainty_cells({}, 0.0))) << ".\n\n"
       << "## summary.json\n\nIn the folder of a finished run of `af-evaluate`; `af-evaluate "
       << "report` reads it. Numbers that are not known are null.\n\n"
       << "| Key | Of which kinds | What |\n|---|---|---|\n"
       << "| `format`, `format_version` | all | \"attenuation-fields evaluation\", 1 |\n"
       << "| `kind` | all | \"registration\", \"image-quality\", \"field-parameters\", "
          "\"similarity-curves\" or \"error-budget\" |\n"
       << "| `provenance` | all | program and version, command line, options in force, seed, "
          "SHA-256 of the inputs (`input_sha256`), where CTs lie (`input_grids`), how X-rays, CTs "
          "and fields are read (`input_notes`), "
          "host, start |\n"
       << "| `figures`, `pictures` | all that draw | names of figures without ending; files of "
          "pictures and what they show |\n"
       << "| `study`, `method`, `success_tre_mm`, `start_rule`, `simulation` | registration | the "
          "study's path; preset, similarity and optimisers; what a success and a start are; how "
          "the study was simulated, or null |\n"
       << "| `cases` | registration | per case its gold pose, region and starts |\n"
       << "| `renderers` | registration, similarity-curves | per renderer successes, TRE, times "
          "and their intervals; or the curves' maxima |\n"
       << "| `field_against_raycast` | registration | the same starts by both renderers |\n"
       << "| `row_problems`, `warnings` | registration | rows that failed, and what to mind |\n"
       << "| `field`, `loss_split` | image-quality | the field; shares of the mean squared "
          "difference |\n"
       << "| `steps`, `common_starts`, `gold` | error-budget | what each part of the error moves "
          "|\n";
  return page.str();
}

TEST(Reference, OfEveryProgramIsWhatItPrints) {
  for (const char* name : {"af-precompute",
                           "af-drr",
                           "af-simulate",
                           "af-scan",
                           "af-register",
                           "af-evaluate",
                           "af-inspect",
                           "af-convert",
                           "af-report"}) {
    const test::ProgramRun run =
        test::run_command(std::string(AF_PROGRAM_FOLDER "/") + name + " --help-as markdown");
    ASSERT_EQ(run.exit_code, 0) << run.output;
    expect_page(std::string(name) + ".md", run.output);
  }
}

TEST(Reference, OfFilesIsWhatTheCodeKnows) {
  expect_page("files.md", file_page());
}

/// Datasets of tiles are left to test_field_format.py, because the lattice decides their extents.
TEST(Reference, OfFieldFilesHasTheRulesOfTheCode) {
  using namespace field_layout;
  std::vector<std::string> texts = {
      "format " + std::string(kFormat) + ", version " + std::to_string(kFormatVersion) + ".",
      "1 to " + std::to_string(kMaxSlabs) + " depth slabs",
      "1 to " + std::to_string(kMaxMembers) + " fields"};
  for (const auto& rules : {payload_rules(1, {true, true}),
                            range_rules(),
                            provenance_rules(),
                            {material_rule(), member_count_rule()}})
    for (const DatasetRule& rule : rules) texts.push_back(row_of(rule));
  const std::string page =
      read_text_file(fs::path(AF_SOURCE_FOLDER) / "docs" / "reference" / "field-format.md");
  for (const std::string& text : texts) EXPECT_NE(page.find(text), std::string::npos) << text;
}

}  // namespace
}  // namespace af
