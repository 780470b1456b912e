// SPDX-License-Identifier: Apache-2.0
// What af-precompute finds of an earlier run. The first bytes choose: a manifest of any content, a
// shard of any content and name, sound records that are cut and changed afterwards, forged records
// (with right checksums), or a training of any content that is continued.
#include <array>
#include <fstream>
#include <map>
#include <vector>

#include "base/crc32c.h"
#include "base/stored_bytes.h"
#include "fuzz/fuzz_input.h"
#include "precompute/build/field_encoder.h"
#include "precompute/build/training_journal.h"
#include "precompute/build/unit_store.h"

namespace {

using namespace af;
namespace fs = std::filesystem;

constexpr std::uint32_t kCodebookCrc = 7;
constexpr std::int64_t kRaysPerUnit = 1000;
const std::string kFirstShard = "units.0000-000000.records";

fs::path folder() {
  return fuzz::scratch_folder() / "progress";
}

WorkUnit unit_of(std::uint32_t id, std::array<int, 4> counts) {
  WorkUnit unit;
  unit.id = id;
  unit.u = {0, counts[0]};
  unit.v = {0, counts[1]};
  unit.s = {2, counts[2]};
  unit.t = {4, counts[3]};
  return unit;
}

/// Units of 1, 6 and 72 tiles.
const std::vector<WorkUnit>& units() {
  static const std::vector<WorkUnit> some = {
      unit_of(0, {2, 2, 2, 2}), unit_of(1, {3, 2, 6, 1}), unit_of(2, {4, 3, 5, 12})};
  return some;
}

UnitStore opened() {
  return {{folder(), "units", {{"step_mm", "3"}, {"ct", "b"}}, kRaysPerUnit},
          Communicator::alone()};
}

std::map<std::uint32_t, UnitTiles> found_in(UnitStore& progress) {
  std::map<std::uint32_t, UnitTiles> found;
  progress.visit_finished(units(), [&](UnitTiles tiles) {
    fuzz::require(tiles.unit_id < units().size(), "a unit that was found is one of the plan");
    fuzz::require(problems(tiles, units()[tiles.unit_id]).empty(), "its tiles belong to it");
    fuzz::require(found.emplace(tiles.unit_id, tiles).second, "it is found once");
  });
  progress.share_places();
  for (const WorkUnit& unit : units()) {
    const auto again = progress.read(unit);
    fuzz::require(again.has_value() == found.contains(unit.id), "it can be read again");
    if (again) fuzz::require(again->tiles == found.at(unit.id).tiles, "to the same tiles");
  }
  return found;
}

/// Reads what is there, adds to it, and must then find both.
void read_and_go_on() {
  std::map<std::uint32_t, UnitTiles> found;
  UnitTiles more = make_unit_tiles(units()[0], std::vector<std::uint16_t>(16, 5));
  {
    UnitStore progress = opened();
    found = found_in(progress);
    for (const WorkUnit& unit : units())
      if (const auto encoded = progress.read_encoded(unit, 1, kCodebookCrc))
        fuzz::require(encoded->indices.size() == unit.tile_count(), "one index for each tile");
    if (!found.contains(0)) progress.append(more);
  }
  if (!found.contains(0)) found.emplace(0, std::move(more));
  UnitStore again = opened();
  const auto found_again = found_in(again);
  fuzz::require(found_again.size() == found.size(), "the next run finds what this one had");
  for (const auto& [id, tiles] : found)
    fuzz::require(found_again.at(id).tiles == tiles.tiles, "as it was");
}

UnitTiles any_tiles(const WorkUnit& unit, fuzz::InputBytes& input) {
  std::vector<std::uint16_t> samples(unit.sample_count());
  for (std::size_t left = input.take_below(8); left > 0; --left)
    samples[input.take_below(samples.size())] = input.take<std::uint16_t>();
  return make_unit_tiles(unit, samples);
}

void append_sound_records(fuzz::InputBytes& input, std::map<std::uint32_t, UnitTiles>& appended) {
  UnitStore progress = opened();
  for (const WorkUnit& unit : units()) {
    if (input.take_below(4) == 0) continue;
    const UnitTiles tiles = any_tiles(unit, input);
    progress.append(tiles);
    appended.emplace(unit.id, tiles);
    EncodedUnit encoded;
    encoded.indices.assign(unit.tile_count(), static_cast<std::uint16_t>(input.take_below(9)));
    if (input.take_below(2) == 0) progress.append(unit, encoded, kCodebookCrc);
  }
}

/// Cuts the shard or changes bytes in it.
void damage(fuzz::InputBytes& input) {
  const fs::path path = folder() / kFirstShard;
  if (!fs::exists(path)) return;
  for (std::size_t left = input.take_below(4); left > 0; --left) {
    const auto size = fs::file_size(path);
    const auto place = input.take_below(size + 1);
    if (input.take<std::uint8_t>() % 2 == 0) {
      fs::resize_file(path, place);
    } else {
      std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
      file.seekp(static_cast<std::streamoff>(place));
      file.put(static_cast<char>(input.take<std::uint8_t>()));
    }
  }
}

template <typename T>
void put(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

/// A record whose checksums agree with its contents, although its fields need not make sense.
std::string forged_record(fuzz::InputBytes& input) {
  constexpr std::array<const char*, 2> kMagics = {"AFRECOR4", "AFRECOR5"};
  const std::size_t magic = input.take_below(16) == 0 ? 1 : 0;
  auto key = static_cast<std::int64_t>(input.take_below(8));
  const std::size_t tiles =
      units()[static_cast<std::size_t>(key) / 2 % units().size()].tile_count();
  std::string content(fuzz::as_text(input.take_bytes(input.take_below(64))));
  constexpr std::size_t kIndicesHeadBytes = 16;
  auto bytes = key % 2 == 1 ? kIndicesHeadBytes + 2 * tiles
                            : (tiles + 63) / 64 * 8 + sizeof(Tile) * input.take_below(tiles + 1);
  if (input.take_below(4) == 0) key = input.take<std::int64_t>();
  if (input.take_below(4) == 0) bytes = input.take<std::uint64_t>();
  constexpr std::size_t kMostBytes = 1u << 14;
  if (bytes <= kMostBytes) content.resize(bytes, '\x11');
  std::string record = kMagics[magic];
  put(record, key);
  put(record, static_cast<std::uint64_t>(bytes));
  put(record, crc32c(std::as_bytes(std::span(content))));
  const std::string journal = "units";
  put(record, crc32c(std::as_bytes(std::span(record)), crc32c(std::as_bytes(std::span(journal)))));
  return record + content;
}

void write_shards(fuzz::InputBytes& input) {
  const std::array<std::string, 6> names = {kFirstShard,
                                            "units.0001-000002.records",
                                            "units.12345-1234567.records",
                                            "units.9223372036854775807-000000.records",
                                            "units.0000-9223372036854775807.records",
                                            "units.0000-000001.records"};
  const std::string& name = names[input.take_below(names.size())];
  if (input.take_below(8) == 7) {
    fs::create_directory(folder() / name);
    return;
  }
  std::string bytes;
  if (input.take_below(4) == 0)
    bytes = fuzz::as_text(input.rest());
  else
    while (!input.empty()) bytes += forged_record(input);
  fuzz::written("progress/" + name, bytes);
}

/// A training that continues any begun one ends with a usable codebook.
void go_on_training(fuzz::InputBytes& input) {
  constexpr std::size_t kCodewords = 4;
  TrainedCodebook begun;
  begun.training_tiles = input.take<std::uint64_t>();
  for (std::size_t left = input.take_below(4); left > 0; --left)
    begun.iterations.push_back({input.take<std::uint64_t>(), input.take<std::uint64_t>(), 0});
  for (std::size_t left = input.take_below(7); left > 0; --left) {
    Tile tile{};
    tile.fill(input.take<std::uint16_t>());
    tile[3] = static_cast<std::uint16_t>(tile[3] + input.take<std::uint8_t>());
    begun.codebook.codewords.push_back(tile);
  }
  std::vector<std::byte> bytes = bytes_of(begun);
  if (input.take_below(4) == 0) bytes[input.take_below(bytes.size())] ^= input.take<std::byte>();
  const UnfinishedWork work = {folder(), "training", {{"codewords", std::to_string(kCodewords)}}};
  const CodebookOptions options = {kCodewords, 3};
  { const TrainingJournal journal(work, options, Communicator::alone()); }
  ProgressShard({work.folder, work.name}, {}).append(1, {bytes});
  const TrainingJournal journal(work, options, Communicator::alone());
  TrainingShare share;
  for (std::uint16_t i = 1; i < 12; ++i) {
    NumberedTile tile{i, {}};
    tile.tile.fill(static_cast<std::uint16_t>(i * 100));
    share.training.push_back(tile);
  }
  const TrainedCodebook trained =
      train_codebook(share, options, serial_reduction(), {}, {journal.begun(), {}});
  fuzz::require(trained.codebook.size() == kCodewords && problems(trained.codebook).empty(),
                "a training gives a codebook of the size asked for");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::InputBytes input(data, size);
  (void)Communicator::alone();
  fs::remove_all(folder());
  switch (input.take_below(5)) {
    case 0:
      fs::create_directories(folder());
      fuzz::written("progress/units.json", fuzz::as_text(input.rest()));
      fuzz::is_accepted([&] { opened(); });
      return 0;
    case 1: {
      std::map<std::uint32_t, UnitTiles> appended;
      append_sound_records(input, appended);
      damage(input);
      UnitStore progress = opened();
      for (const auto& [id, tiles] : found_in(progress))
        fuzz::require(appended.contains(id) && appended.at(id).tiles == tiles.tiles,
                      "tiles are those that were appended");
      return 0;
    }
    case 2:
      fuzz::is_accepted([&] { go_on_training(input); });
      return 0;
    case 3:
      (void)training_of(std::as_bytes(input.rest()));
      return 0;
    default:
      opened();
      write_shards(input);
      fuzz::is_accepted([] { read_and_go_on(); });
      return 0;
  }
}
