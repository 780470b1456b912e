// SPDX-License-Identifier: Apache-2.0
#include "io/progress_journal.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>
#include <system_error>
#include <vector>

#include "base/crc32c.h"
#include "base/error.h"
#include "io/output_file.h"

namespace af {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "af-progress-journal";
constexpr int kFormatVersion = 1;

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
  try {
    const nlohmann::json json = nlohmann::json::parse(read_text_file(path));
    if (json.at("format") != kFormat || json.at("format_version") != kFormatVersion)
      throw FileError(path.string(), "format", kFormat, json.at("format").dump());
    return json.at("decides").get<DecidingValues>();
  } catch (const nlohmann::json::exception& error) {
    throw FileError(path.string(),
                    std::string("damaged (") + error.what() + "): start over with --restart");
  }
}

}  // namespace

ProgressJournal::ProgressJournal(const fs::path& folder,
                                 const std::string& name,
                                 const DecidingValues& decides,
                                 bool restart)
    : folder_(folder), name_(name) {
  make_output_folder(folder_);
  if (restart) fs::remove(manifest_path());
  if (fs::exists(manifest_path())) {
    require_same(read_manifest(manifest_path()), decides, folder_);
    return;
  }
  // Records without a manifest are of nobody knows what.
  fs::remove(records_path());
  const nlohmann::json manifest = {
      {"format", kFormat}, {"format_version", kFormatVersion}, {"decides", decides}};
  write_text_file(manifest_path(), manifest.dump(2) + "\n");
}

fs::path ProgressJournal::manifest_path() const {
  return folder_ / (name_ + ".json");
}

fs::path ProgressJournal::records_path() const {
  return folder_ / (name_ + ".records");
}

void ProgressJournal::visit_finished(const Visit& visit) {
  if (!fs::exists(records_path())) return;
  std::ifstream file(records_path(), std::ios::binary);
  const std::uint64_t size = fs::file_size(records_path());
  std::uint64_t sound_bytes = 0;
  for (std::vector<std::byte> record; read_record(file, size - sound_bytes, record);) {
    visit(record);
    sound_bytes += sizeof(RecordHeader) + record.size();
  }
  if (sound_bytes < size) fs::resize_file(records_path(), sound_bytes);
}

void ProgressJournal::append(std::span<const std::byte> record) {
  if (!file_.is_open()) file_.open(records_path(), std::ios::binary | std::ios::app);
  RecordHeader header;
  header.content_bytes = static_cast<std::uint32_t>(record.size());
  header.content_crc = crc32c(record);
  header.header_crc = header.computed_crc();
  for (const auto part : {std::as_bytes(std::span(&header, 1)), record})
    file_.write(reinterpret_cast<const char*>(part.data()),
                static_cast<std::streamsize>(part.size()));
  file_.flush();
  if (!file_)
    throw FileError(records_path().string(),
                    std::string("cannot be written: ") + std::strerror(errno));
}

void ProgressJournal::sync() {
  if (file_.is_open()) sync_path(records_path());
}

void ProgressJournal::remove() {
  file_.close();
  fs::remove(manifest_path());
  fs::remove(records_path());
  std::error_code not_empty;
  fs::remove(folder_, not_empty);
}

}  // namespace af
