// SPDX-License-Identifier: Apache-2.0
#include "xray/image_file.h"

#include <cmath>
#include <fstream>
#include <map>
#include <zlib.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "ct/ct_reader.h"
#include "support/file_size_limit.h"
#include "support/io_checks.h"
#include "support/test_paths.h"
#include "unit/ct/ct_test_data.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using test::FileSizeLimit;
using test::ScratchFolder;
using testing::HasSubstr;

/// Values that no integer type and no decimal of few digits can hold.
Image2d uneven_image() {
  Image2d image(5, 3);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = std::sqrt(static_cast<float>(i)) * (i % 2 == 0 ? 1.0f : -1e-3f);
  return image;
}

std::string read_bytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class FloatImageFormats : public testing::TestWithParam<const char*> {};

TEST_P(FloatImageFormats, KeepEveryBitAndTheOrderOfRows) {
  const ScratchFolder folder;
  const Image2d image = uneven_image();
  write_image(image, folder / GetParam(), 0.4, 0.5);
  const Image2d found = read_image(folder / GetParam());
  EXPECT_EQ(found.width, 5);
  EXPECT_EQ(found.height, 3);
  EXPECT_EQ(found.pixels, image.pixels);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1) << "leftovers";
}

TEST_P(FloatImageFormats, GiveTheSameBytesWhenWrittenTwice) {
  const ScratchFolder folder;
  fs::create_directory(folder / "again");
  write_image(uneven_image(), folder / GetParam(), 0.4, 0.5);
  write_image(uneven_image(), folder / "again" / GetParam(), 0.4, 0.5);
  EXPECT_EQ(read_bytes(folder / GetParam()), read_bytes(folder / "again" / GetParam()));
}

/// Writes under limits of the file size from nothing to what is needed, as on disks with less and
/// less room.
template <typename Write>
void expect_whole_or_nothing(const std::string& name, const Write& write) {
  const ScratchFolder folder;
  write(folder / name);
  const std::string whole = read_bytes(folder / name);
  fs::remove(folder / name);
  for (std::size_t limit = 0; limit < whole.size(); limit += 1 + whole.size() / 37) {
    const FileSizeLimit full_disk(limit);
    EXPECT_THROW(write(folder / name), FileError) << name << ' ' << limit;
    EXPECT_TRUE(fs::is_empty(folder.path())) << name << ' ' << limit;
  }
  {
    const FileSizeLimit full_disk(whole.size() - 1);
    EXPECT_THROW(write(folder / name), FileError) << name;
  }
  const FileSizeLimit just_enough(whole.size());
  write(folder / name);
  EXPECT_EQ(read_bytes(folder / name), whole);
}

/// Compresses little, and is larger than the buffers of libraries.
Image2d noisy_image() {
  Image2d image(170, 130);
  HashRandom random(1);
  for (float& pixel : image.pixels) pixel = static_cast<float>(65535.0 * random.uniform());
  return image;
}

TEST_P(FloatImageFormats, AreWrittenWholeOrNotAtAll) {
  expect_whole_or_nothing(GetParam(), [](const fs::path& path) {
    write_image_stack({noisy_image(), noisy_image()}, path, 0.4, 0.5);
  });
}

TEST(PictureFiles, AreWrittenWholeOrNotAtAll) {
  expect_whole_or_nothing(
      "a.png", [](const fs::path& path) { write_png_image(noisy_image(), path, 0.0, 65535.0); });
  expect_whole_or_nothing(
      "b.png", [](const fs::path& path) { write_image_u16(noisy_image(), path, 0.4, 0.5); });
}

TEST_P(FloatImageFormats, HoldStacksThatAreNoSingleImage) {
  const ScratchFolder folder;
  write_image_stack({uneven_image(), uneven_image()}, folder / GetParam(), 0.4, 0.5);
  EXPECT_THROW((void)read_image(folder / GetParam()), InputError);
}

TEST_P(FloatImageFormats, ThatAreCutShortAreRefused) {
  const ScratchFolder folder;
  Image2d image(64, 64);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = std::sin(static_cast<float>(i));
  const fs::path path = folder / GetParam();
  for (const double share : {0.95, 0.5, 0.05, 0.0}) {
    SCOPED_TRACE(share);
    write_image(image, path, 0.4, 0.5);
    fs::resize_file(path,
                    static_cast<std::uintmax_t>(share * static_cast<double>(fs::file_size(path))));
    testing::internal::CaptureStderr();
    EXPECT_THROW((void)read_image(path), FileError);
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    fs::remove(path);  // changed and read, it is an input
  }
}

INSTANTIATE_TEST_SUITE_P(Formats,
                         FloatImageFormats,
                         testing::Values("drr.mha", "drr.nii.gz", "drr.nrrd", "drr.tif"));

TEST(ImageFile, StackIsAVolumeWithTheImagesAsSlices) {
  const ScratchFolder folder;
  // A stack of plausible HU can be read as a CT, which shows its layout.
  std::vector<Image2d> images(3, Image2d(2, 2));
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t i = 0; i < 4; ++i)
      images[k].pixels[i] = static_cast<float>(10 * k + i) - 1000.0f * static_cast<float>(i % 2);
  write_image_stack(images, folder / "stack.mha", 0.5, 0.75);
  const CtVolume volume = read_ct(folder / "stack.mha");
  EXPECT_EQ(volume.grid.size, (std::array<int, 3>{2, 2, 3}));
  EXPECT_EQ(volume.grid.spacing_mm, Eigen::Vector3d(0.5, 0.75, 1.0));
  EXPECT_EQ(volume.hu[2 * 4 + 3], 23 - 1000);
}

TEST(ImageFile, ReadsAStackImageByImage) {
  const ScratchFolder folder;
  std::vector<Image2d> images(2, uneven_image());
  images[1].pixels[7] = 41.0f;
  write_image_stack(images, folder / "stack.nrrd", 0.5, 0.75);
  std::vector<Image2d> read;
  for_each_image_of_stack(folder / "stack.nrrd", [&](int number, Image2d&& image) {
    EXPECT_EQ(number, static_cast<int>(read.size()));
    read.push_back(std::move(image));
  });
  ASSERT_EQ(read.size(), images.size());
  for (std::size_t k = 0; k < images.size(); ++k) EXPECT_EQ(read[k].pixels, images[k].pixels);
}

TEST(ImageFile, RefusesAStackThatIsNone) {
  const ScratchFolder folder;
  const auto read = [](const auto& path) { for_each_image_of_stack(path, [](int, Image2d&&) {}); };
  write_image(uneven_image(), folder / "one.mha", 0.5, 0.5);
  EXPECT_THROW(read(folder / "one.mha"), InputError);
  write_png_image(uneven_image(), folder / "one.png", 0.0, 1.0);
  EXPECT_THROW(read(folder / "one.png"), InputError);
  write_image_stack({uneven_image(), uneven_image()}, folder / "cut.mha", 0.5, 0.5);
  fs::resize_file(folder / "cut.mha", fs::file_size(folder / "cut.mha") - 4);
  EXPECT_THROW(read(folder / "cut.mha"), FileError);
}

TEST(ImageFile, KeepsSixteenBitLevels) {
  const ScratchFolder folder;
  Image2d image(2, 2);
  image.pixels = {0.0f, 4095.0f, 65535.0f, 1234.4f};
  for (const char* name : {"xray.mha", "xray.png"}) {
    SCOPED_TRACE(name);
    write_image_u16(image, folder / name, 0.4, 0.4);
    EXPECT_THAT(read_image(folder / name).pixels,
                testing::ElementsAre(0.0f, 4095.0f, 65535.0f, 1234.0f));
  }
}

TEST(ImageFile, PictureMapsTheWindowToBlackAndWhite) {
  const ScratchFolder folder;
  Image2d image(3, 2);
  image.pixels = {-1.0f, 1.0f, 2.0f, 3.0f, 5.0f, std::nanf("")};
  write_png_image(image, folder / "picture.png", 1.0, 3.0);
  EXPECT_THAT(read_image(folder / "picture.png").pixels,
              testing::ElementsAre(0.0f, 0.0f, 128.0f, 255.0f, 255.0f, 0.0f));
}

/// A TIFF file of one page, written byte by byte, little endian.
class TiffTestFile {
 public:
  /// Tag 262, PhotometricInterpretation, is 1 (black is 0) until it is set.
  TiffTestFile(std::uint32_t columns, std::uint32_t rows, std::uint32_t bits, std::string pixels)
      : pixels_(std::move(pixels)) {
    tags_ = {{256, columns},
             {257, rows},
             {258, bits},
             {259, 1},
             {262, 1},
             {273, 8},
             {277, 1},
             {278, rows},
             {279, static_cast<std::uint32_t>(pixels_.size())}};
  }
  TiffTestFile& set(std::uint32_t tag, std::uint32_t value) {
    tags_[tag] = value;
    return *this;
  }
  /// Tiles of one size, one behind the other.
  TiffTestFile& set_tiles(std::uint32_t columns, std::uint32_t rows, std::uint32_t count) {
    for (const std::uint32_t tag : {273u, 278u, 279u}) tags_.erase(tag);
    tags_[322] = columns;
    tags_[323] = rows;
    tile_count_ = count;
    return *this;
  }
  [[nodiscard]] std::string bytes() const {
    const auto size = static_cast<std::uint32_t>(pixels_.size());
    std::map<std::uint32_t, std::uint32_t> tags = tags_;
    std::string tables;
    const std::uint32_t tables_at = 8 + size;
    if (tile_count_ > 0) {
      for (std::uint32_t tile = 0; tile < tile_count_; ++tile)
        tables += number(8 + tile * size / tile_count_, 4);
      for (std::uint32_t tile = 0; tile < tile_count_; ++tile)
        tables += number(size / tile_count_, 4);
      tags[324] = tables_at;
      tags[325] = tables_at + 4 * tile_count_;
    }
    std::string file = "II*" + std::string(1, '\0') + number(tables_at + tables.size(), 4) +
                       pixels_ + tables + number(tags.size(), 2);
    for (const auto& [tag, value] : tags) {
      // A colour map is 3 x 256 numbers of two bytes; here they are anything.
      const bool is_map = tag == 320;
      const std::uint32_t count = tag == 324 || tag == 325 ? tile_count_ : is_map ? 768 : 1;
      file += number(tag, 2) + number(is_map ? 3 : 4, 2) + number(count, 4) + number(value, 4);
    }
    return file + number(0, 4);
  }

 private:
  static std::string number(std::uint64_t value, int count) {
    std::string bytes;
    for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xff);
    return bytes;
  }
  std::map<std::uint32_t, std::uint32_t> tags_;
  std::string pixels_;
  std::uint32_t tile_count_ = 0;
};

template <typename T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

class TiffImage : public testing::Test {
 protected:
  std::vector<float> pixels(const TiffTestFile& file) {
    test::write_input(folder_ / "image.tif", file.bytes());
    return read_image(folder_ / "image.tif").pixels;
  }
  std::string note(const TiffTestFile& file) {
    test::write_input(folder_ / "image.tif", file.bytes());
    return read_image_with_spacing(folder_ / "image.tif").note;
  }
  std::string refusal(const TiffTestFile& file) {
    return test::message_of<InputError>([&] { (void)pixels(file); });
  }
  template <typename T>
  void expect_kept(const std::vector<T>& values, std::uint32_t format) {
    const std::vector<float> expected(values.begin(), values.end());
    const TiffTestFile file(3, 2, 8 * sizeof(T), bytes_of(values));
    EXPECT_EQ(pixels(TiffTestFile(file).set(339, format)), expected)
        << 8 * sizeof(T) << " bits, format " << format;
  }

 private:
  ScratchFolder folder_;
};

TEST_F(TiffImage, KeepsEveryTypeOfNumber) {
  expect_kept<std::uint8_t>({0, 1, 2, 127, 128, 255}, 1);
  expect_kept<std::int8_t>({0, 1, -2, 127, -128, -1}, 2);
  expect_kept<std::uint16_t>({0, 1, 2, 32767, 32768, 65535}, 1);
  expect_kept<std::int16_t>({0, 1, -2, 32767, -32768, -1}, 2);
  expect_kept<std::uint32_t>({0, 1, 15000, 65536, 3000000000, 4294967295}, 1);
  expect_kept<std::int32_t>({0, 1, -15000, 65536, 2000000000, -2147483647}, 2);
  expect_kept<std::uint64_t>({0, 1, 15000, 65536, 3000000000, 1ULL << 40}, 1);
  expect_kept<std::int64_t>({0, 1, -15000, 65536, -3000000000, 1LL << 40}, 2);
  expect_kept<float>({0.0f, 1.5f, -2.25f, 1e20f, 1e-20f, 3.0f}, 3);
  expect_kept<double>({0.0, 1.5, -2.25, 1e20, 1e-20, 3.0}, 3);
}

TEST_F(TiffImage, UnpacksValuesOfAnyNumberOfBits) {
  // 3 x 2 of 12 bits, each row padded to whole bytes: 0x123 0x456 0x789, 0xabc 0xdef 0x001.
  EXPECT_THAT(
      pixels(TiffTestFile(3, 2, 12, "\x12\x34\x56\x78\x90\xab\xcd\xef" + std::string("\0\x10", 2))),
      testing::ElementsAre(0x123, 0x456, 0x789, 0xabc, 0xdef, 1));
  EXPECT_THAT(pixels(TiffTestFile(3, 2, 1, "\xa0\x40")), testing::ElementsAre(1, 0, 1, 0, 1, 0));
  EXPECT_THAT(pixels(TiffTestFile(3, 2, 4, "\x1f\x20\x34\x50")),
              testing::ElementsAre(1, 15, 2, 3, 4, 5));
}

TEST_F(TiffImage, StandsUprightAsItsOrientationTagSays) {
  // Stored: 1 2 3 / 4 5 6. Where row 0 and column 0 are in the picture: TIFF 6.0, page 36.
  const std::vector<std::vector<float>> upright = {{1, 2, 3, 4, 5, 6},
                                                   {3, 2, 1, 6, 5, 4},
                                                   {6, 5, 4, 3, 2, 1},
                                                   {4, 5, 6, 1, 2, 3},
                                                   {1, 4, 2, 5, 3, 6},
                                                   {4, 1, 5, 2, 6, 3},
                                                   {6, 3, 5, 2, 4, 1},
                                                   {3, 6, 2, 5, 1, 4}};
  for (std::uint32_t tag = 1; tag <= 8; ++tag) {
    const ScratchFolder folder;
    test::write_input(
        folder / "image.tif",
        TiffTestFile(3, 2, 16, bytes_of<std::uint16_t>({1, 2, 3, 4, 5, 6})).set(274, tag).bytes());
    const Image2d image = read_image(folder / "image.tif");
    EXPECT_EQ(image.width, tag < 5 ? 3 : 2) << tag;
    EXPECT_EQ(image.pixels, upright[tag - 1]) << tag;
  }
}

TEST_F(TiffImage, TurnsGreysRoundWhoseZeroIsWhite) {
  EXPECT_THAT(pixels(TiffTestFile(3, 2, 8, std::string("\0\1\2\3\4\xff", 6)).set(262, 0)),
              testing::ElementsAre(255, 254, 253, 252, 251, 0));
  EXPECT_THAT(pixels(TiffTestFile(2, 1, 16, bytes_of<std::uint16_t>({0, 1000})).set(262, 0)),
              testing::ElementsAre(65535, 64535));
  EXPECT_THAT(pixels(TiffTestFile(2, 1, 4, "\x1f").set(262, 0)), testing::ElementsAre(14, 0));
  EXPECT_EQ(note(TiffTestFile(2, 1, 8, "12").set(262, 0)), "WhiteIsZero turned round");
  EXPECT_EQ(note(TiffTestFile(2, 1, 8, "12")), "");
  EXPECT_THAT(refusal(TiffTestFile(2, 1, 32, bytes_of<float>({0, 1})).set(262, 0).set(339, 3)),
              HasSubstr("WhiteIsZero"));
}

TEST_F(TiffImage, MayBeTiled) {
  // 20 x 17 in four tiles of 16 x 16; what lies beyond the picture is anything.
  std::string tiles;
  std::vector<float> expected(20 * 17);
  for (int tile = 0; tile < 4; ++tile)
    for (int at = 0; at < 256; ++at) {
      const int column = 16 * (tile % 2) + at % 16;
      const int row = 16 * (tile / 2) + at / 16;
      const int value = (7 * column + 11 * row) % 256;
      tiles += static_cast<char>(value);
      if (column < 20 && row < 17)
        expected[static_cast<std::size_t>(20 * row + column)] = static_cast<float>(value);
    }
  EXPECT_EQ(pixels(TiffTestFile(20, 17, 8, tiles).set_tiles(16, 16, 4)), expected);
}

TEST_F(TiffImage, OfAnotherKindIsRefusedByName) {
  const TiffTestFile grey(3, 2, 8, std::string(1536, '6'));
  EXPECT_THAT(refusal(TiffTestFile(grey).set(262, 3).set(320, 8)), HasSubstr("(palette)"));
  EXPECT_THAT(refusal(TiffTestFile(grey).set(262, 2)), HasSubstr("PhotometricInterpretation = 2"));
  EXPECT_THAT(refusal(TiffTestFile(1, 2, 8, "123456").set(277, 3)),
              HasSubstr("SamplesPerPixel = 3"));
  EXPECT_THAT(refusal(TiffTestFile(3, 2, 16, "123456123456").set(339, 3)),
              HasSubstr("BitsPerSample, SampleFormat = 16, 3"));
  EXPECT_THAT(refusal(TiffTestFile(grey).set(259, 34999)), HasSubstr("Compression = 34999"));
  EXPECT_THROW((void)pixels(TiffTestFile(3, 200, 8, "123456")), FileError);
}

TEST_F(TiffImage, DamagedCopiesAreReadOrRefused) {
  const std::string tiled =
      TiffTestFile(20, 17, 8, std::string(1024, '6')).set_tiles(16, 16, 4).bytes();
  const std::string packed = TiffTestFile(3, 2, 12, "1234567890").set(274, 6).bytes();
  const ScratchFolder folder;
  testing::internal::CaptureStderr();
  for (const std::string& good : {tiled, packed})
    EXPECT_GT(test::refused_damaged_copies(good,
                                           7,
                                           300,
                                           [&](const std::string& bytes) {
                                             test::write_input(folder / "image.tif", bytes);
                                             (void)read_image(folder / "image.tif");
                                           }),
              good.size() / 8);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

/// A type of four letters and data, with their length and checksum.
std::string png_chunk(const std::string& typed) {
  const auto crc =
      crc32(0, reinterpret_cast<const Bytef*>(typed.data()), static_cast<uInt>(typed.size()));
  std::string bytes = std::string(3, '\0') + static_cast<char>(typed.size() - 4) + typed;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(crc >> shift & 0xff);
  return bytes;
}

TEST(ImageFile, APngHoldsItsStoredValuesWhateverElseItSaysOfThem) {
  const ScratchFolder folder;
  Image2d image(2, 2);
  image.pixels = {0.0f, 4095.0f, 65535.0f, 1234.0f};
  write_image_u16(image, folder / "xray.png", 0.4, 0.4);
  const std::string plain = read_bytes(folder / "xray.png");
  using namespace std::string_literals;
  constexpr std::size_t kBehindHeader = 33;
  for (const std::string& said : {"sBIT\x0c"s, "tRNS\x0f\xff"s, "gAMA\0\0\xb1\x8f"s}) {
    SCOPED_TRACE(said.substr(0, 4));
    std::string bytes = plain;
    test::write_input(folder / "xray.png", bytes.insert(kBehindHeader, png_chunk(said)));
    EXPECT_EQ(read_image(folder / "xray.png").pixels, image.pixels);
  }
}

// 3 x 2 pixels 1 2 3 / 0 1 2 in two bits, which a library may stretch to 0 ... 255.
TEST(ImageFile, APngOfAFewBitsHoldsItsStoredValues) {
  const ScratchFolder folder;
  using namespace std::string_literals;
  const std::string rows = "\0\x6c\0\x18"s;  // each behind its filter's number
  std::string packed(compressBound(rows.size()), '\0');
  uLongf size = packed.size();
  compress(reinterpret_cast<Bytef*>(packed.data()),
           &size,
           reinterpret_cast<const Bytef*>(rows.data()),
           rows.size());
  packed.resize(size);
  test::write_input(folder / "xray.png",
                    "\x89PNG\r\n\x1a\n" + png_chunk("IHDR\0\0\0\3\0\0\0\2\2\0\0\0\0"s) +
                        png_chunk("IDAT" + packed) + png_chunk("IEND"));
  EXPECT_THAT(read_image(folder / "xray.png").pixels, testing::ElementsAre(1, 2, 3, 0, 1, 2));
}

TEST(ImageFile, ADicomFileMayBeginAsATiffDoes) {
  const ScratchFolder folder;
  test::xa_file(3, 2, 1, {1, 2, 3, 4, 5, 6}).write(folder / "xray.dcm");
  std::string bytes = read_bytes(folder / "xray.dcm");
  test::write_input(folder / "xray.dcm", bytes.replace(0, 4, std::string("II*\0", 4)));
  EXPECT_THAT(read_image(folder / "xray.dcm").pixels, testing::ElementsAre(1, 2, 3, 4, 5, 6));
}

TEST(ImageFile, PaddingOfDicomIsNoValueOfAPicture) {
  const ScratchFolder folder;
  test::DicomTestFile file = test::xa_file(3, 2, 1, {1, 2, 3, 4, 5, 4095});
  file.set_u16({0x0028, 0x0120}, 4095);
  file.write(folder / "xray.dcm");
  EXPECT_THAT(test::message_of<InputError>([&] { (void)read_image(folder / "xray.dcm"); }),
              HasSubstr("PixelPaddingValue 4095 = 1 pixels"));
}

TEST(ImageFile, ReadsOneDicomSlice) {
  const ScratchFolder folder;
  const CtVolume ct = test::asymmetric_ct(test::small_grid());
  test::write_dicom_series(ct, folder / "dicom");
  // Slice 1 (of 0 ... 4) has the scrambled name 3 * 2.
  const Image2d image = read_image(folder / "dicom/IM6.dcm");
  EXPECT_EQ(image.width, 7);
  EXPECT_EQ(image.height, 6);
  EXPECT_EQ(image.at(4, 3), static_cast<float>(ct.hu[42 + 3 * 7 + 4]));
}

TEST(ImageFile, RefusesUnknownContentMissingFilesAndWrongExtensions) {
  const ScratchFolder folder;
  std::ofstream(folder / "text.png") << "this is no picture";
  EXPECT_THROW((void)read_image(folder / "text.png"), FileError);
  EXPECT_THROW((void)read_image(folder / "none.png"), FileError);
  EXPECT_THROW((void)read_image(folder.path()), FileError);
  EXPECT_THROW(write_image(uneven_image(), folder / "drr.png", 1, 1), UsageError);
  EXPECT_THROW(write_image(uneven_image(), folder / "drr.jpg", 1, 1), UsageError);
  EXPECT_THROW(write_image(uneven_image(), folder / "none/drr.mha", 1, 1), FileError);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(ImageFile, RefusesAPngThatIsCutCorruptOrHuge) {
  const ScratchFolder folder;
  Image2d image(64, 64);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<float>((i * 2654435761u >> 8) % 65536);
  const fs::path path = folder / "xray.png";
  write_image_u16(image, path, 0.4, 0.4);
  const std::string good = read_bytes(path);
  std::string corrupt = good;
  corrupt[good.size() / 2] = static_cast<char>(~corrupt[good.size() / 2]);
  std::string huge = good;
  huge.replace(16, 8, std::string("\x7f\xff\xff\xff\x7f\xff\xff\xff", 8));  // width, height
  for (const std::string& bytes :
       {good.substr(0, good.size() / 2), good.substr(0, 20), corrupt, huge}) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
    testing::internal::CaptureStderr();
    EXPECT_THROW((void)read_image(path), Error);
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  }
}

}  // namespace
}  // namespace af
