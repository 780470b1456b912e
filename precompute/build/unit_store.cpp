// SPDX-License-Identifier: Apache-2.0
#include "precompute/build/unit_store.h"

#include <utility>

#include "ranks/values_of_ranks.h"

namespace af {

namespace {

/// A unit has two records: one of its tiles (bitmap, then tiles) and one of its indices.
std::int64_t tiles_key(std::uint32_t unit_id) {
  return 2 * std::int64_t{unit_id};
}

std::int64_t indices_key(std::uint32_t unit_id) {
  return 2 * std::int64_t{unit_id} + 1;
}

/// Precedes a unit's indices.
struct IndicesHead {
  std::uint64_t squared_error = 0;
  std::uint64_t codebook_crc = 0;
};

/// The tiles at a place, or nothing when they are damaged or cannot belong to this unit.
std::optional<UnitTiles> read_tiles(const ProgressStore& store,
                                    const RecordPlace& place,
                                    const WorkUnit& unit) {
  const std::uint64_t words = (unit.tile_count() + 63) / 64;
  const std::uint64_t bitmap_bytes = words * sizeof(std::uint64_t);
  if (place.bytes < bitmap_bytes || place.bytes > bitmap_bytes + unit.tile_count() * sizeof(Tile) ||
      (place.bytes - bitmap_bytes) % sizeof(Tile) != 0)
    return std::nullopt;
  UnitTiles tiles;
  tiles.unit_id = unit.id;
  tiles.occupied.resize(words);
  tiles.tiles.resize((place.bytes - bitmap_bytes) / sizeof(Tile));
  const bool is_sound = store.read(place,
                                   {std::as_writable_bytes(std::span(tiles.occupied)),
                                    std::as_writable_bytes(std::span(tiles.tiles))}) &&
                        problems(tiles, unit).empty();
  if (!is_sound) return std::nullopt;
  return tiles;
}

}  // namespace

UnitStore::UnitStore(const UnfinishedWork& work, const Communicator& communicator)
    : communicator_(communicator), store_(work, communicator) {}

void UnitStore::visit_finished(std::span<const WorkUnit> units, const Visit& visit) {
  // The last record of a unit counts: it was cast again because an earlier one was damaged.
  for (const RecordPlace& place : store_.find()) {
    const auto unit_id = static_cast<std::uint64_t>(place.key) / 2;
    if (place.key < 0 || unit_id >= units.size()) continue;
    auto& places = place.key % 2 == 0 ? tiles_ : indices_;
    places[static_cast<std::uint32_t>(unit_id)] = place;
  }
  const auto found = std::exchange(tiles_, {});
  const auto ranks = static_cast<std::size_t>(communicator_.size());
  auto turn = static_cast<std::size_t>(communicator_.rank());
  for (const auto& [unit_id, place] : found) {
    if (turn++ % ranks != 0) continue;
    std::optional<UnitTiles> tiles = read_tiles(store_, place, units[unit_id]);
    if (!tiles.has_value()) continue;
    tiles_[unit_id] = place;
    visit(std::move(*tiles));
  }
}

void UnitStore::append(const UnitTiles& tiles) {
  tiles_[tiles.unit_id] = store_.shard().append(
      tiles_key(tiles.unit_id),
      {std::as_bytes(std::span(tiles.occupied)), std::as_bytes(std::span(tiles.tiles))});
}

void UnitStore::append(const WorkUnit& unit,
                       const EncodedUnit& encoded,
                       std::uint32_t codebook_crc) {
  const IndicesHead head{encoded.squared_error, codebook_crc};
  store_.shard().append(
      indices_key(unit.id),
      {std::as_bytes(std::span(&head, 1)), std::as_bytes(std::span(encoded.indices))});
}

std::optional<EncodedUnit> UnitStore::read_encoded(const WorkUnit& unit,
                                                   std::size_t values_per_tile,
                                                   std::uint32_t codebook_crc) const {
  const auto found = indices_.find(unit.id);
  if (found == indices_.end()) return std::nullopt;
  IndicesHead head;
  EncodedUnit encoded;
  encoded.indices.resize(values_per_tile * unit.tile_count());
  const bool is_sound = store_.read(found->second,
                                    {std::as_writable_bytes(std::span(&head, 1)),
                                     std::as_writable_bytes(std::span(encoded.indices))});
  if (!is_sound || head.codebook_crc != codebook_crc) return std::nullopt;
  encoded.squared_error = head.squared_error;
  return encoded;
}

void UnitStore::share_places() {
  std::vector<RecordPlace> mine;
  for (const auto& [unit_id, place] : tiles_) mine.push_back(place);
  for (const RecordPlace& place : from_all(mine, communicator_))
    tiles_[static_cast<std::uint32_t>(place.key / 2)] = place;
}

std::optional<UnitTiles> UnitStore::read(const WorkUnit& unit) const {
  const auto place = tiles_.find(unit.id);
  if (place == tiles_.end()) return std::nullopt;
  return read_tiles(store_, place->second, unit);
}

}  // namespace af
