// SPDX-License-Identifier: Apache-2.0
#include "image_files/file_bytes.h"

#include <algorithm>
#include <fstream>
#include <new>
#include <vector>
#include <zlib.h>

#include "base/error.h"
#include "files/input_file.h"
#include "files/input_guard.h"

namespace af {

namespace fs = std::filesystem;

namespace {

/// The first byte of every gzip member, and of no zlib stream.
constexpr int kGzipMark = 0x1f;
constexpr int kNoByte = -1;

/// An inflating zlib stream (zlib or gzip wrapped) that releases itself.
class Inflater {
 public:
  Inflater() {
    // 15 bits of window; + 32 detects zlib or gzip framing by itself.
    if (inflateInit2(&stream_, 15 + 32) != Z_OK) throw std::bad_alloc();
  }
  ~Inflater() { inflateEnd(&stream_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  z_stream& stream() { return stream_; }

 private:
  z_stream stream_{};
};
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
  constexpr std::size_t kInputBytes = 1u << 14;
  std::string input = read_prefix(path, std::max(bytes, kInputBytes));
  if (!is_gzip(input)) return input.substr(0, bytes);
  std::string prefix(bytes, '\0');
  Inflater inflater;
  z_stream& stream = inflater.stream();
  stream.next_in = reinterpret_cast<unsigned char*>(input.data());
  stream.avail_in = static_cast<unsigned>(input.size());
  stream.next_out = reinterpret_cast<unsigned char*>(prefix.data());
  stream.avail_out = static_cast<unsigned>(bytes);
  (void)inflate(&stream, Z_SYNC_FLUSH);  // what came out before an error is still told apart
  prefix.resize(bytes - stream.avail_out);
  return prefix;
}

InflatedBytes inflate_file(const fs::path& path, std::uint64_t offset, const ByteVisitor& visit) {
  std::ifstream file = open_input_file(path);
  file.seekg(static_cast<std::streamoff>(offset));
  Inflater inflater;
  z_stream& stream = inflater.stream();
  std::vector<unsigned char> input(1u << 16);
  std::vector<unsigned char> output(1u << 18);
  InflatedBytes total;
  bool finished = false;
  while (file && !finished) {
    file.read(reinterpret_cast<char*>(input.data()), static_cast<std::streamsize>(input.size()));
    stream.next_in = input.data();
    stream.avail_in = static_cast<unsigned>(file.gcount());
    total.compressed += stream.avail_in;
    // A full output buffer may hide more output that needs no more input.
    do {
      stream.next_out = output.data();
      stream.avail_out = static_cast<unsigned>(output.size());
      const int status = inflate(&stream, Z_NO_FLUSH);
      const std::size_t inflated = output.size() - stream.avail_out;
      visit(std::as_bytes(std::span(output).first(inflated)));
      total.inflated += inflated;
      finished = status == Z_STREAM_END;
      // Z_BUF_ERROR: nothing was left to do; the next input goes on.
      if (!finished && status != Z_OK && status != Z_BUF_ERROR)
        throw FileError(path.string(),
                        "compressed data are corrupt after " + std::to_string(total.inflated) +
                            " bytes: " + (stream.msg != nullptr ? stream.msg : "bad stream"));
      // Another gzip member may follow; anything else does not belong to the stream.
      const int next = stream.avail_in > 0 ? stream.next_in[0] : finished ? file.peek() : kNoByte;
      if (finished && next == kGzipMark) {
        inflateReset(&stream);
        finished = false;
      }
    } while (!finished && (stream.avail_in > 0 || stream.avail_out == 0));
  }
  if (!finished)
    throw FileError(path.string(),
                    "truncated: the compressed data end after " + std::to_string(total.inflated) +
                        " bytes without their end mark");
  total.compressed -= stream.avail_in;
  return total;
}

std::uint64_t read_plain_file(const fs::path& path,
                              std::uint64_t offset,
                              const ByteVisitor& visit) {
  std::ifstream file = open_input_file(path);
  file.seekg(static_cast<std::streamoff>(offset));
  std::vector<char> piece(kPieceBytes);
  std::uint64_t total = 0;
  while (file) {
    file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    const auto found = static_cast<std::size_t>(file.gcount());
    visit(std::as_bytes(std::span(piece).first(found)));
    total += found;
  }
  return total;
}

}  // namespace af
