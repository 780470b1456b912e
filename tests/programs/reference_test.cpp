// SPDX-License-Identifier: Apache-2.0
// docs/reference/ is what the programs print of themselves and what the code knows of its files.
// After a change: AF_WRITE_REFERENCE=1 build/release/tests/reference_tests
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "field/field_layout.h"
#include "field/field_writing.h"
#include "files/output_file.h"
#include "register/results/registration_columns.h"
#include "register/results/registration_results.h"
#include "study/study_template.h"
#include "support/run_program.h"

namespace af {
namespace {

namespace fs = std::filesystem;

/// The page in the tree is `text`; or becomes it, when that is asked for.
void expect_page(const std::string& name, const std::string& text) {
  const fs::path path = fs::path(AF_SOURCE_FOLDER) / "docs" / "reference" / name;
  if (std::getenv("AF_WRITE_REFERENCE") != nullptr) write_text_file(path, text);
  EXPECT_EQ(fs::exists(path) ? read_text_file(path) : "", text)
      << path << " differs from the code: AF_WRITE_REFERENCE=1 " << AF_REFERENCE_PROGRAM;
}

std::string dataset_table() {
  std::ostringstream out;
  out << "| Dataset | Type | Extents | Unit | Frame |\n|---|---|---|---|---|\n";
  std::vector<field_layout::DatasetRule> rules = field_layout::payload_rules(1, {true, true});
  for (const field_layout::DatasetRule& rule : field_layout::provenance_rules())
    rules.push_back(rule);
  for (const field_layout::DatasetRule& rule : rules) {
    out << "| `" << rule.name << "` | " << to_string(rule.type) << " | ";
    for (std::size_t i = 0; i < rule.extents.size(); ++i)
      out << (i == 0 ? "" : " x ") << (i == 0 && rule.is_first_extent_free ? "up to " : "")
          << rule.extents[i];
    out << " | " << rule.units << " | " << rule.frame << " |\n";
  }
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
  page
      << "# Files\n\nThis page is made from the code (`tests/programs/reference_test.cpp`).\n\n"
      << "## study.toml\n\n`af-inspect --template study` prints this:\n\n```toml\n"
      << template_text("study") << "```\n\n## rig.toml\n\n`af-inspect --template rig` prints "
      << "this:\n\n```toml\n"
      << template_text("rig") << "```\n\n## scan.toml\n\n`af-inspect --template scan` prints "
      << "this ([how it is used](../real-xrays.md)):\n\n```toml\n"
      << template_text("scan") << "```\n\n## Fields (`.af.h5`)\n\nHDF5, format "
      << field_layout::kFormat << ", version " << field_layout::kFormatVersion
      << ". A field of several depth slabs has `/geometry/slab_1/`, `/field/slab_1` and so on. "
      << "`/field/slab_0/codewords` holds the codeword of each tile, uint16, by (u, v, s, t). "
      << "Fields of mean-removed tiles have `/codebook/mean_step`, and in `/field/slab_0/means` "
         "the "
      << "means of the tiles in levels, uint16, by (u, v, t, s). Along t a mean is stored as the "
      << "difference from the one before, modulo 65536, but every " << kMeanRunTiles
      << "th as it is, from the first on. Codeword 0 is an empty tile; the level of any other "
      << "tile's element is its mean + the codeword's element - 32768, within 0 and 65535. Fields "
      << "with a tile filter have `/codebook/tile_filter`, the weights by which decoded tiles are "
      << "corrected ([how](../../precompute/README.md#tile-filter)). Chunks are shuffled, deflated "
      << "and carry HDF5's Fletcher-32. "
      << "[Frames](../../common/geometry/README.md), "
      << "[coding](../coding.md).\n\n"
      << dataset_table() << "\nAn atlas (`af-precompute --orbit`, [page](../other-cameras.md)) has "
      << "the format " << field_layout::kAtlasFormat << " and the same version. In its root stand `"
      << field_layout::member_count_rule().name << "`, `/identity` of the camera that the orbit "
      << "begins from, `/codebook` and `/provenance`; each field is a group, `"
      << field_layout::member_group(0) << "`, `" << field_layout::member_group(1)
      << "`, ..., with `geometry`, `identity` and `field` as above.\n"
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

}  // namespace
}  // namespace af
