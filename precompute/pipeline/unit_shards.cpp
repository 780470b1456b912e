// SPDX-License-Identifier: Apache-2.0
#include "precompute/pipeline/unit_shards.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <tuple>
#include <unistd.h>

#include "base/crc32c.h"
#include "base/error.h"
#include "files/output_file.h"

namespace af {

namespace {

constexpr const char* kFormat = "af-precompute-progress";
constexpr const char* kManifestName = "manifest.json";
constexpr int kFormatVersion = 3;  // 2: units are cut along t, too; 3: indices
using Magic = std::array<char, 8>;
constexpr Magic kTilesMagic = {'A', 'F', 'U', 'N', 'I', 'T', '0', '1'};
constexpr Magic kIndicesMagic = {'A', 'F', 'C', 'O', 'D', 'E', '0', '1'};

/// Stands before the tiles of every unit in a shard, and before its indices.
struct RecordHeader {
  Magic magic = kTilesMagic;
  std::uint32_t unit_id = 0;
  std::uint32_t detail = 0;  ///< of tiles: words of their bitmap; of indices: CRC of the codebook
  std::uint64_t count = 0;   ///< of tiles that are not empty, or of indices
  std::uint32_t content_crc = 0;
  std::uint32_t header_crc = 0;  ///< of the fields before it

  [[nodiscard]] bool is_of_tiles() const { return magic == kTilesMagic; }
  [[nodiscard]] std::uint64_t content_bytes() const {
    return is_of_tiles() ? detail * sizeof(std::uint64_t) + count * sizeof(Tile)
                         : sizeof(std::uint64_t) + count * sizeof(std::uint16_t);
  }
  [[nodiscard]] std::uint32_t computed_crc() const {
    return crc32c(std::as_bytes(std::span(this, 1)).first(offsetof(RecordHeader, header_crc)));
  }
};
static_assert(sizeof(RecordHeader) == 32);

bool is_header_of(const RecordHeader& header, const WorkUnit& unit) {
  const std::size_t tile_count = unit.tile_count();
  if (header.unit_id != unit.id) return false;
  return header.is_of_tiles()
             ? header.detail == (tile_count + 63) / 64 && header.count <= tile_count
             : header.count == tile_count;
}

/// Reads the header at `offset`; false when there is none that is sound.
bool read_header(std::ifstream& file, std::uint64_t offset, RecordHeader& header) {
  file.seekg(static_cast<std::streamoff>(offset));
  file.read(reinterpret_cast<char*>(&header), sizeof(RecordHeader));
  return file.good() && (header.magic == kTilesMagic || header.magic == kIndicesMagic) &&
         header.header_crc == header.computed_crc();
}

/// Where a unit lies, as sent between ranks.
struct RecordPlace {
  std::uint64_t unit_id = 0;
  UnitPlace place;
};

struct IndicesPlace {
  std::uint64_t unit_id = 0;
  std::uint64_t codebook_crc = 0;
  UnitPlace place;
};

/// What the shards of earlier runs hold.
struct FoundUnits {
  std::vector<RecordPlace> tiles;
  std::vector<IndicesPlace> indices;
};

/// "0017-000003.shard": run, rank.
std::filesystem::path shard_name(std::uint64_t run, std::uint64_t rank) {
  const auto padded = [](const std::string& digits, std::size_t width) {
    return std::string(width - std::min(width, digits.size()), '0') + digits;
  };
  return padded(std::to_string(run), 4) + "-" + padded(std::to_string(rank), 6) + ".shard";
}

/// Run and rank of every shard of the folder, in order. Numbers that no run reaches are not ours:
/// the next run's must be higher than all.
std::vector<UnitPlace> shards_of(const std::filesystem::path& folder) {
  std::vector<UnitPlace> shards;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    char* end = nullptr;
    const std::uint64_t run = std::strtoull(name.c_str(), &end, 10);
    const std::uint64_t rank = *end == '-' ? std::strtoull(end + 1, nullptr, 10) : 0;
    constexpr std::uint64_t kMost = 1'000'000'000;
    if (run <= kMost && rank <= kMost && name == shard_name(run, rank))
      shards.push_back({run, rank, 0});
  }
  std::sort(shards.begin(), shards.end(), [](const UnitPlace& a, const UnitPlace& b) {
    return std::tie(a.run, a.rank) < std::tie(b.run, b.rank);
  });
  return shards;
}

/// Units whose headers make sense, up to the first that does not: what follows a torn record is
/// lost.
void scan_shard(const std::filesystem::path& folder,
                const UnitPlace& shard,
                std::span<const WorkUnit> units,
                FoundUnits& found) {
  const std::filesystem::path path = folder / shard_name(shard.run, shard.rank);
  std::error_code error;
  // Lost, or no file: as if damaged. Opening a pipe would wait for its writer.
  if (!std::filesystem::is_regular_file(path, error)) return;
  const std::uint64_t size = std::filesystem::file_size(path, error);
  if (error) return;
  std::ifstream file(path, std::ios::binary);
  UnitPlace place = shard;
  RecordHeader header;
  while (size - place.offset >= sizeof(RecordHeader)) {
    if (!read_header(file, place.offset, header) || header.unit_id >= units.size() ||
        !is_header_of(header, units[header.unit_id]) ||
        header.content_bytes() > size - place.offset - sizeof(RecordHeader))
      return;
    if (!header.is_of_tiles())
      found.indices.push_back({header.unit_id, header.detail, place});
    else
      found.tiles.push_back({header.unit_id, place});
    place.offset += sizeof(RecordHeader) + header.content_bytes();
  }
}

void read_into(std::ifstream& file, std::span<std::byte> bytes) {
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

/// The unit's tiles, or nothing when they are damaged.
std::optional<UnitTiles> read_unit(const std::filesystem::path& path,
                                   std::uint64_t offset,
                                   const WorkUnit& unit) {
  std::ifstream file(path, std::ios::binary);
  RecordHeader header;
  if (!read_header(file, offset, header) || !header.is_of_tiles() || !is_header_of(header, unit))
    return std::nullopt;
  UnitTiles tiles;
  tiles.unit_id = unit.id;
  tiles.occupied.resize(header.detail);
  tiles.tiles.resize(header.count);
  const auto bitmap = std::as_writable_bytes(std::span(tiles.occupied));
  const auto content = std::as_writable_bytes(std::span(tiles.tiles));
  read_into(file, bitmap);
  read_into(file, content);
  const bool is_sound = file.good() && crc32c(content, crc32c(bitmap)) == header.content_crc &&
                        problems(tiles, unit).empty();
  if (!is_sound) return std::nullopt;
  return tiles;
}

/// The unit's indices, or nothing when they are damaged.
std::optional<EncodedUnit> read_indices(const std::filesystem::path& path,
                                        std::uint64_t offset,
                                        const WorkUnit& unit) {
  std::ifstream file(path, std::ios::binary);
  RecordHeader header;
  if (!read_header(file, offset, header) || header.is_of_tiles() || !is_header_of(header, unit))
    return std::nullopt;
  EncodedUnit encoded;
  encoded.indices.resize(header.count);
  const auto error = std::as_writable_bytes(std::span(&encoded.squared_error, 1));
  const auto indices = std::as_writable_bytes(std::span(encoded.indices));
  read_into(file, error);
  read_into(file, indices);
  if (!file.good() || crc32c(indices, crc32c(error)) != header.content_crc) return std::nullopt;
  return encoded;
}

template <typename Record>
std::vector<std::byte> bytes_of(const std::vector<Record>& records) {
  const auto raw = std::as_bytes(std::span(records));
  return {raw.begin(), raw.end()};
}

template <typename Record>
std::vector<Record> records_of(std::span<const std::byte> bytes) {
  std::vector<Record> records(bytes.size() / sizeof(Record));
  if (!bytes.empty()) std::memcpy(records.data(), bytes.data(), bytes.size());
  return records;
}

/// Collective. All ranks' records on every rank, in rank order.
template <typename Record>
std::vector<Record> from_all(const std::vector<Record>& mine, const Communicator& communicator) {
  std::vector<Record> all;
  for (const auto& bytes : communicator.all_gather(std::as_bytes(std::span(mine))))
    for (const Record& record : records_of<Record>(bytes)) all.push_back(record);
  return all;
}

template <typename Record>
void sort_by_place(std::vector<Record>& records) {
  std::sort(records.begin(), records.end(), [](const Record& a, const Record& b) {
    return std::tie(a.place.run, a.place.rank, a.place.offset) <
           std::tie(b.place.run, b.place.rank, b.place.offset);
  });
}

/// Collective. Rank 0 lists the shards, all ranks scan them; the same on every rank: tiles of each
/// unit once, indices in the order of the runs.
FoundUnits scan_together(const std::filesystem::path& folder,
                         std::span<const WorkUnit> units,
                         const Communicator& communicator) {
  std::vector<std::byte> bytes;
  all_or_none(communicator, [&] {
    if (communicator.is_root()) bytes = bytes_of(shards_of(folder));
  });
  communicator.broadcast(bytes);
  const auto shards = records_of<UnitPlace>(bytes);
  const auto ranks = static_cast<std::size_t>(communicator.size());
  FoundUnits found;
  all_or_none(communicator, [&] {
    for (auto i = static_cast<std::size_t>(communicator.rank()); i < shards.size(); i += ranks)
      scan_shard(folder, shards[i], units, found);
  });
  found.tiles = from_all(found.tiles, communicator);
  found.indices = from_all(found.indices, communicator);
  sort_by_place(found.tiles);
  sort_by_place(found.indices);
  // A unit was cast again because its earlier record was damaged.
  std::map<std::uint64_t, RecordPlace> last;
  for (const RecordPlace& tiles : found.tiles) last[tiles.unit_id] = tiles;
  std::erase_if(found.tiles, [&](const RecordPlace& tiles) {
    return last.at(tiles.unit_id).place != tiles.place;
  });
  return found;
}

std::string manifest_text(const ProgressManifest& manifest) {
  return nlohmann::json{{"format", kFormat},
                        {"format_version", kFormatVersion},
                        {"decides", manifest.decides},
                        {"rays_per_unit", manifest.rays_per_unit}}
             .dump(2) +
         "\n";
}

ProgressManifest read_manifest(const std::filesystem::path& path) {
  ProgressManifest manifest;
  read_progress_manifest(path, kFormat, kFormatVersion, [&](const nlohmann::json& json) {
    manifest = {json.at("decides").get<DecidingValues>(),
                json.at("rays_per_unit").get<std::int64_t>()};
  });
  return manifest;
}

/// Stands in the folder when the options of its work were refused: others may replace it.
constexpr const char* kRefusedName = "refused";

/// Takes the note away, and the work with it when that was begun with other options: returns
/// whether it was.
bool clear_refused(const std::filesystem::path& folder, const ProgressManifest& manifest) {
  if (!std::filesystem::exists(folder / kRefusedName)) return false;
  const std::filesystem::path manifest_path = folder / kManifestName;
  const bool is_other = has_progress_manifest(manifest_path) &&
                        read_manifest(manifest_path).decides != manifest.decides;
  std::filesystem::remove_all(is_other ? folder : folder / kRefusedName);
  return is_other;
}

/// Rank 0 alone; returns the plan to use.
std::int64_t open_folder(const std::filesystem::path& folder,
                         bool restart,
                         const ProgressManifest& manifest,
                         bool& has_replaced_refused) {
  if (restart) std::filesystem::remove_all(folder);
  has_replaced_refused = clear_refused(folder, manifest);
  make_output_folder(folder);
  const std::filesystem::path manifest_path = folder / kManifestName;
  if (has_progress_manifest(manifest_path)) {
    const ProgressManifest earlier = read_manifest(manifest_path);
    require_same(earlier.decides, manifest.decides, folder);
    if (earlier.rays_per_unit < 1)
      throw FileError(manifest_path.string(),
                      "rays_per_unit",
                      "at least 1",
                      std::to_string(earlier.rays_per_unit));
    return earlier.rays_per_unit;
  }
  for (const UnitPlace& orphan : shards_of(folder))
    std::filesystem::remove_all(folder / shard_name(orphan.run, orphan.rank));
  write_text_file(manifest_path, manifest_text(manifest));
  return manifest.rays_per_unit;
}

/// One more than the highest run of any shard.
std::uint64_t next_run(const std::filesystem::path& folder) {
  const auto shards = shards_of(folder);
  return shards.empty() ? 0 : shards.back().run + 1;
}

std::uint64_t value_of_root(const Communicator& communicator, std::uint64_t value) {
  std::array<std::uint64_t, 1> shared{communicator.is_root() ? value : 0};
  communicator.maximum(shared);
  return shared[0];
}

}  // namespace

ProgressFolder::ProgressFolder(const std::filesystem::path& path,
                               bool restart,
                               ProgressManifest& manifest,
                               const Communicator& communicator)
    : path_(path), communicator_(communicator) {
  std::uint64_t run = 0;
  all_or_none(communicator_, [&] {
    if (!communicator_.is_root()) return;
    try {
      manifest.rays_per_unit = open_folder(path_, restart, manifest, has_replaced_refused_);
      run = next_run(path_);
    } catch (const std::filesystem::filesystem_error& error) {
      throw FileError(path_.string(), error.what());
    }
  });
  manifest.rays_per_unit = static_cast<std::int64_t>(
      value_of_root(communicator_, static_cast<std::uint64_t>(manifest.rays_per_unit)));
  shard_.run = value_of_root(communicator_, run);
  shard_.rank = static_cast<std::uint64_t>(communicator_.rank());
}

std::filesystem::path ProgressFolder::path_of(const UnitPlace& place) const {
  return path_ / shard_name(place.run, place.rank);
}

void ProgressFolder::visit_finished(std::span<const WorkUnit> units, const Visit& visit) {
  const FoundUnits found = scan_together(path_, units, communicator_);
  // Later runs are the ones to go on with.
  for (const IndicesPlace& of_unit : found.indices)
    encoded_places_[static_cast<std::uint32_t>(of_unit.unit_id)] = {
        of_unit.place, static_cast<std::uint32_t>(of_unit.codebook_crc)};
  const auto ranks = static_cast<std::size_t>(communicator_.size());
  for (auto i = static_cast<std::size_t>(communicator_.rank()); i < found.tiles.size();
       i += ranks) {
    const auto& [unit_id, place] = found.tiles[i];
    const WorkUnit& unit = units[unit_id];
    std::optional<UnitTiles> tiles = read_unit(path_of(place), place.offset, unit);
    if (!tiles.has_value()) continue;
    places_[unit.id] = place;
    visit(std::move(*tiles));
  }
}

void ProgressFolder::append(std::initializer_list<std::span<const std::byte>> parts) {
  const std::filesystem::path path = path_of(shard_);
  if (!file_.is_open()) file_.open(path, std::ios::binary | std::ios::app);
  for (const auto& part : parts) {
    file_.write(reinterpret_cast<const char*>(part.data()),
                static_cast<std::streamsize>(part.size()));
    shard_.offset += part.size();
  }
  file_.flush();
  if (!file_)
    throw FileError(path.string(), std::string("cannot be written: ") + std::strerror(errno));
  if (std::chrono::steady_clock::now() - last_sync_ > std::chrono::minutes(1)) sync();
}

void ProgressFolder::append(const UnitTiles& tiles) {
  const auto bitmap = std::as_bytes(std::span(tiles.occupied));
  const auto content = std::as_bytes(std::span(tiles.tiles));
  RecordHeader header;
  header.unit_id = tiles.unit_id;
  header.detail = static_cast<std::uint32_t>(tiles.occupied.size());
  header.count = tiles.tiles.size();
  header.content_crc = crc32c(content, crc32c(bitmap));
  header.header_crc = header.computed_crc();
  const UnitPlace place = shard_;
  append({std::as_bytes(std::span(&header, 1)), bitmap, content});
  places_[tiles.unit_id] = place;
}

void ProgressFolder::append(const WorkUnit& unit,
                            const EncodedUnit& encoded,
                            std::uint32_t codebook_crc) {
  const auto error = std::as_bytes(std::span(&encoded.squared_error, 1));
  const auto indices = std::as_bytes(std::span(encoded.indices));
  RecordHeader header;
  header.magic = kIndicesMagic;
  header.unit_id = unit.id;
  header.detail = codebook_crc;
  header.count = encoded.indices.size();
  header.content_crc = crc32c(indices, crc32c(error));
  header.header_crc = header.computed_crc();
  append({std::as_bytes(std::span(&header, 1)), error, indices});
}

std::optional<EncodedUnit> ProgressFolder::read_encoded(const WorkUnit& unit,
                                                        std::uint32_t codebook_crc) const {
  const auto found = encoded_places_.find(unit.id);
  if (found == encoded_places_.end() || found->second.codebook_crc != codebook_crc)
    return std::nullopt;
  return read_indices(path_of(found->second.place), found->second.place.offset, unit);
}

void ProgressFolder::share_places() {
  std::vector<RecordPlace> mine;
  for (const auto& [unit_id, place] : places_) mine.push_back({unit_id, place});
  for (const auto& bytes : communicator_.all_gather(std::as_bytes(std::span(mine))))
    for (const RecordPlace& record : records_of<RecordPlace>(bytes))
      places_[static_cast<std::uint32_t>(record.unit_id)] = record.place;
}

std::optional<UnitTiles> ProgressFolder::read(const WorkUnit& unit) const {
  const auto place = places_.find(unit.id);
  if (place == places_.end()) return std::nullopt;
  return read_unit(path_of(place->second), place->second.offset, unit);
}

void ProgressFolder::forget_cached() const {
  const int descriptor = ::open(path_of(shard_).c_str(), O_RDONLY);
  if (descriptor < 0) return;
  ::posix_fadvise(descriptor, 0, 0, POSIX_FADV_DONTNEED);
  ::close(descriptor);
}

void ProgressFolder::sync() {
  if (file_.is_open()) sync_path(path_of(shard_));
  last_sync_ = std::chrono::steady_clock::now();
}

void ProgressFolder::give_way() const {
  if (!communicator_.is_root()) return;
  try {
    write_text_file(path_ / kRefusedName, "");
  } catch (const Error&) {
    // What the options were refused for is the error to tell; without the note --restart helps.
  }
}

void ProgressFolder::remove() {
  file_.close();
  communicator_.barrier();
  all_or_none(communicator_, [&] {
    std::error_code error;
    if (communicator_.is_root()) std::filesystem::remove_all(path_, error);
    if (error) throw FileError(path_.string(), "cannot be removed: " + error.message());
  });
}

}  // namespace af
