// SPDX-License-Identifier: Apache-2.0
#include "image_files/image_file.h"

#include <cmath>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "image_files/ct_reader.h"
#include "support/file_size_limit.h"
#include "support/test_paths.h"
#include "unit/image_files/ct_test_data.h"

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

/// Writes with all limits of file sizes from nothing to what is needed, as disks with less and less
/// room would have it.
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

/// Does not shrink much, and is larger than the buffers of libraries.
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
