// SPDX-License-Identifier: Apache-2.0
#include "run/progress_journal.h"

#include <fstream>
#include <functional>
#include <string>
#include <sys/stat.h>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "support/test_paths.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

const DecidingValues kDecides = {{"seed", "1"}, {"preset", "paper"}};

void append(const fs::path& folder, const std::string& text, int shard = 0, int run = 0) {
  ProgressShard writer(folder, "case", run, shard);
  writer.append(std::as_bytes(std::span(text)));
  writer.sync();
}

std::vector<std::string> finished(ProgressJournal& journal) {
  std::vector<std::string> mended;
  std::vector<std::string> visited;
  const auto into = [](std::vector<std::string>& records) {
    return [&records](std::span<const std::byte> record) {
      records.emplace_back(reinterpret_cast<const char*>(record.data()), record.size());
    };
  };
  journal.mend_and_visit(into(mended));
  journal.visit(1, into(visited));
  EXPECT_EQ(mended, visited);
  return mended;
}

/// A journal with the records "one", "" and "three" of one process.
fs::path three_records(const fs::path& folder) {
  const ProgressJournal journal(folder, "case", kDecides, false);
  for (const char* text : {"one", "", "three"}) append(folder, text);
  return folder / "case.0000-000000.records";
}

TEST(ProgressJournal, GivesBackWhatEarlierRunsAppended) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  ProgressJournal again(folder / "p", "case", kDecides, false);
  EXPECT_THAT(finished(again), ElementsAre("one", "", "three"));
  append(folder / "p", "four");
  ProgressJournal third(folder / "p", "case", kDecides, false);
  EXPECT_THAT(finished(third), ElementsAre("one", "", "three", "four"));
  third.remove();
  EXPECT_FALSE(fs::exists(folder / "p"));
}

TEST(ProgressJournal, GivesEveryRunFilesOfItsOwn) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  const ProgressJournal second(folder / "p", "case", kDecides, false);
  EXPECT_EQ(second.run(), 1);
  append(folder / "p", "four", 0, second.run());
  // Runs go by number, not by letters; the first one's process writes on.
  append(folder / "p", "far later", 0, 10001);
  append(folder / "p", "from the past", 0, 0);
  ProgressJournal last(folder / "p", "case", kDecides, false);
  EXPECT_EQ(last.run(), 10002);
  EXPECT_THAT(finished(last),
              ElementsAre("one", "", "three", "from the past", "four", "far later"));
}

TEST(ProgressJournal, JoinsTheShardsOfAllProcessesAndNoOtherJournals) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  append(folder / "p", "of twelve", 12);
  append(folder / "p", "of two", 2);
  // Names that begin alike.
  ProgressJournal other(folder / "p", "case.2", kDecides, false);
  ProgressShard(folder / "p", "case.2", 0, 1).append(std::as_bytes(std::span("other", 5)));
  ProgressJournal journal(folder / "p", "case", kDecides, false);
  EXPECT_THAT(finished(journal), ElementsAre("one", "", "three", "of two", "of twelve"));
  EXPECT_THAT(finished(other), ElementsAre("other"));
  journal.remove();
  EXPECT_THAT(finished(other), ElementsAre("other"));
}

TEST(ProgressJournal, CutsOffWhatAKillTore) {
  const test::ScratchFolder folder;
  const fs::path records = three_records(folder / "p");
  const std::uintmax_t size = fs::file_size(records);
  for (std::uintmax_t kept = size; kept-- > size - 21;) {  // 21 bytes: the last record
    fs::resize_file(records, kept);
    ProgressJournal journal(folder / "p", "case", kDecides, false);
    EXPECT_THAT(finished(journal), ElementsAre("one", "")) << kept;
    append(folder / "p", "next");
    ProgressJournal again(folder / "p", "case", kDecides, false);
    EXPECT_THAT(finished(again), ElementsAre("one", "", "next")) << kept;
    fs::remove_all(folder / "p");
    three_records(folder / "p");
  }
}

TEST(ProgressJournal, TrustsNoRecordWithADamagedByteNorAnyAfterIt) {
  const test::ScratchFolder folder;
  const fs::path records = three_records(folder / "p");
  const auto size = static_cast<int>(fs::file_size(records));
  for (int damaged = 0; damaged < size; ++damaged) {
    {
      std::fstream file(records, std::ios::binary | std::ios::in | std::ios::out);
      file.seekg(damaged);
      const char byte = static_cast<char>(file.get() ^ 0x20);
      file.seekp(damaged);
      file.put(byte);
    }
    ProgressJournal journal(folder / "p", "case", kDecides, false);
    // Records of 19, 16 and 21 bytes.
    const std::size_t sound = damaged < 19 ? 0U : damaged < 35 ? 1U : 2U;
    EXPECT_EQ(finished(journal).size(), sound) << damaged;
    fs::remove_all(folder / "p");
    three_records(folder / "p");
  }
}

TEST(ProgressJournal, RefusesOtherDecisionsAndNamesThem) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  try {
    ProgressJournal(folder / "p", "case", {{"seed", "2"}, {"bins", "64"}}, false);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("seed = 2: the unfinished work was begun with 1"));
    EXPECT_THAT(error.what(), HasSubstr("bins = 64: the unfinished work was begun with nothing"));
    EXPECT_THAT(error.what(),
                HasSubstr("preset = nothing: the unfinished work was begun with paper"));
  }
  ProgressJournal restarted(folder / "p", "case", {{"seed", "2"}}, true);
  EXPECT_TRUE(finished(restarted).empty());
}

TEST(ProgressJournal, RefusesADamagedManifest) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  std::ofstream(folder / "p/case.json") << "{";
  EXPECT_THROW(ProgressJournal(folder / "p", "case", kDecides, false), FileError);
}

TEST(ProgressJournal, SaysHowToGoOnFromAManifestThatCannotBeOne) {
  const test::ScratchFolder folder;
  const fs::path manifest = folder / "p/case.json";
  const std::vector<std::function<void()>> replacements = {
      [&] { std::ofstream(manifest) << "{"; },
      [&] { std::ofstream(manifest) << R"({"format": "af-other", "format_version": 3})"; },
      [&] { fs::resize_file(manifest, 300u << 20); },
      [&] { fs::create_directories(manifest / "full"); },
      [&] { ASSERT_EQ(mkfifo(manifest.c_str(), 0600), 0); },
      [&] { fs::create_symlink("nowhere", manifest); },
      [&] { fs::create_symlink("case.json", manifest); }};
  for (std::size_t i = 0; i < replacements.size(); ++i) {
    three_records(folder / "p");
    if (i > 2) fs::remove(manifest);
    replacements[i]();
    try {
      ProgressJournal(folder / "p", "case", kDecides, false);
      FAIL() << i << " was accepted";
    } catch (const FileError& error) {
      EXPECT_THAT(error.what(), HasSubstr("start over with --restart")) << i;
    }
    ProgressJournal restarted(folder / "p", "case", kDecides, true);
    EXPECT_TRUE(finished(restarted).empty()) << i;
    fs::remove_all(folder / "p");
  }
}

TEST(ProgressJournal, PassesOverWhateverElseHasTheNameOfAShard) {
  const test::ScratchFolder folder;
  const fs::path first = three_records(folder / "p");
  fs::create_directories(folder / "p/case.0001-000000.records" / "full");
  ASSERT_EQ(mkfifo((folder / "p/case.0002-000000.records").c_str(), 0600), 0);
  fs::create_symlink("nowhere", folder / "p/case.0003-000000.records");
  fs::create_symlink(first.filename(), folder / "p/case.0004-000000.records");
  fs::create_symlink("case.0005-000000.records", folder / "p/case.0005-000000.records");
  ProgressJournal journal(folder / "p", "case", kDecides, false);
  EXPECT_EQ(journal.run(), 6);
  EXPECT_EQ(finished(journal).size(), 6u);  // those of the first, twice
  journal.remove();
  EXPECT_FALSE(fs::exists(folder / "p"));
}

}  // namespace
}  // namespace af
