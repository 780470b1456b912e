// SPDX-License-Identifier: Apache-2.0
#include <bit>
#include <fstream>
#include <new>
#include <png.h>
#include <string>

#include "base/error.h"
#include "files/input_file.h"
#include "images/image_formats.h"

namespace af::image_formats {

namespace fs = std::filesystem;

namespace {

/// An open file. Its library's complaints become exceptions, which the library permits instead of
/// its long jumps.
class PngFile {
 public:
  explicit PngFile(const fs::path& path)
      : path_(path.string()),
        file_(open_input_file(path)),
        png_(png_create_read_struct(
            PNG_LIBPNG_VER_STRING, this, &fail, [](png_structp, png_const_charp) {})),
        info_(png_ != nullptr ? png_create_info_struct(png_) : nullptr) {
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, nullptr, nullptr);
      throw std::bad_alloc();
    }
    png_set_read_fn(png_, &file_, &read);
  }
  ~PngFile() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngFile(const PngFile&) = delete;
  PngFile& operator=(const PngFile&) = delete;

  [[nodiscard]] png_structp png() const { return png_; }
  [[nodiscard]] png_infop info() const { return info_; }

 private:
  [[noreturn]] static void fail(png_structp png, png_const_charp complaint) {
    throw FileError(static_cast<PngFile*>(png_get_error_ptr(png))->path_,
                    std::string("not a readable PNG image, or truncated: ") + complaint);
  }

  static void read(png_structp png, png_bytep bytes, std::size_t count) {
    auto& file = *static_cast<std::ifstream*>(png_get_io_ptr(png));
    if (!file.read(reinterpret_cast<char*>(bytes), static_cast<std::streamsize>(count)))
      png_error(png, "the file ends within a chunk");
  }

  std::string path_;
  std::ifstream file_;
  png_structp png_;
  png_infop info_;
};

}  // namespace

RawImage read_png(const fs::path& path, const AcceptImage& accept) {
  const PngFile file(path);
  const png_structp png = file.png();
  png_read_info(png, file.info());
  if (const int color = png_get_color_type(png, file.info()); color != PNG_COLOR_TYPE_GRAY)
    throw InputError(
        "PNG colour type", std::to_string(color), "must be 0, plain grey", path.string());
  RawImage image;
  image.size = {png_get_image_width(png, file.info()), png_get_image_height(png, file.info())};
  image.spacing_mm = {1.0, 1.0};
  image.type = png_get_bit_depth(png, file.info()) > 8 ? ValueType::UInt16 : ValueType::UInt8;
  accept(image);
  png_set_packing(png);  // of 1, 2 and 4 bits
  if (std::endian::native == std::endian::little) png_set_swap(png);
  image.values.resize(image.voxel_count() * value_bytes(image.type));
  std::vector<png_bytep> rows;
  for (std::size_t row = 0; row < image.size[1]; ++row)
    rows.push_back(reinterpret_cast<png_bytep>(image.values.data()) +
                   row * image.size[0] * value_bytes(image.type));
  png_read_image(png, rows.data());
  png_read_end(png, nullptr);
  return image;
}

}  // namespace af::image_formats
