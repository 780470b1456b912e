// SPDX-License-Identifier: Apache-2.0
// A journal of unfinished work. The first byte chooses: a manifest of any content, records of any
// content, or sound records (with right checksums) that are cut and changed afterwards.
#include <algorithm>
#include <fstream>
#include <vector>

#include "fuzz/fuzz_input.h"
#include "ranks/progress_journal.h"

namespace {

using namespace af;
using Records = std::vector<std::string>;

std::filesystem::path folder() {
  return fuzz::scratch_folder() / "journal";
}

UnfinishedWork work() {
  return {folder(), "case", {{"seed", "1"}, {"ct", "0123"}}};
}

Records records_of(const ProgressJournal& journal) {
  Records records;
  journal.visit(1, [&](std::int64_t, std::span<const std::byte> record) {
    records.emplace_back(reinterpret_cast<const char*>(record.data()), record.size());
  });
  return records;
}

Records append_records(fuzz::InputBytes& input) {
  const ProgressJournal journal(work());
  ProgressShard shard(journal.files(), {});
  Records records;
  for (std::size_t left = input.take_below(6); left > 0; --left) {
    records.emplace_back(fuzz::as_text(input.take_bytes(input.take_below(64))));
    shard.append(0, {std::as_bytes(std::span(records.back()))});
  }
  return records;
}

/// Cuts the file or changes bytes in it.
void damage(fuzz::InputBytes& input) {
  const auto path = folder() / "case.0000-000000.records";
  if (!std::filesystem::exists(path)) return;
  for (std::size_t left = input.take_below(4); left > 0; --left) {
    const auto size = std::filesystem::file_size(path);
    const auto place = input.take_below(size + 1);
    if (input.take<std::uint8_t>() % 2 == 0) {
      std::filesystem::resize_file(path, place);
    } else {
      std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
      file.seekp(static_cast<std::streamoff>(place));
      file.put(static_cast<char>(input.take<std::uint8_t>()));
    }
  }
}

/// The records that are read must be some of those appended, in order. The journal then continues
/// from there.
void read_and_go_on(const Records& appended) {
  const ProgressJournal journal(work());
  Records found = records_of(journal);
  auto next = appended.begin();
  for (const std::string& record : found) {
    next = std::find(next, appended.end(), record);
    fuzz::require(next != appended.end(), "records are those that were appended");
    ++next;
  }
  found.emplace_back("one more");
  ProgressShard(journal.files(), {journal.run(), 0})
      .append(0, {std::as_bytes(std::span(found.back()))});
  fuzz::require(records_of(ProgressJournal(work())) == found, "a damaged journal goes on");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::InputBytes input(data, size);
  std::filesystem::remove_all(folder());
  switch (input.take<std::uint8_t>() % 3) {
    case 0:
      std::filesystem::create_directories(folder());
      fuzz::written("journal/case.json", fuzz::as_text(input.rest()));
      fuzz::is_accepted([] { ProgressJournal{work()}; });
      return 0;
    case 1: {
      const ProgressJournal journal(work());
      fuzz::written("journal/case.0000-000000.records", fuzz::as_text(input.rest()));
      fuzz::is_accepted([&] { records_of(journal); });
      return 0;
    }
    default: {
      const Records appended = append_records(input);
      damage(input);
      read_and_go_on(appended);
      return 0;
    }
  }
}
