// SPDX-License-Identifier: Apache-2.0
#include "ranks/provenance.h"

#include <cstdlib>
#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/build_info.h"
#include "base/vector_width.h"
#include "files/output_file.h"
#include "support/io_checks.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

Provenance example() {
  return {"af-register",
          "'sh' -c 'printf \"%s|%s\\n\" \"$PWD\" \"it'\\''s\" > out.txt'",
          "seed = 7\n",
          7,
          1,
          {{"ct.nii.gz", std::string(64, 'a')}}};
}

class WorkingFolder {
 public:
  explicit WorkingFolder(const fs::path& folder) : before_(fs::current_path()) {
    fs::current_path(folder);
  }
  ~WorkingFolder() { fs::current_path(before_); }
  WorkingFolder(const WorkingFolder&) = delete;
  WorkingFolder& operator=(const WorkingFolder&) = delete;

 private:
  fs::path before_;
};

int run(const std::string& command) {
  return std::system(command.c_str());
}  // NOLINT: a test's own

TEST(Provenance, JsonRecordsTheMakingOfAnOutput) {
  const nlohmann::json json = to_json(example());
  EXPECT_EQ(json["program"], "af-register");
  EXPECT_EQ(json["program_version"], program_version());
  // A test is not one of the programs, so it has no commit.
  EXPECT_EQ(json["program_commit"], "unknown");
  EXPECT_EQ(json["compiler"], compiler_description());
  EXPECT_EQ(json["command_line"], example().command_line);
  EXPECT_EQ(json["options_toml"], "seed = 7\n");
  EXPECT_EQ(json["seed"], 7);
  EXPECT_EQ(json["rank_count"], 1);
  EXPECT_EQ(json["input_sha256"]["ct.nii.gz"], std::string(64, 'a'));
  EXPECT_FALSE(json["input_grids"].contains("ct.nii.gz"));
  EXPECT_FALSE(json["host"]["cpu"].get<std::string>().empty());
  EXPECT_EQ(json["host"]["vector_bits"], static_cast<int>(active_vector_width()));
  const std::regex utc(R"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ)");
  EXPECT_TRUE(std::regex_match(json["started_utc"].get<std::string>(), utc));
}

TEST(Provenance, OfACtRecordsWhereItLies) {
  CtIdentity ct{"abc", {}};
  ct.grid.size = {4, 3, 2};
  ct.grid.origin_mm.x() = -31.25;
  Provenance provenance = example();
  provenance.inputs = {{"ct", ct}};
  const nlohmann::json json = to_json(provenance);
  EXPECT_EQ(json["input_sha256"]["ct"], "abc");
  EXPECT_EQ(json["input_grids"]["ct"]["size_voxels"], nlohmann::json({4, 3, 2}));
  EXPECT_EQ(json["input_grids"]["ct"]["origin_mm"], nlohmann::json({-31.25, 0.0, 0.0}));
  const test::ScratchFolder folder;
  write_reproduce_script(folder.path(), provenance);
  EXPECT_THAT(read_text_file(folder / "reproduce.sh"),
              HasSubstr("abc, 4 x 3 x 2 voxels from (-31.25, 0, 0) mm to (-28.25, 2, 1) mm  ct"));
}

TEST(Provenance, JsonRecordsTheVectorWidthInForce) {
  force_vector_width(VectorWidth::Bits128);
  EXPECT_EQ(to_json(example())["host"]["vector_bits"], 128);
  force_vector_width(std::nullopt);
}

TEST(Provenance, SeedBeyondTheSignedRangeIsKept) {
  Provenance provenance = example();
  provenance.seed = ~std::uint64_t{0};
  EXPECT_EQ(to_json(provenance)["seed"].get<std::uint64_t>(), ~std::uint64_t{0});
}

TEST(ReproduceScript, RunsTheSameCommandInTheSameFolder) {
  const test::ScratchFolder folder;
  const fs::path work = folder / "it's a \"work\" $folder";
  fs::create_directory(work);
  fs::create_directory(folder / "results");
  {
    const WorkingFolder here(work);
    write_reproduce_script(folder / "results", example());
  }
  ASSERT_EQ(run((folder / "results/reproduce.sh").string()), 0);
  EXPECT_EQ(read_text_file(work / "out.txt"), fs::canonical(work).string() + "|it's\n");
}

TEST(ReproduceScript, RunsInTheCurrentFolderWhenTheOldOneIsGone) {
  const test::ScratchFolder folder;
  fs::create_directory(folder / "gone");
  {
    const WorkingFolder here(folder / "gone");
    write_reproduce_script(folder.path(), example());
  }
  fs::remove(folder / "gone");
  const WorkingFolder here(folder.path());
  ASSERT_EQ(run("./reproduce.sh 2> messages.txt"), 0);
  EXPECT_TRUE(fs::exists(folder / "out.txt"));
  EXPECT_THAT(read_text_file(folder / "messages.txt"), HasSubstr("is gone"));
}

TEST(ReproduceScript, StartsAsManyRanksUnlessToldOtherwise) {
  const test::ScratchFolder folder;
  Provenance provenance = example();
  provenance.rank_count = 4;
  write_reproduce_script(folder.path(), provenance);
  EXPECT_THAT(read_text_file(folder / "reproduce.sh"),
              HasSubstr("exec mpirun -n \"${RANKS:-4}\" " + provenance.command_line + "\n"));
}

TEST(ReproduceScript, InputNamesCannotLeaveTheirComment) {
  const test::ScratchFolder folder;
  Provenance provenance = example();
  provenance.command_line = "'true'";
  provenance.inputs = {{"a\ntouch escaped\n", "b\r\ntouch escaped"}};
  write_reproduce_script(folder.path(), provenance);
  const WorkingFolder here(folder.path());
  ASSERT_EQ(run("./reproduce.sh"), 0);
  EXPECT_FALSE(fs::exists(folder / "escaped"));
}

TEST(ReproduceScript, PassesShellcheck) {
  if (run("command -v shellcheck > /dev/null") != 0) GTEST_SKIP() << "shellcheck is not installed";
  const test::ScratchFolder folder;
  Provenance provenance = example();
  provenance.command_line = "af-register --study 'a b.toml' -o out";
  provenance.rank_count = 2;
  write_reproduce_script(folder.path(), provenance);
  EXPECT_EQ(run("shellcheck '" + (folder / "reproduce.sh").string() + "'"), 0);
}

}  // namespace
}  // namespace af
