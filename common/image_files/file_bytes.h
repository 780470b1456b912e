// SPDX-License-Identifier: Apache-2.0
// Bytes of files, plain or deflated, for readers that trust neither.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace af {

/// Pieces of a stream, in order.
using ByteVisitor = std::function<void(std::span<const std::byte>)>;

/// The most bytes that ByteVisitor is given at once by read_plain_file.
inline constexpr std::size_t kPieceBytes = std::size_t{1} << 20;

/// The first `bytes` of a file; fewer when there are not as many. FileError when it cannot be read.
std::string read_prefix(const std::filesystem::path& path, std::size_t bytes);

bool is_gzip(std::string_view bytes);

/// First bytes of a file, inflated when it is gzip; fewer when there are not as many.
std::string read_inflated_prefix(const std::filesystem::path& path, std::size_t bytes);

/// The lengths of a compressed stream.
struct InflatedBytes {
  std::uint64_t inflated = 0;
  std::uint64_t compressed = 0;
};

/// Inflates a zlib stream, or all members of a gzip file, that begins at `offset`, handing the
/// bytes to `visit` on the way. What stands behind its end is not looked at. FileError when it is
/// cut or its checksum is wrong.
InflatedBytes inflate_file(const std::filesystem::path& path,
                           std::uint64_t offset,
                           const ByteVisitor& visit);

/// Reads a file from `offset` to its end in pieces of kPieceBytes; how many bytes there were.
std::uint64_t read_plain_file(const std::filesystem::path& path,
                              std::uint64_t offset,
                              const ByteVisitor& visit);

}  // namespace af
