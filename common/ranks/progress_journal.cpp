// SPDX-License-Identifier: Apache-2.0
#include "ranks/progress_journal.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "base/crc32c.h"
#include "base/error.h"
#include "files/output_file.h"

namespace af {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "af-progress-journal";
constexpr int kFormatVersion = 4;  // 4: records have keys, and fields keep their units this way too

/// Precedes the content of every record.
struct RecordHeader {
  std::array<char, 8> magic = {'A', 'F', 'R', 'E', 'C', 'O', 'R', '4'};
  std::int64_t key = 0;
  std::uint64_t content_bytes = 0;
  std::uint32_t content_crc = 0;
  std::uint32_t header_crc = 0;  ///< over the journal's name and the fields before it

  [[nodiscard]] std::uint32_t computed_crc(const std::string& journal) const {
    return crc32c(std::as_bytes(std::span(this, 1)).first(offsetof(RecordHeader, header_crc)),
                  crc32c(std::as_bytes(std::span(journal))));
  }
};
static_assert(sizeof(RecordHeader) == 32);

/// Reads records of one shard, in order or at known places.
class ShardReader {
 public:
  ShardReader(const JournalFiles& files, const JournalShard& shard)
      : journal_(files.name), path_(files.shard(shard)) {
    std::error_code unreachable;
    // Opening a pipe would wait for its writer.
    if (!fs::is_regular_file(path_, unreachable)) return;
    size_ = fs::file_size(path_, unreachable);
    if (unreachable) size_ = 0;
    file_.open(path_, std::ios::binary);
  }

  [[nodiscard]] bool is_unreadable() const { return size_ > 0 && !file_.is_open(); }
  [[nodiscard]] const fs::path& path() const { return path_; }

  /// Reads a header and returns whether it is sound. Its content is read next.
  bool read_header(std::uint64_t offset) {
    if (!file_.is_open() || offset > size_ || size_ - offset < sizeof(header_)) return false;
    file_.clear();
    file_.seekg(static_cast<std::streamoff>(offset));
    read({reinterpret_cast<std::byte*>(&header_), sizeof(header_)});
    return file_.good() && header_.magic == RecordHeader{}.magic &&
           header_.header_crc == header_.computed_crc(journal_) &&
           header_.content_bytes <= size_ - offset - sizeof(header_);
  }
  [[nodiscard]] const RecordHeader& header() const { return header_; }

  bool read_content(std::initializer_list<std::span<std::byte>> parts) {
    std::uint64_t bytes = 0;
    std::uint32_t crc = 0;
    for (const std::span<std::byte> part : parts) bytes += part.size();
    if (bytes != header_.content_bytes) return false;
    for (const std::span<std::byte> part : parts) {
      read(part);
      crc = crc32c(part, crc);
    }
    return file_.good() && crc == header_.content_crc;
  }

 private:
  void read(std::span<std::byte> bytes) {
    file_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }

  const std::string& journal_;
  fs::path path_;
  std::uint64_t size_ = 0;
  std::ifstream file_;
  RecordHeader header_;
};

/// Calls `take` for every record of a shard, with its header.
void for_each_record(const JournalFiles& files,
                     const JournalShard& shard,
                     const std::function<void(ShardReader&, const RecordPlace&)>& take) {
  ShardReader reader(files, shard);
  if (reader.is_unreadable()) throw FileError(reader.path().string(), "cannot be read");
  RecordPlace place{shard};
  while (reader.read_header(place.offset)) {
    place.key = reader.header().key;
    place.bytes = reader.header().content_bytes;
    take(reader, place);
    place.offset += sizeof(RecordHeader) + place.bytes;
  }
}

std::string padded(std::int64_t number, std::size_t width) {
  const std::string digits = std::to_string(number);
  return std::string(width - std::min(width, digits.size()), '0') + digits;
}

/// Whether anything has this name, even a link to nowhere or to itself.
bool is_there(const fs::path& path) {
  return fs::symlink_status(path).type() != fs::file_type::not_found;
}

/// The manifest. Throws FileError that says what to do when the file cannot be one.
UnfinishedWork read_manifest(const fs::path& path, std::int64_t least_unit_size) {
  const auto unusable = [&](const std::string& why) {
    return FileError(path.string(), why + ": start over with --restart");
  };
  constexpr std::uintmax_t kMostBytes = 16u << 20;
  std::error_code error;
  if (!fs::is_regular_file(path, error)) throw unusable("is not a regular file");
  if (fs::file_size(path, error) > kMostBytes) throw unusable("is larger than any such file");
  try {
    const nlohmann::json manifest = nlohmann::json::parse(read_own_text_file(path));
    if (manifest.at("format") != kFormat || manifest.at("format_version") != kFormatVersion)
      throw unusable("is not of the format " + std::string(kFormat) + " " +
                     std::to_string(kFormatVersion));
    UnfinishedWork work;
    work.decides = deciding_values_of(manifest.at("decides"));
    work.unit_size = manifest.at("plan").get<std::int64_t>();
    if (work.unit_size < least_unit_size)
      throw unusable("plan = " + std::to_string(work.unit_size) + ": must be at least " +
                     std::to_string(least_unit_size));
    return work;
  } catch (const nlohmann::json::exception& damage) {
    throw unusable(std::string("damaged (") + damage.what() + ")");
  }
}

/// A file beside the manifest that says that the options of the work were refused.
fs::path refused_path(const JournalFiles& files) {
  return files.folder / (files.name + ".refused");
}

}  // namespace

fs::path JournalFiles::manifest() const {
  return folder / (name + ".json");
}

fs::path JournalFiles::shard(const JournalShard& shard) const {
  return folder / (name + "." + padded(shard.run, 4) + "-" + padded(shard.rank, 6) + ".records");
}

std::vector<JournalShard> JournalFiles::shards() const {
  // The next run's number must be higher than all of these.
  constexpr std::int64_t kMost = 1'000'000'000;
  std::vector<JournalShard> found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string file = entry.path().filename().string();
    if (!file.starts_with(name + ".")) continue;  // another journal's name may begin the same way
    char* end = nullptr;
    const std::int64_t run = std::strtoll(file.c_str() + name.size() + 1, &end, 10);
    const std::int64_t rank = *end == '-' ? std::strtoll(end + 1, nullptr, 10) : -1;
    const bool is_possible = run >= 0 && run <= kMost && rank >= 0 && rank <= kMost;
    if (is_possible && entry.path() == shard({run, rank})) found.push_back({run, rank});
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<RecordPlace> JournalFiles::records(const JournalShard& shard) const {
  std::vector<RecordPlace> places;
  for_each_record(
      *this, shard, [&](ShardReader&, const RecordPlace& place) { places.push_back(place); });
  return places;
}

bool JournalFiles::read(const RecordPlace& place,
                        std::initializer_list<std::span<std::byte>> parts) const {
  ShardReader reader(*this, place.shard);
  return reader.read_header(place.offset) && reader.header().key == place.key &&
         reader.read_content(parts);
}

bool holds_progress_journal(const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".json") continue;
    try {
      (void)read_manifest(entry.path(), 0);
      return true;
    } catch (const FileError&) {
      // This is another kind of file.
    }
  }
  return false;
}

ProgressJournal::ProgressJournal(const UnfinishedWork& work)
    : files_{work.folder, work.name}, unit_size_(work.unit_size) {
  if (work.restarts && is_there(files_.folder) && !fs::is_directory(files_.folder))
    fs::remove_all(files_.folder);
  make_folder(files_.folder);
  try {
    go_on_or_begin(work);
  } catch (const fs::filesystem_error& error) {
    throw FileError(files_.folder.string(), error.what());
  }
}

void ProgressJournal::go_on_or_begin(const UnfinishedWork& work) {
  const bool goes_on = !work.restarts && is_there(files_.manifest()) && takes_over(work);
  fs::remove_all(refused_path(files_));
  if (goes_on) {
    for (const JournalShard& shard : files_.shards()) run_ = shard.run + 1;
    return;
  }
  // Without a manifest nothing tells what the records belong to.
  for (const JournalShard& shard : files_.shards()) fs::remove_all(files_.shard(shard));
  fs::remove_all(files_.manifest());
  const nlohmann::json written = {{"format", kFormat},
                                  {"format_version", kFormatVersion},
                                  {"decides", to_json(work.decides)},
                                  {"plan", work.unit_size}};
  write_text_file(files_.manifest(), written.dump(2) + "\n");
}

/// Whether this run continues the work that is there.
bool ProgressJournal::takes_over(const UnfinishedWork& work) {
  UnfinishedWork earlier;
  try {
    earlier = read_manifest(files_.manifest(), work.unit_size > 0 ? 1 : 0);
  } catch (const FileError&) {
    if (!work.gives_way) throw;
    has_replaced_ = true;
    return false;
  }
  std::vector<std::string> problems = differences(earlier.decides, work.decides);
  if (problems.empty()) {
    unit_size_ = earlier.unit_size;
    return true;
  }
  if (!work.gives_way && !fs::exists(refused_path(files_))) {
    problems.emplace_back(
        "repeat the earlier options to go on with it, or give --restart to throw it away");
    throw_if_any(problems, files_.folder.string());
  }
  has_replaced_ = true;
  return false;
}

void ProgressJournal::visit(int rank_count, const Visit& visit) const {
  std::vector<JournalShard> shards = files_.shards();
  for (int rank = 0; rank < rank_count; ++rank) shards.push_back({run_, rank});
  std::sort(shards.begin(), shards.end());
  shards.erase(std::unique(shards.begin(), shards.end()), shards.end());
  std::vector<std::byte> content;
  for (const JournalShard& shard : shards)
    for_each_record(files_, shard, [&](ShardReader& reader, const RecordPlace& place) {
      content.resize(place.bytes);
      if (reader.read_content({content})) visit(place.key, content);
    });
}

void ProgressJournal::give_way() const {
  write_text_file(refused_path(files_), "");
}

ProgressShard::ProgressShard(JournalFiles files, const JournalShard& shard)
    : files_(std::move(files)), path_(files_.shard(shard)), next_{shard} {}

RecordPlace ProgressShard::append(std::int64_t key,
                                  std::initializer_list<std::span<const std::byte>> parts) {
  if (!file_.is_open()) file_.open(path_, std::ios::binary | std::ios::app);
  const auto write = [&](std::span<const std::byte> bytes) {
    file_.write(reinterpret_cast<const char*>(bytes.data()),
                static_cast<std::streamsize>(bytes.size()));
  };
  RecordHeader header;
  header.key = key;
  for (const std::span<const std::byte> part : parts) {
    header.content_bytes += part.size();
    header.content_crc = crc32c(part, header.content_crc);
  }
  header.header_crc = header.computed_crc(files_.name);
  write(std::as_bytes(std::span(&header, 1)));
  for (const std::span<const std::byte> part : parts) write(part);
  file_.flush();
  if (!file_)
    throw FileError(path_.string(), std::string("cannot be written: ") + std::strerror(errno));
  if (std::chrono::steady_clock::now() - last_sync_ > std::chrono::minutes(1)) sync();
  next_.key = key;
  next_.bytes = header.content_bytes;
  const RecordPlace written = next_;
  next_.offset += sizeof(header) + header.content_bytes;
  return written;
}

void ProgressShard::sync() {
  if (file_.is_open()) sync_path(path_);
  last_sync_ = std::chrono::steady_clock::now();
}

void ProgressShard::forget_cached() const {
  const int descriptor = ::open(path_.c_str(), O_RDONLY);
  if (descriptor < 0) return;
  ::posix_fadvise(descriptor, 0, 0, POSIX_FADV_DONTNEED);
  ::close(descriptor);
}

}  // namespace af
