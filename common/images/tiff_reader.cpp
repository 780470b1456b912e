// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstring>
#include <optional>
#include <tiffio.h>

#include "base/error.h"
#include "files/input_file.h"
#include "files/input_guard.h"
#include "images/image_formats.h"

namespace af::image_formats {

namespace fs = std::filesystem;

namespace {

constexpr tmsize_t kMostBlockBytes = tmsize_t{1} << 30;
constexpr std::size_t kMostPages = 100000;

/// An open file. Its library's complaints are kept, not printed.
class TiffFile {
 public:
  explicit TiffFile(const fs::path& path) : path_(path.string()) {
    require_regular_file(path);
    note_input(path);
    TIFFOpenOptions* const options = TIFFOpenOptionsAlloc();
    TIFFOpenOptionsSetMaxSingleMemAlloc(options, kMostBlockBytes);
    TIFFOpenOptionsSetErrorHandlerExtR(options, &keep_complaint, this);
    TIFFOpenOptionsSetWarningHandlerExtR(
        options, [](TIFF*, void*, const char*, const char*, va_list) { return 1; }, nullptr);
    file_ = TIFFOpenExt(path_.c_str(), "rm", options);
    TIFFOpenOptionsFree(options);
    if (file_ == nullptr) fail("its first page cannot be read");
  }
  ~TiffFile() { TIFFClose(file_); }
  TiffFile(const TiffFile&) = delete;
  TiffFile& operator=(const TiffFile&) = delete;

  [[nodiscard]] TIFF* get() const { return file_; }
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::uint32_t number(std::uint32_t tag) const {
    std::uint32_t value = 0;
    return TIFFGetFieldDefaulted(file_, tag, &value) == 1 ? value : 0;
  }
  /// A tag of two bytes.
  [[nodiscard]] int code(std::uint32_t tag, int fallback) const {
    std::uint16_t value = 0;
    return TIFFGetFieldDefaulted(file_, tag, &value) == 1 ? value : fallback;
  }
  [[noreturn]] void fail(const std::string& what) const {
    throw FileError(path_,
                    "not a readable TIFF image, or truncated: " + what +
                        (complaint_.empty() ? "" : " (" + complaint_ + ")"));
  }
  [[noreturn]] void refuse(const char* tag, const std::string& value, const char* rule) const {
    throw InputError(std::string("TIFF ") + tag, value, rule, path_);
  }

 private:
  static int keep_complaint(
      TIFF*, void* user, const char*, const char* format, va_list values) noexcept {
    std::array<char, 300> text{};
    (void)::vsnprintf(text.data(), text.size(), format, values);
    static_cast<TiffFile*>(user)->complaint_ = text.data();
    return 1;
  }

  std::string path_;
  std::string complaint_;
  TIFF* file_ = nullptr;
};

/// How a page holds its values.
struct Page {
  std::size_t columns = 0;  ///< as stored
  std::size_t rows = 0;
  int bits = 0;
  ValueType type = ValueType::UInt8;
  int orientation = ORIENTATION_TOPLEFT;
  bool is_white_zero = false;

  [[nodiscard]] bool is_turned() const { return orientation >= ORIENTATION_LEFTTOP; }
  [[nodiscard]] std::size_t width() const { return is_turned() ? rows : columns; }
  [[nodiscard]] std::size_t height() const { return is_turned() ? columns : rows; }
  [[nodiscard]] bool is_packed() const { return bits % 8 != 0; }

  /// Where a stored value stands in the upright image.
  [[nodiscard]] std::size_t place(std::size_t column, std::size_t row) const {
    const auto is_one_of = [&](const std::array<int, 4>& turns) {
      return std::ranges::find(turns, orientation) != turns.end();
    };
    if (is_one_of({ORIENTATION_TOPRIGHT,
                   ORIENTATION_BOTRIGHT,
                   ORIENTATION_RIGHTBOT,
                   ORIENTATION_LEFTBOT}))
      column = columns - 1 - column;
    if (is_one_of({ORIENTATION_BOTRIGHT,
                   ORIENTATION_BOTLEFT,
                   ORIENTATION_RIGHTTOP,
                   ORIENTATION_RIGHTBOT}))
      row = rows - 1 - row;
    return is_turned() ? column * rows + row : row * columns + column;
  }
};

std::optional<ValueType> value_type_of(int format, int bits) {
  const bool is_unsigned = format == SAMPLEFORMAT_UINT || format == SAMPLEFORMAT_VOID;
  if (is_unsigned && bits >= 1 && bits <= 16)
    return bits <= 8 ? ValueType::UInt8 : ValueType::UInt16;
  if (is_unsigned && bits == 32) return ValueType::UInt32;
  if (is_unsigned && bits == 64) return ValueType::UInt64;
  if (format == SAMPLEFORMAT_INT && bits == 8) return ValueType::Int8;
  if (format == SAMPLEFORMAT_INT && bits == 16) return ValueType::Int16;
  if (format == SAMPLEFORMAT_INT && bits == 32) return ValueType::Int32;
  if (format == SAMPLEFORMAT_INT && bits == 64) return ValueType::Int64;
  if (format == SAMPLEFORMAT_IEEEFP && bits == 32) return ValueType::Float32;
  if (format == SAMPLEFORMAT_IEEEFP && bits == 64) return ValueType::Float64;
  return std::nullopt;
}

Page page_of(const TiffFile& file) {
  Page page;
  page.columns = file.number(TIFFTAG_IMAGEWIDTH);
  page.rows = file.number(TIFFTAG_IMAGELENGTH);
  if (page.columns == 0 || page.rows == 0) file.fail("it has no size");
  if (const int samples = file.code(TIFFTAG_SAMPLESPERPIXEL, 1); samples != 1)
    file.refuse("SamplesPerPixel", std::to_string(samples), "must be 1: grey without alpha");
  const int meaning = file.code(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  if (meaning != PHOTOMETRIC_MINISBLACK && meaning != PHOTOMETRIC_MINISWHITE)
    file.refuse("PhotometricInterpretation",
                std::to_string(meaning) + (meaning == PHOTOMETRIC_PALETTE ? " (palette)" : ""),
                "must be 0 or 1: grey");
  page.bits = file.code(TIFFTAG_BITSPERSAMPLE, 1);
  const int format = file.code(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT);
  const std::optional<ValueType> type = value_type_of(format, page.bits);
  if (!type)
    file.refuse("BitsPerSample, SampleFormat",
                std::to_string(page.bits) + ", " + std::to_string(format),
                "must be unsigned (1) of 1 to 16, 32 or 64 bits, signed (2) of 8, 16, 32 or 64, or "
                "float (3) of 32 or 64");
  page.type = *type;
  page.is_white_zero = meaning == PHOTOMETRIC_MINISWHITE;
  if (page.is_white_zero && format != SAMPLEFORMAT_UINT && format != SAMPLEFORMAT_VOID)
    file.refuse("PhotometricInterpretation",
                "0 (WhiteIsZero)",
                "must be 1 for signed and float values, which have no lowest or highest grey");
  page.orientation = file.code(TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  if (const int compression = file.code(TIFFTAG_COMPRESSION, COMPRESSION_NONE);
      TIFFIsCODECConfigured(static_cast<std::uint16_t>(compression)) == 0)
    file.refuse("Compression", std::to_string(compression), "is not known to libtiff");
  return page;
}

/// A rectangle of a page as it is decoded: a strip or a tile, whose rows are padded to whole bytes.
struct Block {
  std::size_t column = 0;
  std::size_t row = 0;
  std::size_t columns = 0;  ///< how many belong to the page
  std::size_t rows = 0;
  std::size_t row_bytes = 0;
  std::vector<unsigned char> bytes;
};

/// The value at a column of a row of packed values, highest bit first.
std::uint16_t packed_value(const unsigned char* row, std::size_t column, int bits) {
  std::uint32_t value = 0;
  for (std::size_t bit = column * static_cast<std::size_t>(bits),
                   left = static_cast<std::size_t>(bits);
       left > 0;
       ++bit, --left)
    value = value << 1 | (static_cast<std::uint32_t>(row[bit / 8]) >> (7 - bit % 8) & 1u);
  return static_cast<std::uint16_t>(value);
}

void store(const Page& page, const Block& block, std::byte* values) {
  const std::size_t size = value_bytes(page.type);
  const auto mask = static_cast<std::uint16_t>((1u << (page.bits % 32)) - 1u);
  for (std::size_t row = 0; row < block.rows; ++row) {
    const unsigned char* const stored = block.bytes.data() + row * block.row_bytes;
    for (std::size_t column = 0; column < block.columns; ++column) {
      std::byte* const to = values + page.place(block.column + column, block.row + row) * size;
      if (page.is_packed()) {
        const std::uint16_t value = packed_value(stored, column, page.bits);
        const auto turned = static_cast<std::uint16_t>(page.is_white_zero ? mask - value : value);
        const auto narrow = static_cast<std::uint8_t>(turned);
        std::memcpy(to, size == 1 ? static_cast<const void*>(&narrow) : &turned, size);
        continue;
      }
      std::memcpy(to, stored + column * size, size);
      if (page.is_white_zero)
        for (std::size_t byte = 0; byte < size; ++byte) to[byte] = ~to[byte];
    }
  }
}

std::size_t checked_block_bytes(const TiffFile& file, tmsize_t bytes) {
  if (bytes <= 0 || bytes > kMostBlockBytes) file.fail("a strip or tile is empty or too large");
  return static_cast<std::size_t>(bytes);
}

/// Strips are as wide as the page, and the last one is shorter. Tiles are whole.
void read_blocks(const TiffFile& file, const Page& page, std::byte* values) {
  TIFF* const tiff = file.get();
  const bool is_tiled = TIFFIsTiled(tiff) != 0;
  const std::size_t width = is_tiled ? file.number(TIFFTAG_TILEWIDTH) : page.columns;
  Block block;
  block.row_bytes =
      checked_block_bytes(file, is_tiled ? TIFFTileRowSize(tiff) : TIFFScanlineSize(tiff));
  block.bytes.resize(
      checked_block_bytes(file, is_tiled ? TIFFTileSize(tiff) : TIFFStripSize(tiff)));
  const std::size_t height = block.bytes.size() / block.row_bytes;
  if (width == 0 || height == 0) file.fail("a strip is shorter than a row, or a tile has no size");
  std::uint32_t number = 0;
  for (block.row = 0; block.row < page.rows; block.row += height)
    for (block.column = 0; block.column < page.columns; block.column += width, ++number) {
      block.rows = std::min(height, page.rows - block.row);
      block.columns = std::min(width, page.columns - block.column);
      const auto wanted = static_cast<tmsize_t>((is_tiled ? height : block.rows) * block.row_bytes);
      const auto read = is_tiled ? &TIFFReadEncodedTile : &TIFFReadEncodedStrip;
      if (read(tiff, number, block.bytes.data(), wanted) != wanted)
        file.fail((is_tiled ? "tile " : "strip ") + std::to_string(number) + " is not whole");
      store(page, block, values);
    }
}

/// The pages that are images in their own right, by number of directory.
std::vector<std::uint32_t> image_pages(const TiffFile& file) {
  constexpr std::uint32_t kThumbnailOrMask = FILETYPE_REDUCEDIMAGE | FILETYPE_MASK;
  std::vector<std::uint32_t> pages;
  std::uint32_t directory = 0;
  do {
    if ((file.number(TIFFTAG_SUBFILETYPE) & kThumbnailOrMask) == 0) pages.push_back(directory);
    if (pages.size() > kMostPages) file.refuse("pages", "more than 100000", "are too many");
    ++directory;
  } while (TIFFReadDirectory(file.get()) == 1);
  if (pages.empty()) file.fail("it holds thumbnails or masks only");
  return pages;
}

Page turn_to(const TiffFile& file, std::uint32_t directory) {
  if (TIFFSetDirectory(file.get(), static_cast<tdir_t>(directory)) != 1)
    file.fail("page " + std::to_string(directory) + " cannot be read");
  return page_of(file);
}

}  // namespace

RawImage read_tiff(const fs::path& path, const AcceptImage& accept) {
  const TiffFile file(path);
  const std::vector<std::uint32_t> pages = image_pages(file);
  const Page first = turn_to(file, pages.front());
  RawImage image;
  image.size = {first.width(), first.height()};
  if (pages.size() > 1) image.size.push_back(pages.size());
  image.spacing_mm.assign(image.size.size(), 1.0);
  image.type = first.type;
  if (first.is_white_zero) image.note = "WhiteIsZero turned round";
  accept(image);
  const std::size_t page_bytes = first.columns * first.rows * value_bytes(first.type);
  image.values.resize(page_bytes * pages.size());
  for (std::size_t i = 0; i < pages.size(); ++i) {
    const Page page = turn_to(file, pages[i]);
    if (page.width() != first.width() || page.height() != first.height() || page.type != first.type)
      file.refuse("page", std::to_string(i + 1), "must have the size and the numbers of the first");
    read_blocks(file, page, image.values.data() + i * page_bytes);
  }
  return image;
}

}  // namespace af::image_formats
