// SPDX-License-Identifier: Apache-2.0
#include "precompute/progress_files.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <set>
#include <unistd.h>

#include "base/error.h"
#include "io/output_file.h"

namespace af {

namespace {

constexpr const char* kFormat = "af-precompute-progress";
constexpr int kFormatVersion = 1;
constexpr std::array<char, 8> kMagic = {'A', 'F', 'U', 'N', 'I', 'T', '0', '1'};

/// Stands before every unit in a shard.
struct RecordHeader {
  std::array<char, 8> magic = kMagic;
  std::uint32_t unit_id = 0;
  std::uint32_t bitmap_words = 0;
  std::uint64_t tile_count = 0;
  std::uint32_t content_crc = 0;
  std::uint32_t header_crc = 0;  ///< of the fields before it

  [[nodiscard]] std::uint64_t content_bytes() const {
    return bitmap_words * sizeof(std::uint64_t) + tile_count * sizeof(Tile);
  }
  [[nodiscard]] std::uint32_t computed_crc() const {
    return crc32c(std::as_bytes(std::span(this, 1)).first(offsetof(RecordHeader, header_crc)));
  }
};
static_assert(sizeof(RecordHeader) == 32);

/// Where a unit lies in the shards.
struct RecordPlace {
  std::uint64_t shard = 0;
  std::uint64_t offset = 0;
  RecordHeader header;
};

std::vector<std::filesystem::path> shard_paths(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".shard") paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  return paths;
}

/// Headers that make sense, up to the first that does not: what follows a torn record is lost.
void scan_shard(const std::filesystem::path& path,
                std::uint64_t shard,
                std::span<const WorkUnit> units,
                std::set<std::uint32_t>& seen,
                std::vector<RecordPlace>& places) {
  std::ifstream file(path, std::ios::binary);
  const std::uint64_t size = std::filesystem::file_size(path);
  std::uint64_t offset = 0;
  while (size - offset >= sizeof(RecordHeader)) {
    RecordPlace place{shard, offset, {}};
    file.seekg(static_cast<std::streamoff>(offset));
    file.read(reinterpret_cast<char*>(&place.header), sizeof(RecordHeader));
    const RecordHeader& header = place.header;
    if (!file || header.magic != kMagic || header.header_crc != header.computed_crc() ||
        header.unit_id >= units.size())
      return;
    const std::size_t tile_count = units[header.unit_id].tile_count();
    if (header.bitmap_words != (tile_count + 63) / 64 || header.tile_count > tile_count ||
        header.content_bytes() > size - offset - sizeof(RecordHeader))
      return;
    offset += sizeof(RecordHeader) + header.content_bytes();
    if (seen.insert(header.unit_id).second) places.push_back(place);
  }
}

/// The unit, or one without bitmap when its content is damaged.
UnitTiles read_unit(std::ifstream& file, const RecordPlace& place, const WorkUnit& unit) {
  UnitTiles tiles;
  tiles.unit_id = place.header.unit_id;
  tiles.occupied.resize(place.header.bitmap_words);
  tiles.tiles.resize(place.header.tile_count);
  const auto read_into = [&](std::span<std::byte> bytes) {
    file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  };
  file.clear();
  file.seekg(static_cast<std::streamoff>(place.offset + sizeof(RecordHeader)));
  const auto bitmap = std::as_writable_bytes(std::span(tiles.occupied));
  const auto content = std::as_writable_bytes(std::span(tiles.tiles));
  read_into(bitmap);
  read_into(content);
  const bool is_sound = file.good() &&
                        crc32c(content, crc32c(bitmap)) == place.header.content_crc &&
                        problems(tiles, unit).empty();
  if (!is_sound) tiles.occupied.clear();
  return tiles;
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
  try {
    const nlohmann::json json = nlohmann::json::parse(read_text_file(path));
    if (json.at("format") != kFormat || json.at("format_version") != kFormatVersion)
      throw FileError(path.string(), "format", kFormat, json.at("format").dump());
    return {json.at("decides").get<std::map<std::string, std::string>>(),
            json.at("rays_per_unit").get<std::int64_t>()};
  } catch (const nlohmann::json::exception& error) {
    throw FileError(path.string(),
                    std::string("damaged (") + error.what() + "): start over with --restart");
  }
}

void require_same(const ProgressManifest& earlier,
                  const ProgressManifest& now,
                  const std::filesystem::path& folder) {
  std::vector<std::string> differences;
  for (const auto& [name, value] : now.decides) {
    const auto found = earlier.decides.find(name);
    const std::string before = found == earlier.decides.end() ? "nothing" : found->second;
    if (before != value)
      differences.push_back(std::string(name)
                                .append(" = ")
                                .append(value)
                                .append(": the unfinished work was begun with ")
                                .append(before));
  }
  if (differences.empty() && earlier.decides.size() == now.decides.size()) return;
  differences.emplace_back(
      "repeat the earlier options to go on with it, or give --restart to throw it away");
  throw_if_any(differences, folder.string());
}

/// Rank 0 alone; returns the plan to use.
std::int64_t open_folder(const std::filesystem::path& folder,
                         bool restart,
                         const ProgressManifest& manifest) {
  if (restart) std::filesystem::remove_all(folder);
  make_output_folder(folder);
  const std::filesystem::path manifest_path = folder / "manifest.json";
  if (std::filesystem::exists(manifest_path)) {
    const ProgressManifest earlier = read_manifest(manifest_path);
    require_same(earlier, manifest, folder);
    if (earlier.rays_per_unit < 1)
      throw FileError(manifest_path.string(),
                      "rays_per_unit",
                      "at least 1",
                      std::to_string(earlier.rays_per_unit));
    return earlier.rays_per_unit;
  }
  for (const auto& orphan : shard_paths(folder)) std::filesystem::remove(orphan);
  write_text_file(manifest_path, manifest_text(manifest));
  return manifest.rays_per_unit;
}

/// "0017-000003.shard": run, rank.
std::filesystem::path shard_name(std::uint64_t run, int rank) {
  const auto padded = [](const std::string& digits, std::size_t width) {
    return std::string(width - std::min(width, digits.size()), '0') + digits;
  };
  return padded(std::to_string(run), 4) + "-" + padded(std::to_string(rank), 6) + ".shard";
}

/// One more than the highest run of any shard.
std::uint64_t next_run(const std::filesystem::path& folder) {
  std::uint64_t run = 0;
  for (const auto& path : shard_paths(folder))
    run = std::max<std::uint64_t>(run, std::strtoull(path.filename().c_str(), nullptr, 10) + 1);
  return run;
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
      manifest.rays_per_unit = open_folder(path_, restart, manifest);
      run = next_run(path_);
    } catch (const std::filesystem::filesystem_error& error) {
      throw FileError(path_.string(), error.what());
    }
  });
  manifest.rays_per_unit = static_cast<std::int64_t>(
      value_of_root(communicator_, static_cast<std::uint64_t>(manifest.rays_per_unit)));
  shard_path_ = path_ / shard_name(value_of_root(communicator_, run), communicator_.rank());
}

std::vector<UnitTiles> ProgressFolder::read_finished(std::span<const WorkUnit> units) const {
  std::vector<std::filesystem::path> paths;
  std::vector<std::byte> bytes;
  all_or_none(communicator_, [&] {
    if (!communicator_.is_root()) return;
    paths = shard_paths(path_);
    std::vector<RecordPlace> found;
    std::set<std::uint32_t> seen;
    for (std::size_t i = 0; i < paths.size(); ++i) scan_shard(paths[i], i, units, seen, found);
    const auto raw = std::as_bytes(std::span(found));
    bytes.assign(raw.begin(), raw.end());
  });
  communicator_.broadcast(bytes);
  std::vector<RecordPlace> places(bytes.size() / sizeof(RecordPlace));
  if (!bytes.empty()) std::memcpy(places.data(), bytes.data(), bytes.size());
  std::string names;
  for (const auto& path : paths) names += path.filename().string() + "\n";
  communicator_.broadcast(names);

  std::vector<std::filesystem::path> known;
  for (std::size_t begin = 0; begin < names.size();) {
    const std::size_t end = names.find('\n', begin);
    known.push_back(path_ / names.substr(begin, end - begin));
    begin = end + 1;
  }
  std::vector<UnitTiles> mine;
  std::ifstream file;
  std::uint64_t opened = known.size();
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (i % static_cast<std::size_t>(communicator_.size()) !=
        static_cast<std::size_t>(communicator_.rank()))
      continue;
    if (places[i].shard != opened) {
      file = std::ifstream(known[places[i].shard], std::ios::binary);
      opened = places[i].shard;
    }
    UnitTiles tiles = read_unit(file, places[i], units[places[i].header.unit_id]);
    if (!tiles.occupied.empty()) mine.push_back(std::move(tiles));
  }
  return mine;
}

void ProgressFolder::append(const UnitTiles& tiles) {
  if (!shard_.is_open()) shard_.open(shard_path_, std::ios::binary | std::ios::app);
  const auto bitmap = std::as_bytes(std::span(tiles.occupied));
  const auto content = std::as_bytes(std::span(tiles.tiles));
  RecordHeader header;
  header.unit_id = tiles.unit_id;
  header.bitmap_words = static_cast<std::uint32_t>(tiles.occupied.size());
  header.tile_count = tiles.tiles.size();
  header.content_crc = crc32c(content, crc32c(bitmap));
  header.header_crc = header.computed_crc();
  for (const auto& part : {std::as_bytes(std::span(&header, 1)), bitmap, content})
    shard_.write(reinterpret_cast<const char*>(part.data()),
                 static_cast<std::streamsize>(part.size()));
  shard_.flush();
  if (!shard_)
    throw FileError(shard_path_.string(),
                    std::string("cannot be written: ") + std::strerror(errno));
}

void ProgressFolder::sync() {
  if (!shard_.is_open()) return;
  const int descriptor = ::open(shard_path_.c_str(), O_RDONLY);
  const bool is_synced = descriptor >= 0 && ::fsync(descriptor) == 0;
  const int reason = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (!is_synced)
    throw FileError(shard_path_.string(), std::string("cannot sync: ") + std::strerror(reason));
}

void ProgressFolder::remove() {
  shard_.close();
  communicator_.barrier();
  all_or_none(communicator_, [&] {
    std::error_code error;
    if (communicator_.is_root()) std::filesystem::remove_all(path_, error);
    if (error) throw FileError(path_.string(), "cannot be removed: " + error.message());
  });
}

std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t previous) {
  // The SSE4.2 instruction: part of the x86-64-v2 baseline.
  std::uint64_t crc = ~previous;
  std::size_t i = 0;
  for (; i + 8 <= bytes.size(); i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, sizeof(word));
    crc = __builtin_ia32_crc32di(crc, word);
  }
  auto tail = static_cast<std::uint32_t>(crc);
  for (; i < bytes.size(); ++i)
    tail = __builtin_ia32_crc32qi(tail, static_cast<unsigned char>(bytes[i]));
  return ~tail;
}

}  // namespace af
