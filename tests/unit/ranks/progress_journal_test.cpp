// SPDX-License-Identifier: Apache-2.0
#include "ranks/progress_journal.h"

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

UnfinishedWork work_in(const fs::path& folder, const DecidingValues& decides = kDecides) {
  return {folder, "case", decides};
}

void append(const ProgressJournal& journal,
            const std::string& text,
            std::int64_t rank = 0,
            std::int64_t run = 0) {
  ProgressShard writer(journal.files(), {run, rank});
  writer.append(7, {std::as_bytes(std::span(text))});
  writer.sync();
}

std::vector<std::string> finished(const ProgressJournal& journal) {
  std::vector<std::string> visited;
  journal.visit(1, [&](std::int64_t key, std::span<const std::byte> content) {
    EXPECT_EQ(key, 7);
    visited.emplace_back(reinterpret_cast<const char*>(content.data()), content.size());
  });
  return visited;
}

/// A journal with the records "one", "" and "three" of one process.
fs::path three_records(const fs::path& folder) {
  const ProgressJournal journal(work_in(folder));
  ProgressShard writer(journal.files(), {});
  for (const std::string text : {"one", "", "three"})
    writer.append(7, {std::as_bytes(std::span(text))});
  return folder / "case.0000-000000.records";
}

constexpr int kHeaderBytes = 32;

/// Begun with a CT and a point that follows from it.
DecidingValues of_ct(double left_mm) {
  CtIdentity ct{"abc", {}};
  ct.grid.size = {4, 3, 2};
  ct.grid.origin_mm.x() = left_mm;
  return {{"CT 'ct'", ct}, {"center_ct_mm", ct.grid.center_mm()}, {"seed", "1"}};
}

TEST(ProgressJournal, OfACtGoesOnWithTheSameCtAndWithNoOther) {
  const test::ScratchFolder folder;
  append(ProgressJournal(work_in(folder / "p", of_ct(-31.25))), "one");
  // 1e-3 mm is the same place.
  EXPECT_THAT(finished(ProgressJournal(work_in(folder / "p", of_ct(-31.2495)))),
              ElementsAre("one"));
  try {
    const ProgressJournal other(work_in(folder / "p", of_ct(-24.25)));
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("7 mm off: the unfinished work was begun with abc"));
    EXPECT_THAT(error.what(),
                HasSubstr("center_ct_mm = [-22.75, 1, 0.5]: the unfinished work was begun with "
                          "[-29.75, 1, 0.5]"));
  }
}

TEST(ProgressJournal, GivesBackWhatEarlierRunsAppended) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  const ProgressJournal again(work_in(folder / "p"));
  EXPECT_THAT(finished(again), ElementsAre("one", "", "three"));
  append(again, "four", 0, again.run());
  const ProgressJournal third(work_in(folder / "p"));
  EXPECT_THAT(finished(third), ElementsAre("one", "", "three", "four"));
}

TEST(ProgressJournal, GivesEveryRunFilesOfItsOwn) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  const ProgressJournal second(work_in(folder / "p"));
  EXPECT_EQ(second.run(), 1);
  append(second, "four", 0, second.run());
  // Runs sort by number, not as text. The first run's process goes on writing.
  append(second, "far later", 0, 10001);
  append(second, "from the past", 0, 0);
  const ProgressJournal last(work_in(folder / "p"));
  EXPECT_EQ(last.run(), 10002);
  EXPECT_THAT(finished(last),
              ElementsAre("one", "", "three", "from the past", "four", "far later"));
}

TEST(ProgressJournal, JoinsTheShardsOfAllProcessesAndNoOtherJournals) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  const ProgressJournal journal(work_in(folder / "p"));
  append(journal, "of twelve", 12);
  append(journal, "of two", 2);
  // The other name begins alike.
  const ProgressJournal other({folder / "p", "case.2", kDecides});
  append(other, "other", 1);
  EXPECT_THAT(finished(journal), ElementsAre("one", "", "three", "of two", "of twelve"));
  EXPECT_THAT(finished(other), ElementsAre("other"));
  // Another journal's records under this one's name.
  fs::rename(other.files().shard({0, 1}), journal.files().shard({0, 2}));
  EXPECT_THAT(finished(journal), ElementsAre("one", "", "three", "of twelve"));
}

TEST(ProgressJournal, PassesOverWhatAKillToreAndGoesOn) {
  const test::ScratchFolder folder;
  const fs::path records = three_records(folder / "p");
  const std::uintmax_t size = fs::file_size(records);
  const std::uintmax_t whole = size - kHeaderBytes - 5;  // without the last record
  for (std::uintmax_t kept = size; kept-- > whole;) {
    fs::resize_file(records, kept);
    const ProgressJournal journal(work_in(folder / "p"));
    EXPECT_THAT(finished(journal), ElementsAre("one", "")) << kept;
    append(journal, "next", 0, journal.run());
    const ProgressJournal again(work_in(folder / "p"));
    EXPECT_THAT(finished(again), ElementsAre("one", "", "next")) << kept;
    fs::remove_all(folder / "p");
    three_records(folder / "p");
  }
}

TEST(ProgressJournal, TrustsNoRecordWithADamagedByteNorAnyAfterADamagedHeader) {
  const test::ScratchFolder folder;
  const fs::path records = three_records(folder / "p");
  const auto size = static_cast<int>(fs::file_size(records));
  const std::vector<std::string> all = {"one", "", "three"};
  const auto sound_after = [&](int damaged) -> std::vector<std::string> {
    int end = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const int header_end = end + kHeaderBytes;
      end = header_end + static_cast<int>(all[i].size());
      if (damaged < header_end) return {all.begin(), all.begin() + static_cast<std::ptrdiff_t>(i)};
      if (damaged >= end) continue;
      std::vector<std::string> others = all;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      return others;
    }
    return all;
  };
  for (int damaged = 0; damaged < size; ++damaged) {
    {
      std::fstream file(records, std::ios::binary | std::ios::in | std::ios::out);
      file.seekg(damaged);
      const char byte = static_cast<char>(file.get() ^ 0x20);
      file.seekp(damaged);
      file.put(byte);
    }
    const ProgressJournal journal(work_in(folder / "p"));
    EXPECT_EQ(finished(journal), sound_after(damaged)) << damaged;
    fs::remove_all(folder / "p");
    three_records(folder / "p");
  }
}

TEST(ProgressJournal, FindsLargeAndSmallRecordsByTheirHeadersAndReadsThemInParts) {
  const test::ScratchFolder folder;
  const ProgressJournal journal(work_in(folder / "p"));
  const std::vector<std::uint64_t> words(100000, 42);
  const std::string text = "tail";
  ProgressShard shard(journal.files(), {3, 2});
  const RecordPlace small = shard.append(1, {std::as_bytes(std::span(text))});
  const RecordPlace large =
      shard.append(-2, {std::as_bytes(std::span(words)), {}, std::as_bytes(std::span(text))});
  EXPECT_THAT(journal.files().records({3, 2}), ElementsAre(small, large));
  std::vector<std::uint64_t> words_read(words.size());
  std::string text_read(text.size(), ' ');
  const auto read = [&](RecordPlace place) {
    return journal.files().read(place,
                                {std::as_writable_bytes(std::span(words_read)),
                                 std::as_writable_bytes(std::span(text_read))});
  };
  EXPECT_TRUE(read(large));
  EXPECT_EQ(words_read, words);
  EXPECT_EQ(text_read, text);
  EXPECT_FALSE(read(small));  // of another size
  RecordPlace wrong = large;
  wrong.key = 1;
  EXPECT_FALSE(read(wrong));
  wrong = large;
  wrong.offset = ~std::uint64_t{0};
  EXPECT_FALSE(read(wrong));
}

TEST(ProgressJournal, RefusesOtherDecisionsAndNamesThem) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  try {
    ProgressJournal(work_in(folder / "p", {{"seed", "2"}, {"bins", "64"}}));
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("seed = 2: the unfinished work was begun with 1"));
    EXPECT_THAT(error.what(), HasSubstr("bins = 64: the unfinished work was begun with nothing"));
    EXPECT_THAT(error.what(),
                HasSubstr("preset = nothing: the unfinished work was begun with paper"));
    EXPECT_THAT(error.what(), HasSubstr("--restart"));
  }
}

TEST(ProgressJournal, WorkThatGivesWayIsThrownAwayWhenItsManifestCannotBeRead) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  UnfinishedWork work = work_in(folder / "p");
  std::ofstream(JournalFiles{work.folder, work.name}.manifest()) << "{";
  EXPECT_THROW(ProgressJournal{work}, FileError);
  work.gives_way = true;
  const ProgressJournal begun(work);
  EXPECT_TRUE(begun.has_replaced());
  EXPECT_EQ(finished(begun).size(), 0u);
}

TEST(ProgressJournal, WorkThatGivesWayIsThrownAwayWhenTheOptionsAreOthers) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  UnfinishedWork work = work_in(folder / "p");
  work.gives_way = true;
  const ProgressJournal same(work);
  EXPECT_EQ(finished(same).size(), 3u);
  EXPECT_FALSE(same.has_replaced());
  work.decides["seed"] = "2";
  const ProgressJournal other(work);
  EXPECT_TRUE(finished(other).empty());
  EXPECT_TRUE(other.has_replaced());
}

TEST(ProgressJournal, RefusedWorkGivesWayOnceAndGoesOnWithTheSameOptions) {
  const test::ScratchFolder folder;
  three_records(folder / "p");
  ProgressJournal(work_in(folder / "p")).give_way();
  EXPECT_EQ(finished(ProgressJournal(work_in(folder / "p"))).size(), 3u);
  EXPECT_THROW(ProgressJournal(work_in(folder / "p", {{"seed", "2"}})), InputError);
  ProgressJournal(work_in(folder / "p")).give_way();
  const ProgressJournal other(work_in(folder / "p", {{"seed", "2"}}));
  EXPECT_TRUE(finished(other).empty());
  EXPECT_TRUE(other.has_replaced());
}

TEST(ProgressJournal, TakesOverTheFirstRunsPlan) {
  const test::ScratchFolder folder;
  UnfinishedWork work = work_in(folder / "p");
  work.unit_size = 1000;
  EXPECT_EQ(ProgressJournal(work).unit_size(), 1000);
  work.unit_size = 50;
  EXPECT_EQ(ProgressJournal(work).unit_size(), 1000);
  fs::remove_all(folder / "p");
  EXPECT_EQ(ProgressJournal(work_in(folder / "p")).unit_size(), 0);  // none is needed
  EXPECT_THROW(ProgressJournal{work}, FileError);
}

TEST(ProgressJournal, SaysHowToGoOnFromAManifestThatCannotBeOne) {
  const test::ScratchFolder folder;
  const fs::path manifest = folder / "p/case.json";
  const std::string sound = R"({"format": "af-progress-journal", "format_version": 4, )";
  const std::vector<std::function<void()>> replacements = {
      [&] { std::ofstream(manifest) << "{"; },
      [&] { std::ofstream(manifest) << R"({"format": "af-other", "format_version": 4})"; },
      [&] {
        std::ofstream(manifest) << R"({"format": "af-progress-journal", "format_version": 3})";
      },
      [&] { std::ofstream(manifest) << sound + R"("decides": {}})"; },
      [&] { std::ofstream(manifest) << sound + R"("decides": {}, "plan": -1})"; },
      [&] { fs::resize_file(manifest, 300u << 20); },
      [&] { fs::create_directories(manifest / "full"); },
      [&] { ASSERT_EQ(mkfifo(manifest.c_str(), 0600), 0); },
      [&] { fs::create_symlink("nowhere", manifest); },
      [&] { fs::create_symlink("case.json", manifest); }};
  for (std::size_t i = 0; i < replacements.size(); ++i) {
    three_records(folder / "p");
    if (i > 5) fs::remove(manifest);
    replacements[i]();
    try {
      ProgressJournal(work_in(folder / "p"));
      FAIL() << i << " was accepted";
    } catch (const FileError& error) {
      EXPECT_THAT(error.what(), HasSubstr("start over with --restart")) << i;
    }
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
  // No such runs or ranks can exist.
  for (const char* name : {"9223372036854775807-000000", "0000-9223372036854775807", "-001-000000"})
    std::ofstream(folder / "p" / ("case." + std::string(name) + ".records")) << "x";
  const ProgressJournal journal(work_in(folder / "p"));
  EXPECT_EQ(journal.run(), 6);
  EXPECT_EQ(finished(journal).size(), 6u);  // those of the first, twice
}

}  // namespace
}  // namespace af
