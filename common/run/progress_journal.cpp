// SPDX-License-Identifier: Apache-2.0
#include "run/progress_journal.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <system_error>
#include <tuple>
#include <vector>

#include "base/crc32c.h"
#include "base/error.h"
#include "files/output_file.h"

namespace af {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "af-progress-journal";
constexpr int kFormatVersion = 3;  // 3: one file of records per run and process

/// Stands before every record.
struct RecordHeader {
  std::array<char, 4> magic = {'A', 'F', 'R', '1'};
  std::uint32_t content_bytes = 0;
  std::uint32_t content_crc = 0;
  std::uint32_t header_crc = 0;  ///< of the fields before it

  [[nodiscard]] std::uint32_t computed_crc() const {
    return crc32c(std::as_bytes(std::span(this, 1)).first(offsetof(RecordHeader, header_crc)));
  }
};
static_assert(sizeof(RecordHeader) == 16);

/// The next record; false at the end and where something is not sound.
bool read_record(std::ifstream& file, std::uint64_t bytes_left, std::vector<std::byte>& record) {
  RecordHeader header;
  if (bytes_left < sizeof(header)) return false;
  file.read(reinterpret_cast<char*>(&header), sizeof(header));
  if (!file || header.magic != RecordHeader{}.magic || header.header_crc != header.computed_crc() ||
      header.content_bytes > bytes_left - sizeof(header))
    return false;
  record.resize(header.content_bytes);
  file.read(reinterpret_cast<char*>(record.data()), static_cast<std::streamsize>(record.size()));
  return file.good() && crc32c(record) == header.content_crc;
}

DecidingValues read_manifest(const fs::path& path) {
  DecidingValues decides;
  read_progress_manifest(path, kFormat, kFormatVersion, [&](const nlohmann::json& json) {
    decides = json.at("decides").get<DecidingValues>();
  });
  return decides;
}

/// What the file system refuses, as an error of the folder.
void on_files_of(const fs::path& folder, const std::function<void()>& work) {
  try {
    work();
  } catch (const fs::filesystem_error& error) {
    throw FileError(folder.string(), error.what());
  }
}

fs::path manifest_path(const fs::path& folder, const std::string& name) {
  return folder / (name + ".json");
}

std::string padded(int number, std::size_t width) {
  const std::string digits = std::to_string(number);
  return std::string(width - std::min(width, digits.size()), '0') + digits;
}

/// "NAME.0002-000012.records".
fs::path shard_path(const fs::path& folder, const std::string& name, int run, int shard) {
  return folder / (name + "." + padded(run, 4) + "-" + padded(shard, 6) + ".records");
}

struct ShardFile {
  fs::path path;
  int run = 0;
};

/// The shards of a journal, by run and name. Another journal's name may begin alike.
std::vector<ShardFile> shards_of(const fs::path& folder, const std::string& name) {
  std::vector<ShardFile> shards;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string file = entry.path().filename().string();
    if (!file.starts_with(name + ".")) continue;
    const char* const number = file.c_str() + name.size() + 1;
    const int run = std::atoi(number);
    const char* const dash = std::strchr(number, '-');
    if (dash == nullptr || run < 0 || run == std::numeric_limits<int>::max()) continue;
    if (entry.path() == shard_path(folder, name, run, std::atoi(dash + 1)))
      shards.push_back({entry.path(), run});
  }
  std::sort(shards.begin(), shards.end(), [](const ShardFile& a, const ShardFile& b) {
    return std::tie(a.run, a.path) < std::tie(b.run, b.path);
  });
  return shards;
}

/// Visits the sound records up to the first that is not; returns their size with their headers.
/// Whatever else has the name of a shard holds none.
std::uint64_t visit_shard(const fs::path& path, const ProgressJournal::Visit& visit) {
  std::error_code unreachable;
  if (!fs::is_regular_file(path, unreachable)) return 0;
  std::ifstream file(path, std::ios::binary);
  if (!file) throw FileError(path.string(), "cannot be read");
  const std::uint64_t size = fs::file_size(path);
  std::uint64_t sound_bytes = 0;
  for (std::vector<std::byte> record; read_record(file, size - sound_bytes, record);) {
    visit(record);
    sound_bytes += sizeof(RecordHeader) + record.size();
  }
  return sound_bytes;
}

}  // namespace

ProgressJournal::ProgressJournal(const fs::path& folder,
                                 const std::string& name,
                                 const DecidingValues& decides,
                                 bool restart)
    : folder_(folder), name_(name) {
  make_output_folder(folder_);
  on_files_of(folder_, [&] { open(decides, restart); });
}

void ProgressJournal::open(const DecidingValues& decides, bool restart) {
  const fs::path manifest = manifest_path(folder_, name_);
  if (restart) fs::remove_all(manifest);
  if (has_progress_manifest(manifest)) {
    require_same(read_manifest(manifest), decides, folder_);
    for (const ShardFile& shard : shards_of(folder_, name_)) run_ = std::max(run_, shard.run + 1);
    return;
  }
  // Without a manifest we cannot tell what records belong to.
  for (const ShardFile& shard : shards_of(folder_, name_)) fs::remove_all(shard.path);
  const nlohmann::json written = {
      {"format", kFormat}, {"format_version", kFormatVersion}, {"decides", decides}};
  write_text_file(manifest, written.dump(2) + "\n");
}

void ProgressJournal::visit(int shard_count, const Visit& visit) const {
  std::set<fs::path> shards;
  for (const ShardFile& shard : shards_of(folder_, name_)) shards.insert(shard.path);
  for (int shard = 0; shard < shard_count; ++shard)
    if (const fs::path path = shard_path(folder_, name_, run_, shard); fs::exists(path))
      shards.insert(path);
  for (const fs::path& shard : shards) visit_shard(shard, visit);
}

void ProgressJournal::mend_and_visit(const Visit& visit) {
  on_files_of(folder_, [&] {
    for (const ShardFile& shard : shards_of(folder_, name_)) {
      const std::uint64_t sound_bytes = visit_shard(shard.path, visit);
      std::error_code unreachable;
      if (fs::is_regular_file(shard.path, unreachable) && sound_bytes < fs::file_size(shard.path))
        fs::resize_file(shard.path, sound_bytes);
    }
  });
}

void ProgressJournal::remove() {
  // The manifest first: shards alone are of nothing.
  fs::remove(manifest_path(folder_, name_));
  for (const ShardFile& shard : shards_of(folder_, name_)) fs::remove_all(shard.path);
  std::error_code not_empty;
  fs::remove(folder_, not_empty);
}

ProgressShard::ProgressShard(const fs::path& folder, const std::string& name, int run, int shard)
    : path_(shard_path(folder, name, run, shard)), last_sync_(std::chrono::steady_clock::now()) {}

void ProgressShard::append(std::span<const std::byte> record) {
  if (!file_.is_open()) file_.open(path_, std::ios::binary | std::ios::app);
  RecordHeader header;
  header.content_bytes = static_cast<std::uint32_t>(record.size());
  header.content_crc = crc32c(record);
  header.header_crc = header.computed_crc();
  for (const auto part : {std::as_bytes(std::span(&header, 1)), record})
    file_.write(reinterpret_cast<const char*>(part.data()),
                static_cast<std::streamsize>(part.size()));
  file_.flush();
  if (!file_)
    throw FileError(path_.string(), std::string("cannot be written: ") + std::strerror(errno));
  if (std::chrono::steady_clock::now() - last_sync_ > std::chrono::minutes(1)) sync();
}

void ProgressShard::sync() {
  if (file_.is_open()) sync_path(path_);
  last_sync_ = std::chrono::steady_clock::now();
}

}  // namespace af
