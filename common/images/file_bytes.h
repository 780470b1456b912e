// SPDX-License-Identifier: Apache-2.0
// Bytes of files, plain or deflated, for readers that trust neither.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

struct z_stream_s;

namespace af {

/// The number at `offset`. `is_swapped`: bytes are in the opposite order to this machine's.
template <typename T>
T number_at(std::string_view bytes, std::size_t offset, bool is_swapped) {
  std::array<char, sizeof(T)> raw{};
  std::copy_n(bytes.data() + offset, sizeof(T), raw.begin());
  if (is_swapped) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

/// The first `bytes` of a file, or fewer when it is shorter. Throws FileError when it cannot be
/// read.
std::string read_prefix(const std::filesystem::path& path, std::size_t bytes);

bool is_gzip(std::string_view bytes);

/// First bytes of a file, inflated when it is gzip; fewer when it is shorter.
std::string read_inflated_prefix(const std::filesystem::path& path, std::size_t bytes);

/// Bytes of a file from `offset` on: as they are, or inflated from the zlib stream or all members
/// of the gzip file that begins there. What follows its end is ignored.
class ByteSource {
 public:
  ByteSource(const std::filesystem::path& path, std::uint64_t offset, bool is_compressed);

  /// Fills `bytes` as far as there are any, and returns how many there were. Throws FileError when
  /// a compressed stream is cut or its checksum is wrong.
  std::size_t read(std::span<std::byte> bytes);
  /// Reads to the end, and returns how many bytes there were.
  std::uint64_t drain();
  /// Bytes of the compressed stream that were read.
  [[nodiscard]] std::uint64_t compressed_bytes() const;

 private:
  void refill();

  std::string path_;
  std::ifstream file_;
  /// nullptr where nothing is compressed.
  std::unique_ptr<z_stream_s, void (*)(z_stream_s*)> stream_;
  std::vector<unsigned char> input_;
  std::uint64_t taken_ = 0;  ///< bytes read from the file
  bool is_finished_ = false;
};

}  // namespace af
