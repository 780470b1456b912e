// SPDX-License-Identifier: Apache-2.0
#include "images/file_bytes.h"

#include <new>
#include <zlib.h>

#include "base/error.h"
#include "files/input_file.h"
#include "files/input_guard.h"

namespace af {

namespace fs = std::filesystem;

namespace {

/// The first byte of every gzip member, and of no zlib stream.
constexpr int kGzipMark = 0x1f;

void release(z_stream* stream) {
  inflateEnd(stream);
  delete stream;
}

}  // namespace

std::string read_prefix(const fs::path& path, std::size_t bytes) {
  note_input(path);
  std::ifstream file = open_input_file(path);
  std::string prefix(bytes, '\0');
  file.read(prefix.data(), static_cast<std::streamsize>(bytes));
  prefix.resize(static_cast<std::size_t>(file.gcount()));
  return prefix;
}

bool is_gzip(std::string_view bytes) {
  return bytes.starts_with("\x1f\x8b");
}

std::string read_inflated_prefix(const fs::path& path, std::size_t bytes) {
  ByteSource source(path, 0, is_gzip(read_prefix(path, 2)));
  std::string prefix(bytes, '\0');
  prefix.resize(source.read(std::as_writable_bytes(std::span(prefix))));
  return prefix;
}

ByteSource::ByteSource(const fs::path& path, std::uint64_t offset, bool is_compressed)
    : path_(path.string()), file_(open_input_file(path)), stream_(nullptr, &release) {
  file_.seekg(static_cast<std::streamoff>(offset));
  if (!is_compressed) return;
  constexpr std::size_t kInputBytes = 1u << 16;
  constexpr int kAnyWindowAndFrame = 15 + 32;  // zlib or gzip
  input_.resize(kInputBytes);
  stream_.reset(new z_stream{});
  if (inflateInit2(stream_.get(), kAnyWindowAndFrame) != Z_OK) throw std::bad_alloc();
}

void ByteSource::refill() {
  file_.read(reinterpret_cast<char*>(input_.data()), static_cast<std::streamsize>(input_.size()));
  stream_->next_in = input_.data();
  stream_->avail_in = static_cast<unsigned>(file_.gcount());
  taken_ += stream_->avail_in;
  if (stream_->avail_in == 0)
    throw FileError(path_,
                    "truncated: the compressed data end after " +
                        std::to_string(stream_->total_out) + " bytes without their end mark");
}

std::size_t ByteSource::read(std::span<std::byte> bytes) {
  if (stream_ == nullptr) {
    file_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return static_cast<std::size_t>(file_.gcount());
  }
  z_stream& stream = *stream_;
  stream.next_out = reinterpret_cast<unsigned char*>(bytes.data());
  stream.avail_out = static_cast<unsigned>(bytes.size());
  while (stream.avail_out > 0 && !is_finished_) {
    if (stream.avail_in == 0) refill();
    const int status = inflate(&stream, Z_NO_FLUSH);
    if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR)
      throw FileError(path_,
                      "compressed data are corrupt after " + std::to_string(stream.total_out) +
                          " bytes: " + (stream.msg != nullptr ? stream.msg : "bad stream"));
    if (status != Z_STREAM_END) continue;
    // Another gzip member may follow; anything else does not belong to the stream.
    const int next = stream.avail_in > 0 ? stream.next_in[0] : file_.peek();
    is_finished_ = next != kGzipMark;
    if (!is_finished_) inflateReset(&stream);
  }
  return bytes.size() - stream.avail_out;
}

std::uint64_t ByteSource::drain() {
  std::vector<std::byte> rest(1u << 18);
  std::uint64_t total = 0;
  for (std::size_t found = rest.size(); found == rest.size(); total += found) found = read(rest);
  return total;
}

std::uint64_t ByteSource::compressed_bytes() const {
  return stream_ == nullptr ? 0 : taken_ - stream_->avail_in;
}

}  // namespace af
