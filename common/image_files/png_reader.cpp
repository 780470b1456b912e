// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cerrno>
#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>
#include <sys/mman.h>
#include <system_error>
#include <unistd.h>
#include <zlib.h>

#include "base/error.h"
#include "files/input_file.h"
#include "image_files/image_formats.h"

namespace af::image_formats {

namespace fs = std::filesystem;

namespace {

std::uint32_t big_endian(std::string_view bytes) {
  std::uint32_t value = 0;
  for (const char byte : bytes) value = value << 8 | static_cast<unsigned char>(byte);
  return value;
}

/// Checks IHDR; libpng aborts the process on what it does not like there.
void check_png_header(const std::string& path, std::string_view data) {
  constexpr std::uint32_t kMaxPngSide = 1000000;  // libpng's own limit
  const std::uint32_t width = big_endian(data.substr(0, 4));
  const std::uint32_t height = big_endian(data.substr(4, 4));
  if (width < 1 || height < 1 || width > kMaxPngSide || height > kMaxPngSide)
    throw FileError(path,
                    "PNG size",
                    "1 to 1000000 pixels",
                    std::to_string(width) + " x " + std::to_string(height));
  const int depth = static_cast<unsigned char>(data[8]);
  const int color = static_cast<unsigned char>(data[9]);
  if (color == 2 || color == 3 || color == 4 || color == 6)
    throw InputError("PNG colour type", std::to_string(color), "must be 0, plain grey", path);
  if (color != 0 || std::string_view("\1\2\4\10\20").find(data[8]) == std::string_view::npos ||
      data[10] != 0 || data[11] != 0 || (data[12] & ~1) != 0)
    throw FileError(
        path,
        "PNG header",
        "grey of 1 to 16 bits",
        "colour type " + std::to_string(color) + ", " + std::to_string(depth) + " bits");
}

/// Walks the chunks of a PNG file with their checksums up to its end mark. The file's bytes, but of
/// its chunks only those of the stored values: others (sBIT, tRNS) make ITK change these.
std::string plain_png(const fs::path& path) {
  const std::uint64_t file_bytes = existing_file_size(path, path);
  std::ifstream file = open_input_file(path);
  constexpr std::uint64_t kSignatureBytes = 8;
  std::string plain(kSignatureBytes, '\0');
  file.read(plain.data(), static_cast<std::streamsize>(plain.size()));
  std::uint64_t at = kSignatureBytes;
  for (bool is_first = true;; is_first = false) {
    std::array<char, 8> head{};
    file.seekg(static_cast<std::streamoff>(at));
    file.read(head.data(), head.size());
    const std::uint64_t length = big_endian({head.data(), 4});
    const std::string_view type(head.data() + 4, 4);
    if (!file || at + 12 + length > file_bytes)
      throw FileError(path.string(), "truncated: a PNG chunk reaches beyond the end of the file");
    std::string data(length + 4, '\0');
    file.read(data.data(), static_cast<std::streamsize>(data.size()));
    uLong crc = crc32(0, reinterpret_cast<const unsigned char*>(type.data()), 4);
    crc =
        crc32(crc, reinterpret_cast<const unsigned char*>(data.data()), static_cast<uInt>(length));
    if (crc != big_endian(std::string_view(data).substr(length)))
      throw FileError(path.string(),
                      "corrupt: the checksum of PNG chunk " + std::string(type) + " is wrong");
    if (is_first && (type != "IHDR" || length != 13))
      throw FileError(path.string(), "PNG file does not begin with its header");
    if (is_first) check_png_header(path.string(), data);
    if (type == "IHDR" || type == "IDAT" || type == "IEND")
      plain.append(head.data(), head.size()).append(data);
    if (type == "IEND") return plain;
    at += 12 + length;
  }
}

/// Bytes that a library can open as a file; kept in memory.
class BytesAsFile {
 public:
  BytesAsFile(const std::string& what, std::string_view bytes)
      : descriptor_(memfd_create("image", MFD_CLOEXEC)) {
    while (descriptor_ >= 0 && !bytes.empty()) {
      const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
      if (written <= 0) break;
      bytes.remove_prefix(static_cast<std::size_t>(written));
    }
    if (descriptor_ >= 0 && bytes.empty()) return;
    const std::string trouble = std::generic_category().message(errno);
    if (descriptor_ >= 0) ::close(descriptor_);
    throw FileError(what, "cannot be held in memory: " + trouble);
  }
  ~BytesAsFile() { ::close(descriptor_); }
  BytesAsFile(const BytesAsFile&) = delete;
  BytesAsFile& operator=(const BytesAsFile&) = delete;
  [[nodiscard]] fs::path path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

}  // namespace

RawImage read_png(const fs::path& path, const AcceptImage& accept) {
  const BytesAsFile plain(path.string(), plain_png(path));
  return read_raw_image(plain.path(), ImageFormat::Png, accept);
}

}  // namespace af::image_formats
