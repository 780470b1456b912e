// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/csv_table.h"
#include "files/output_file.h"
#include "programs/small_study.h"
#include "support/run_program.h"
#include "support/test_paths.h"

namespace af::test {

/// af-evaluate in a folder that begins with the small study and its fields.
class EvaluatedStudy : public testing::Test {
 protected:
  /// The study, its fields and what `prepare_more` adds are made once for all tests.
  static void set_up(const std::function<void()>& prepare_more) {
    folder_ = new ScratchFolder();
    prepare_once(folder_->path(), [&] {
      write_small_study(folder_->path());
      for (const char* camera : {"AP", "LAT"}) {
        const ProgramRun run =
            run_command(std::string(AF_PROGRAM_FOLDER "/af-precompute --study ") +
                        path("study.toml") + " --camera " + camera +
                        " --max-rotation-deg 15 --max-translation-mm 12 --uv-nodes 20 --st-nodes 64"
                        " --codewords 512 -o " +
                        path(std::string(camera) + ".af.h5"));
        ASSERT_EQ(run.exit_code, 0) << run.output;
      }
      prepare_more();
    });
  }
  static void TearDownTestSuite() { delete folder_; }

  static std::string path(const std::string& name) { return (*folder_ / name).string(); }
  static std::string text(const std::string& name) { return read_text_file(*folder_ / name); }
  static std::string fields() {
    return " --field AP=" + path("AP.af.h5") + " --field LAT=" + path("LAT.af.h5") + " ";
  }
  static ProgramRun evaluate(const std::string& arguments, int ranks = 0) {
    const std::string launcher =
        ranks == 0 ? "" : std::string(AF_MPIEXEC " -n ") + std::to_string(ranks) + " ";
    return run_command(launcher + AF_PROGRAM_FOLDER "/af-evaluate " + arguments);
  }
  /// The words of such a command under mpirun.
  static std::vector<std::string> on_ranks(int ranks, const std::string& arguments) {
    std::vector<std::string> words = {
        AF_MPIEXEC, "-n", std::to_string(ranks), AF_PROGRAM_FOLDER "/af-evaluate"};
    std::istringstream rest(arguments);
    for (std::string word; rest >> word;) words.push_back(word);
    return words;
  }
  /// registrations.csv without its last column, the timings.
  static std::string rows_without_seconds(const std::string& folder) {
    const CsvTable table = CsvTable::read(path(folder + "/registrations.csv"));
    EXPECT_EQ(table.columns().back(), "seconds");
    std::string result;
    for (std::size_t i = 0; i < table.row_count(); ++i)
      for (const std::string& column : table.columns())
        if (column != "seconds") result += table.text(i, column) + ",";
    return result;
  }
  static void expect_refused(const ProgramRun& run, int exit_code, const std::string& part) {
    EXPECT_EQ(run.exit_code, exit_code) << run.output;
    EXPECT_THAT(run.output, testing::HasSubstr(part));
  }

 private:
  static inline ScratchFolder* folder_ = nullptr;
};

}  // namespace af::test
