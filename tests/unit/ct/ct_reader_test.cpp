// SPDX-License-Identifier: Apache-2.0
#include "ct/ct_reader.h"

#include <algorithm>
#include <array>
#include <clocale>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <iomanip>
#include <limits>
#include <span>
#include <sstream>
#include <sys/stat.h>
#include <zlib.h>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "images/stored_image.h"
#include "support/io_checks.h"
#include "support/test_paths.h"
#include "unit/ct/ct_test_data.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using test::asymmetric_ct;
using test::ScratchFolder;
using test::small_grid;
using test::write_dicom_series;
using testing::HasSubstr;

void expect_same_ct(const CtVolume& expected, const CtVolume& found) {
  EXPECT_EQ(ct_difference(identity_of(expected), identity_of(found)), "");
}

CtGrid grid_with_direction(const Eigen::Matrix3d& direction) {
  CtGrid grid = small_grid();
  grid.direction = direction;
  return grid;
}

Eigen::Matrix3d oblique_rotation() {
  return (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(-0.2, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

/// Axes stored as P, I, R: a cyclic permutation with two reversals (a proper rotation).
Eigen::Matrix3d sagittal_direction() {
  Eigen::Matrix3d direction;
  direction << 0, 0, -1, 1, 0, 0, 0, -1, 0;
  return direction;
}

class SameCtInEveryFormat : public testing::TestWithParam<Eigen::Matrix3d> {};

TEST_P(SameCtInEveryFormat, HasOneHashAndOneGeometry) {
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(grid_with_direction(GetParam()));
  for (const char* name : {"ct.mha", "ct.nii.gz", "ct.nrrd"}) {
    SCOPED_TRACE(name);
    write_ct(ct, folder / name);
    const CtVolume found = read_ct(folder / name);
    expect_same_ct(ct, found);
    EXPECT_EQ(std::vector(found.hu.view().begin(), found.hu.view().end()),
              std::vector(ct.hu.view().begin(), ct.hu.view().end()));
  }
  // DICOM has no left-handed stacks: the series holds the slices of the reversed third axis.
  CtVolume right_handed = ct;
  if (ct.grid.direction.determinant() < 0.0) {
    const std::size_t slice = static_cast<std::size_t>(ct.grid.size[0] * ct.grid.size[1]);
    std::vector<std::int16_t> hu;
    for (int k = ct.grid.size[2] - 1; k >= 0; --k)
      hu.insert(hu.end(),
                ct.hu.data() + static_cast<std::size_t>(k) * slice,
                ct.hu.data() + static_cast<std::size_t>(k + 1) * slice);
    right_handed.hu = SharedArray<std::int16_t>(std::move(hu));
    right_handed.grid.origin_mm = ct.grid.point_mm({0, 0, ct.grid.size[2] - 1.0});
    right_handed.grid.direction.col(2) *= -1.0;
  }
  write_dicom_series(right_handed, folder / "dicom");
  std::vector<std::string> warnings;
  expect_same_ct(ct, read_ct(folder / "dicom", {}, &warnings));
  EXPECT_THAT(warnings, testing::IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Directions,
                         SameCtInEveryFormat,
                         testing::Values(Eigen::Matrix3d(Eigen::Matrix3d::Identity()),
                                         Eigen::Matrix3d(Eigen::Vector3d(-1, -1, 1).asDiagonal()),
                                         Eigen::Matrix3d(Eigen::Vector3d(1, 1, -1).asDiagonal()),
                                         Eigen::Matrix3d(sagittal_direction()),
                                         Eigen::Matrix3d(oblique_rotation())));

TEST(CtContentHash, DependsOnEveryVoxelAndOnTheSizeButNotOnTheOrigin) {
  const CtVolume ct = asymmetric_ct(small_grid());
  const std::string hash = identity_of(ct).content_sha256;
  CtVolume moved = ct;
  moved.grid.origin_mm.x() += 5.0;
  EXPECT_EQ(identity_of(moved).content_sha256, hash);
  std::vector<std::int16_t> hu(ct.hu.view().begin(), ct.hu.view().end());
  hu.back() = static_cast<std::int16_t>(hu.back() + 1);
  CtVolume changed = ct;
  changed.hu = SharedArray<std::int16_t>(hu);
  EXPECT_NE(identity_of(changed).content_sha256, hash);
  CtVolume reshaped = ct;
  reshaped.grid.size = {6, 7, 5};
  EXPECT_NE(identity_of(reshaped).content_sha256, hash);
}

TEST(CtContentHash, IsTheStatedByteSequence) {
  // Two by two by two voxels 1 ... 8: size (2, 2, 2) as int32 and voxels as int16, little endian.
  CtVolume ct;
  ct.grid.size = {2, 2, 2};
  ct.hu = SharedArray<std::int16_t>({1, 2, 3, 4, 5, 6, 7, 8});
  // printf '\2\0\0\0\2\0\0\0\2\0\0\0\1\0\2\0\3\0\4\0\5\0\6\0\7\0\10\0' | sha256sum
  EXPECT_EQ(identity_of(ct).content_sha256,
            "a48f6561680845ebd9b0848d6fadbf70a617203dffca8a7150af0649e1893762");
}

void write_bytes(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

std::string read_bytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

template <typename T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

/// A MetaImage header for 4 x 3 x 2 voxels, with lines that replace or join the usual ones.
std::string meta_header(const std::map<std::string, std::string>& changes,
                        const std::string& data_file = "LOCAL") {
  std::map<std::string, std::string> lines = {{"ObjectType", "Image"},
                                              {"NDims", "3"},
                                              {"BinaryData", "True"},
                                              {"BinaryDataByteOrderMSB", "False"},
                                              {"CompressedData", "False"},
                                              {"TransformMatrix", "1 0 0 0 1 0 0 0 1"},
                                              {"Offset", "0 0 0"},
                                              {"ElementSpacing", "1 1 1"},
                                              {"DimSize", "4 3 2"},
                                              {"ElementType", "MET_SHORT"}};
  for (const auto& [key, value] : changes) lines[key] = value;
  std::string text = "ObjectType = Image\nNDims = " + lines["NDims"] + "\n";
  lines.erase("ObjectType");
  lines.erase("NDims");
  for (const auto& [key, value] : lines)
    if (!value.empty()) text += key + " = " + value + "\n";
  return text + "ElementDataFile = " + data_file + "\n";
}

std::vector<std::int16_t> small_voxels(std::size_t count = 24) {
  std::vector<std::int16_t> voxels;
  for (std::size_t i = 0; i < count; ++i)
    voxels.push_back(static_cast<std::int16_t>(i % 2 == 0 ? -1000 : static_cast<int>(i) * 10));
  return voxels;
}

TEST(CtReader, HonoursDirectionOriginAndSpacingOfAnMhdWithARawFile) {
  const ScratchFolder folder;
  write_bytes(folder / "ct.mhd",
              meta_header({{"TransformMatrix", "1 0 0 0 -1 0 0 0 1"},
                           {"Offset", "-10 20 30"},
                           {"ElementSpacing", "0.5 0.75 1.5"}},
                          "ct.raw"));
  write_bytes(folder / "ct.raw", bytes_of(small_voxels()));
  const CtVolume ct = read_ct(folder / "ct.mhd");
  EXPECT_EQ(ct.grid.size, (std::array<int, 3>{4, 3, 2}));
  EXPECT_EQ(ct.grid.direction, Eigen::Matrix3d(Eigen::Vector3d(1, -1, 1).asDiagonal()));
  EXPECT_EQ(ct.grid.point_mm({1, 2, 1}), Eigen::Vector3d(-9.5, 18.5, 31.5));
  EXPECT_EQ(ct.hu[5], 50);
}

std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(bytes.size());
  std::string stream(size, '\0');
  compress(reinterpret_cast<Bytef*>(stream.data()),
           &size,
           reinterpret_cast<const Bytef*>(bytes.data()),
           bytes.size());
  stream.resize(size);
  return stream;
}

TEST(CtReader, ReadsCompressedVoxelsOfEitherByteOrder) {
  const ScratchFolder folder;
  std::string swapped = bytes_of(small_voxels());
  for (std::size_t i = 0; i < swapped.size(); i += 2) std::swap(swapped[i], swapped[i + 1]);
  const std::string stream = deflated(swapped);
  for (const char* key : {"BinaryDataByteOrderMSB", "ElementByteOrderMSB"}) {
    SCOPED_TRACE(key);
    std::map<std::string, std::string> lines = {
        {"CompressedData", "True"},
        {"CompressedDataSize", std::to_string(stream.size())},
        {"BinaryDataByteOrderMSB", ""}};
    lines[key] = "True";
    write_bytes(folder / "ct.mha", meta_header(lines) + stream + "rest");
    std::vector<std::string> warnings;
    const CtVolume ct = read_ct(folder / "ct.mha", {}, &warnings);
    EXPECT_EQ(std::vector(ct.hu.view().begin(), ct.hu.view().end()), small_voxels());
    EXPECT_THAT(warnings, testing::Contains(HasSubstr("4 bytes behind the compressed voxels")));
  }
}

TEST(CtReader, ReadsTheRowsOfAMetaTransformAsAxisDirections) {
  const ScratchFolder folder;
  // MetaIO stores one axis direction after the other: i along P, j along S, k along L.
  write_bytes(folder / "ct.mha",
              meta_header({{"TransformMatrix", "0 1 0 0 0 1 1 0 0"}}) + bytes_of(small_voxels()));
  const CtVolume ct = read_ct(folder / "ct.mha");
  EXPECT_EQ(ct.grid.point_mm({1, 0, 0}), Eigen::Vector3d(0, 1, 0));
  EXPECT_EQ(ct.grid.point_mm({0, 0, 1}), Eigen::Vector3d(1, 0, 0));
}

TEST(CtReader, RoundsFloatHuAndClampsWhatInt16CannotHold) {
  const ScratchFolder folder;
  std::vector<float> voxels(24, -1000.0f);
  voxels[1] = 12.4f;
  voxels[2] = 12.6f;
  voxels[3] = 1e6f;
  voxels[4] = -1e6f;
  write_bytes(folder / "ct.mha", meta_header({{"ElementType", "MET_FLOAT"}}) + bytes_of(voxels));
  std::vector<std::string> warnings;
  const CtVolume ct = read_ct(folder / "ct.mha", {}, &warnings);
  EXPECT_EQ(ct.hu[1], 12);
  EXPECT_EQ(ct.hu[2], 13);
  EXPECT_EQ(ct.hu[3], 32767);
  EXPECT_EQ(ct.hu[4], -32768);
  EXPECT_THAT(warnings, testing::Contains(HasSubstr("2 voxels beyond int16 were clamped")));
}

TEST(CtReader, WarnsWhenValuesDoNotLookLikeHu) {
  const ScratchFolder folder;
  std::vector<std::int16_t> voxels = small_voxels();
  for (auto& voxel : voxels) voxel = static_cast<std::int16_t>(voxel + 1024);
  write_bytes(folder / "ct.mha", meta_header({}) + bytes_of(voxels));
  std::vector<std::string> warnings;
  (void)read_ct(folder / "ct.mha", {}, &warnings);
  EXPECT_THAT(warnings, testing::Contains(HasSubstr("do not look like HU")));
}

TEST(CtReader, AppliesDicomRescaleOfEachSlice) {
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(small_grid());
  write_dicom_series(ct, folder / "dicom", [&](int slice, test::DicomTestFile& file) {
    if (slice != 2) return;
    // The same HU stored as (HU + 2000) / 0.5.
    std::vector<std::int16_t> pixels;
    for (std::size_t i = 0; i < 42; ++i)
      pixels.push_back(static_cast<std::int16_t>((ct.hu[2 * 42 + i] + 2000) * 2));
    file.set_pixels(pixels);
    file.set_text({0x0028, 0x1052}, "DS", "-2000");
    file.set_text({0x0028, 0x1053}, "DS", "0.5");
  });
  expect_same_ct(ct, read_ct(folder / "dicom"));
}

TEST(CtReader, ChoosesOneOfSeveralSeriesAndSkipsWhatIsNoImage) {
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(small_grid());
  write_dicom_series(ct, folder / "dicom", {}, "1.2.3.4", "A");
  CtGrid other = small_grid();
  other.size[2] = 3;
  write_dicom_series(asymmetric_ct(other), folder / "dicom", {}, "1.2.3.5", "B");
  write_bytes(folder / "dicom/README", "not a picture");
  CtReadOptions options;
  options.series_uid = "1.2.3.4";
  std::vector<std::string> warnings;
  expect_same_ct(ct, read_ct(folder / "dicom", options, &warnings));
  EXPECT_THAT(warnings, testing::ElementsAre(HasSubstr("skipped, not DICOM: README")));
}

std::string position(double x, double y, double z) {
  return std::to_string(x) + "\\" + std::to_string(y) + "\\" + std::to_string(z);
}

/// The series with pixels (0, 0) to (1, 5), its first two columns, as padding of a stored value.
auto padded_series(const fs::path& folder,
                   int stored,
                   const std::function<void(test::DicomTestFile&)>& edit) {
  const CtVolume ct = asymmetric_ct(small_grid());
  std::vector<std::int16_t> hu(ct.hu.view().begin(), ct.hu.view().end());
  for (std::size_t i = 0; i < hu.size(); ++i)
    if (i % 7 < 2) hu[i] = -1000;
  write_dicom_series(ct, folder, [&](int slice, test::DicomTestFile& file) {
    std::vector<std::int16_t> pixels;
    for (std::size_t i = 0; i < 42; ++i)
      pixels.push_back(static_cast<std::int16_t>(
          i % 7 < 2 ? stored : hu[static_cast<std::size_t>(slice) * 42 + i] + 1024));
    file.set_pixels(pixels);
    edit(file);
  });
  CtVolume expected = ct;
  expected.hu = SharedArray<std::int16_t>(std::move(hu));
  return expected;
}

constexpr test::DicomTestFile::Tag kPaddingTag = {0x0028, 0x0120};
constexpr test::DicomTestFile::Tag kPaddingLimitTag = {0x0028, 0x0121};

/// How a file states what its padded pixels hold.
struct Padding {
  const char* name;
  int stored;
  std::vector<std::uint16_t> value;
  const char* form;
  std::vector<std::uint16_t> limit;
  bool is_signed;
  int bits;
};

TEST(CtReader, PaddingIsAirWhateverItsValueWouldMean) {
  for (const Padding& padding : {Padding{"below all", -2000, {63536}, "SS", {}, true, 16},
                                 Padding{"US of signed pixels", -2000, {63536}, "US", {}, true, 16},
                                 Padding{"above all", 63536, {63536}, "US", {}, false, 16},
                                 Padding{"SS of unsigned", 63536, {63536}, "SS", {}, false, 16},
                                 Padding{"highest of 12 bits", 4095, {4095}, "US", {}, false, 12},
                                 Padding{"beyond 12 bits", 63536, {63536}, "US", {}, false, 12},
                                 Padding{"a range", 4001, {4000}, "US", {4095}, false, 12},
                                 Padding{"its last value", 4095, {4000}, "US", {4095}, false, 12},
                                 Padding{"its first value", 4000, {4095}, "US", {4000}, false, 12},
                                 Padding{"zero", 0, {0}, "US", {}, false, 16}}) {
    SCOPED_TRACE(padding.name);
    const ScratchFolder folder;
    const CtVolume expected =
        padded_series(folder / "ct", padding.stored, [&](test::DicomTestFile& file) {
          file.set_u16s(kPaddingTag, padding.value, padding.form);
          if (!padding.limit.empty()) file.set_u16s(kPaddingLimitTag, padding.limit, padding.form);
          file.set_u16({0x0028, 0x0101}, static_cast<std::uint16_t>(padding.bits));
          file.set_u16({0x0028, 0x0102}, static_cast<std::uint16_t>(padding.bits - 1));
          file.set_u16({0x0028, 0x0103}, padding.is_signed ? 1 : 0);
        });
    std::vector<std::string> warnings;
    expect_same_ct(expected, read_ct(folder / "ct", {}, &warnings));
    // 12 padded pixels in each of 5 slices. A warning is due only where the value would not already
    // be air.
    const bool is_told = padding.stored > 0;
    EXPECT_EQ(warnings.size(), is_told ? 1U : 0U);
    EXPECT_THAT(warnings, testing::Each(HasSubstr("60 voxels of PixelPaddingValue")));
    CtReadOptions raw;
    raw.values = "raw";
    raw.raw_slope_per_mm = 1e-5;
    raw.raw_offset_per_mm = 0.02;
    EXPECT_EQ(read_ct(folder / "ct", raw).hu[0], -1000) << "whatever the voxels hold";
  }
}

TEST(CtReader, PaddingNextToTheRangeIsData) {
  const ScratchFolder folder;
  (void)padded_series(folder / "ct", 4001, [](test::DicomTestFile& file) {
    file.set_u16s(kPaddingTag, {4002});
    file.set_u16s(kPaddingLimitTag, {4095});
  });
  EXPECT_EQ(read_ct(folder / "ct").hu[0], 4001 - 1024);
}

TEST(CtReader, PaddingMayDifferFromSliceToSlice) {
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(small_grid());
  write_dicom_series(ct, folder / "ct", [&](int slice, test::DicomTestFile& file) {
    std::vector<std::int16_t> pixels;
    for (std::size_t i = 0; i < 42; ++i)
      pixels.push_back(static_cast<std::int16_t>(
          i == 0 ? 5000 + slice : ct.hu[static_cast<std::size_t>(slice) * 42 + i] + 1024));
    file.set_pixels(pixels);
    if (slice != 2) file.set_u16(kPaddingTag, static_cast<std::uint16_t>(5000 + slice));
  });
  const CtVolume found = read_ct(folder / "ct");
  for (std::size_t slice = 0; slice < 5; ++slice)
    EXPECT_EQ(found.hu[slice * 42], slice == 2 ? 5002 - 1024 : -1000);
}

TEST(CtReader, AValueAmidTheOthersIsPaddingOnlyAtTheSlicesEdge) {
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(small_grid());
  // 0 HU, which soft tissue holds as well: pixels (0, 0), at the edge, and (3, 3), within.
  write_dicom_series(ct, folder / "ct", [&](int slice, test::DicomTestFile& file) {
    std::vector<std::int16_t> pixels;
    for (std::size_t i = 0; i < 42; ++i)
      pixels.push_back(static_cast<std::int16_t>(
          i == 0 || i == 3 * 7 + 3 ? 1024
                                   : ct.hu[static_cast<std::size_t>(slice) * 42 + i] + 1024));
    file.set_pixels(pixels);
    file.set_u16(kPaddingTag, 1024);
  });
  std::vector<std::string> warnings;
  const CtVolume found = read_ct(folder / "ct", {}, &warnings);
  EXPECT_EQ(found.hu[0], -1000);
  EXPECT_EQ(found.hu[3 * 7 + 3], 0);
  EXPECT_THAT(warnings,
              testing::ElementsAre(HasSubstr("5 voxels of PixelPaddingValue 1024 are padding"),
                                   HasSubstr("5 voxels of PixelPaddingValue 1024 away from")));
}

TEST(CtReader, GreysThatAreShownInvertedAreTheSameHu) {
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(small_grid());
  write_dicom_series(ct, folder / "ct", [](int, test::DicomTestFile& file) {
    file.set_text({0x0028, 0x0004}, "CS", "MONOCHROME1");
  });
  std::vector<std::string> warnings;
  expect_same_ct(ct, read_ct(folder / "ct", {}, &warnings));
  EXPECT_THAT(warnings, testing::ElementsAre(HasSubstr("MONOCHROME1")));
}

/// A JPEG-LS stream (ITU-T T.87) of one blank frame: lines of runs, whose code is one bit 1 for
/// every full run of a length that grows with each (A.7.1), and one for the rest of a line.
std::string blank_jpeg_ls(int columns, int rows) {
  constexpr std::array<int, 32> kRunOrders = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2,  2,  3,  3,  3,  3,
                                              4, 4, 5, 5, 6, 6, 7, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  std::size_t ones = 0;
  std::size_t index = 0;
  for (int row = 0; row < rows; ++row) {
    int left = columns;
    while (left >= 1 << kRunOrders[index]) {
      left -= 1 << kRunOrders[index];
      ++ones;
      index = std::min<std::size_t>(index + 1, kRunOrders.size() - 1);
    }
    if (left > 0) ++ones;
  }
  const auto u16 = [](int value) {
    return std::string{static_cast<char>(value >> 8), static_cast<char>(value & 0xff)};
  };
  using namespace std::string_literals;
  std::string stream = "\xff\xd8\xff\xf7\0\x0b\x10"s + u16(rows) + u16(columns) +
                       "\x01\x01\x11\0\xff\xda\0\x08\x01\x01\0\0\0\0"s;
  // Behind a byte of 8 ones a 0 is stuffed.
  for (bool is_stuffed = false; ones > 0; is_stuffed = !is_stuffed) {
    const std::size_t room = is_stuffed ? 7 : 8;
    const std::size_t taken = std::min(room, ones);
    stream += static_cast<char>(((1u << taken) - 1u) << (room - taken));
    ones -= taken;
    if (taken < room) break;
  }
  return stream + "\xff\xd9"s;
}

TEST(CtReader, BlankSlicesMayTakeNextToNothing) {
  const ScratchFolder folder;
  CtVolume ct;
  ct.grid.size = {1024, 512, 3};
  constexpr std::size_t kSlice = std::size_t{1024} * 512;
  std::vector<std::int16_t> hu(3 * kSlice, -1000);
  std::fill(hu.begin(), hu.begin() + kSlice, std::int16_t{-1024});
  hu.back() = 500;
  ct.hu = SharedArray<std::int16_t>(std::move(hu));
  const std::string blank = blank_jpeg_ls(1024, 512);
  ASSERT_LT(blank.size(), 2 * kSlice / 1000);
  write_dicom_series(ct, folder / "ct", [&](int slice, test::DicomTestFile& file) {
    if (slice == 0) file.set_fragment("1.2.840.10008.1.2.4.80", blank);
  });
  expect_same_ct(ct, read_ct(folder / "ct"));
}

TEST(CtReader, PositionsThatWereRoundedAreThoseOfEvenSlices) {
  const ScratchFolder folder;
  CtVolume ct = asymmetric_ct(small_grid());
  ct.grid.size = {7, 6, 25};
  ct.grid.spacing_mm.z() = 0.625;
  std::vector<std::int16_t> hu(ct.grid.voxel_count(), 40);
  hu[0] = -1000;
  hu[1] = 700;
  ct.hu = SharedArray<std::int16_t>(std::move(hu));
  const auto series = [&](const std::string& name, double unit_mm, int missing) {
    write_dicom_series(ct, folder / name, [&](int slice, test::DicomTestFile& file) {
      const double z = -107.0 + 0.625 * (slice >= missing ? slice + 1 : slice);
      file.set_text(
          {0x0020, 0x0032}, "DS", position(-31.25, 12.5, std::round(z / unit_mm) * unit_mm));
    });
    return folder / name;
  };
  std::vector<std::string> warnings;
  const CtVolume found = read_ct(series("tenths", 0.1, 99), {}, &warnings);
  // Traces that arithmetic on rounded positions leaves in their last digits.
  write_dicom_series(ct, folder / "traces", [&](int slice, test::DicomTestFile& file) {
    const double z = std::round(6.25 * slice) / 10.0;
    file.set_text({0x0020, 0x0032}, "DS", position(-31.25, 12.5, z) + "0000004");
  });
  EXPECT_NO_THROW((void)read_ct(folder / "traces"));
  // Half a tenth at either end of 24 slice distances.
  EXPECT_NEAR(found.grid.spacing_mm.z(), 0.625, 0.1 / 24);
  EXPECT_THAT(warnings, testing::ElementsAre(HasSubstr("within the rounding of")));
  EXPECT_THAT(test::message_of<InputError>([&] { (void)read_ct(series("missing", 0.1, 12)); }),
              HasSubstr("a slice is missing"));
  EXPECT_THAT(test::message_of<InputError>([&] { (void)read_ct(series("halves", 0.5, 99)); }),
              HasSubstr("positions along the slice normal"));
}

TEST(CtReader, AppliesNiftiSlopeAndIntercept) {
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(small_grid());
  write_ct(ct, folder / "plain.nii.gz");
  ASSERT_EQ(std::system(("gzip -dc " + (folder / "plain.nii.gz").string() + " > " +
                         (folder / "ct.nii").string())
                            .c_str()),
            0);
  std::string bytes = read_bytes(folder / "ct.nii");
  const float slope = 0.5f;
  const float intercept = -500.0f;
  std::memcpy(bytes.data() + 112, &slope, 4);
  std::memcpy(bytes.data() + 116, &intercept, 4);
  write_bytes(folder / "ct.nii", bytes);
  const CtVolume found = read_ct(folder / "ct.nii");
  for (std::size_t i = 0; i < ct.hu.size(); ++i)
    ASSERT_EQ(found.hu[i], static_cast<int>(std::nearbyint(0.5 * ct.hu[i] - 500.0))) << i;
}

// ---- refusals ----

/// One unacceptable input: how it is made, the exit code and a part of the message.
struct BadCt {
  std::string name;
  std::function<fs::path(const fs::path& folder)> make;
  ExitCode code;
  std::string message;
};

std::ostream& operator<<(std::ostream& out, const BadCt& bad) {
  return out << bad.name;
}

/// A MetaImage with changed header lines and the voxels given.
auto meta(const std::map<std::string, std::string>& changes, std::string voxels) {
  return [=](const fs::path& folder) {
    write_bytes(folder / "bad.mha", meta_header(changes) + voxels);
    return folder / "bad.mha";
  };
}

auto meta(const std::map<std::string, std::string>& changes) {
  return meta(changes, bytes_of(small_voxels()));
}

/// The small CT in a format, cut to a share of its bytes.
auto truncated(const std::string& name, double share) {
  return [=](const fs::path& folder) {
    write_ct(asymmetric_ct(small_grid()), folder / name);
    fs::resize_file(
        folder / name,
        static_cast<std::uintmax_t>(share * static_cast<double>(fs::file_size(folder / name))));
    return folder / name;
  };
}

/// The small CT as uncompressed NIfTI with bytes of its header overwritten.
template <typename T>
auto nifti_with(std::size_t offset, std::vector<T> values) {
  return [=](const fs::path& folder) {
    write_ct(asymmetric_ct(small_grid()), folder / "plain.nii.gz");
    const std::string command =
        "gzip -dc " + (folder / "plain.nii.gz").string() + " > " + (folder / "bad.nii").string();
    if (std::system(command.c_str()) != 0) throw std::runtime_error("gzip failed");
    std::string bytes = read_bytes(folder / "bad.nii");
    bytes.replace(offset, values.size() * sizeof(T), bytes_of(values));
    write_bytes(folder / "bad.nii", bytes);
    return folder / "bad.nii";
  };
}

/// ... with this sform and no qform.
auto nifti_with_sform(const std::vector<float>& rows) {
  return [=](const fs::path& folder) {
    const fs::path path = nifti_with<float>(280, rows)(folder);
    std::string bytes = read_bytes(path);
    bytes.replace(252, 4, bytes_of(std::vector<std::int16_t>{0, 1}));
    write_bytes(path, bytes);
    return path;
  };
}

auto dicom(const test::SliceEdit& edit) {
  return [=](const fs::path& folder) {
    write_dicom_series(asymmetric_ct(small_grid()), folder / "dicom", edit);
    return folder / "dicom";
  };
}

auto dicom_text(test::DicomTestFile::Tag tag, const std::string& vr, const std::string& value) {
  return dicom([=](int slice, test::DicomTestFile& file) {
    if (slice == 3) file.set_text(tag, vr, value);
  });
}

auto text_file(const std::string& text) {
  return [=](const fs::path& folder) {
    write_bytes(folder / "bad.bin", text);
    return folder / "bad.bin";
  };
}

std::vector<float> floats_with(float value) {
  std::vector<float> voxels(24, 0.0f);
  voxels[13] = value;
  return voxels;
}

/// A compressed MetaImage whose CompressedDataSize is wrong by some bytes; 0: it has none.
auto compressed_meta(int wrong_by, std::map<std::string, std::string> changes) {
  const std::string bytes = deflated(bytes_of(small_voxels()));
  changes["CompressedData"] = "True";
  if (wrong_by != 0)
    changes["CompressedDataSize"] = std::to_string(static_cast<int>(bytes.size()) + wrong_by);
  return meta(changes, bytes);
}

/// "NRRD ... space: NAME" with axes along the space's own.
std::string nrrd_in_space(const std::string& space) {
  return "NRRD0004\ntype: short\ndimension: 3\n" + space +
         "sizes: 4 3 2\nencoding: raw\nendian: little\n"
         "space directions: (0.5,0,0) (0,0.75,0) (0,0,2)\nspace origin: (1.5,2.5,3.5)\n\n" +
         bytes_of(small_voxels());
}

/// A NRRD of 4 x 3 x 2 voxels with these "space directions", and lines that follow them.
auto nrrd(const std::string& directions, const std::string& more_lines = "") {
  return text_file(
      "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 4 3 2\n"
      "encoding: raw\nendian: little\nspace directions: " +
      directions + "\n" + more_lines + "\n" + bytes_of(small_voxels()));
}

std::vector<BadCt> bad_cts() {
  constexpr auto kInput = ExitCode::Input;
  constexpr auto kFile = ExitCode::File;
  const float infinity = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  return {
      // Files that are no CT.
      {"Missing", [](const fs::path& f) { return f / "none.nii.gz"; }, kFile, "does not exist"},
      {"EmptyFile", text_file(""), kFile, "NRRD (it is empty)"},
      {"TextFile", text_file("hello, this is no image\n"), kFile, "not a CT image"},
      {"EmptyFolder", [](const fs::path& f) { return f; }, kFile, "it holds no file"},
      {"FolderOfText",
       [](const fs::path& f) {
         write_bytes(f / "a.txt", "text");
         return f;
       },
       kFile,
       "no DICOM image in this folder (subfolders are not searched): not DICOM: a.txt"},
      {"FolderOfJpeg",
       [](const fs::path& f) {
         write_bytes(f / "a.dcm", "\xff\xd8\xff\xe0 a JPEG picture under another name");
         return f;
       },
       kFile,
       "not DICOM: a.dcm (it begins as a JPEG picture does)"},
      {"Png", text_file("\x89PNG\r\n\x1a\nrest of it"), kInput, "PNG picture has no HU"},
      // MetaImage.
      {"MetaTruncated", truncated("bad.mha", 0.9), kFile, "truncated"},
      {"MetaHeaderOnly", text_file("ObjectType = Image\nNDims = 3\n"), kFile, "ElementDataFile"},
      {"MetaVoxelsInAFolderAbove",
       text_file(meta_header({}, "../ct.raw")),
       kFile,
       "must stand beside it"},
      {"MetaVoxelsAnywhere", text_file(meta_header({}, "/etc/passwd")), kFile, "must stand beside"},
      {"NrrdVoxelsInAFolderAbove",
       text_file("NRRD0004\ntype: short\ndimension: 3\nsizes: 4 3 2\nencoding: raw\n"
                 "data file: x/../../ct.raw\n"),
       kFile,
       "must stand beside it"},
      {"MetaTwoDimensional",
       meta({{"NDims", "2"},
             {"DimSize", "4 6"},
             {"TransformMatrix", "1 0 0 1"},
             {"Offset", "0 0"},
             {"ElementSpacing", "1 1"}}),
       kInput,
       "dimensions = 2"},
      {"MetaFourDimensional",
       meta({{"NDims", "4"},
             {"DimSize", "2 3 2 2"},
             {"TransformMatrix", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"},
             {"Offset", "0 0 0 0"},
             {"ElementSpacing", "1 1 1 1"}}),
       kInput,
       "4-D"},
      {"MetaManyDimensions", meta({{"NDims", "1000000"}}), kFile, "1 to 10"},
      {"MetaSizesMissing", meta({{"DimSize", "4 3"}}), kFile, "3 numbers"},
      {"MetaNegativeSize", meta({{"DimSize", "4 -3 2"}}), kFile, "positive integer"},
      {"MetaOverflowingSize",
       meta({{"DimSize", "4294967296 4294967296 4294967296"}}),
       kFile,
       "image size"},
      {"MetaHugeSize", meta({{"DimSize", "1000 1000 1000"}}), kFile, "2000000000 bytes"},
      {"MetaUnknownType", meta({{"ElementType", "MET_BANANA"}}), kFile, "ElementType"},
      {"MetaRgb",
       meta({{"ElementNumberOfChannels", "3"}}, bytes_of(small_voxels(72))),
       kInput,
       "channels = 3"},
      {"MetaOneSlice", meta({{"DimSize", "4 6 1"}}), kInput, "at least 2 voxels"},
      {"MetaZeroSpacing", meta({{"ElementSpacing", "1 1 0"}}), kInput, "0.01 to 100 mm"},
      {"MetaNegativeSpacing", meta({{"ElementSpacing", "1 -1 1"}}), kInput, "0.01 to 100 mm"},
      {"MetaNanSpacing", meta({{"ElementSpacing", "1 nan 1"}}), kInput, "must be finite"},
      {"MetaTextSpacing", meta({{"ElementSpacing", "1 one 1"}}), kFile, "ElementSpacing"},
      {"MetaShearedDirection",
       meta({{"TransformMatrix", "1 0 0 0.3 0.954 0 0 0 1"}}),
       kInput,
       "orthonormal"},
      {"MetaShortDirection",
       meta({{"TransformMatrix", "1 0 0 0 1 0 0 1"}}),
       kFile,
       "TransformMatrix: expected 9 numbers"},
      {"MetaMissingRawFile",
       [](const fs::path& f) {
         write_bytes(f / "bad.mhd", meta_header({}, "none.raw"));
         return f / "bad.mhd";
       },
       kFile,
       "none.raw"},
      {"MetaShortRawFile",
       [](const fs::path& f) {
         write_bytes(f / "bad.mhd", meta_header({}, "short.raw"));
         write_bytes(f / "short.raw", "123");
         return f / "bad.mhd";
       },
       kFile,
       "expected 48 bytes, found 3"},
      {"MetaSliceList",
       [](const fs::path& f) {
         write_bytes(f / "bad.mhd", meta_header({}, "LIST"));
         return f / "bad.mhd";
       },
       kFile,
       "LIST"},
      {"MetaCorruptCompression",
       meta({{"CompressedData", "True"}, {"CompressedDataSize", "25"}},
            "\x78\x9c this is no zlib stream"),
       kFile,
       "corrupt"},
      {"MetaCompressedWithoutItsLength", compressed_meta(0, {}), kFile, "no 'CompressedDataSize'"},
      {"MetaCompressedLengthTooSmall", compressed_meta(-9, {}), kFile, "CompressedDataSize"},
      {"MetaCompressedLengthTooLarge", compressed_meta(9, {}), kFile, "CompressedDataSize"},
      {"MetaCompressedAtTheEnd",
       compressed_meta(0, {{"HeaderSize", "-1"}, {"CompressedDataSize", "9"}}),
       kFile,
       "HeaderSize"},
      {"MetaHeaderTakenForVoxels", meta({{"HeaderSize", "8"}}), kFile, "HeaderSize"},
      {"MetaHeaderSizeUnknown", meta({{"HeaderSize", "-2"}}), kFile, "HeaderSize"},
      {"MetaKeyTwice", meta({{"Offset", "0 0 0\nDimSize = 2 6 2"}}), kFile, "stands twice"},
      {"MetaByteOrdersDisagree",
       meta({{"ElementByteOrderMSB", "True"}}),
       kFile,
       "BinaryDataByteOrderMSB and ElementByteOrderMSB"},
      // Numbers that no scanner gives.
      {"MetaNoSpacing", meta({{"ElementSpacing", ""}}), kInput, "spacing = none"},
      {"MetaHugeSpacing", meta({{"ElementSpacing", "1 1e300 1"}}), kInput, "0.01 to 100 mm"},
      {"MetaTinySpacing", meta({{"ElementSpacing", "1 1e-5 1"}}), kInput, "0.01 to 100 mm"},
      {"MetaHugeOffset", meta({{"Offset", "0 1e300 0"}}), kInput, "origin = (0, 1e+300, 0)"},
      {"HugeHu",
       meta({{"ElementType", "MET_FLOAT"}}, bytes_of(floats_with(1e30f))),
       kInput,
       "voxel (1, 0, 1) = 1.0000000150474662e+30: HU must be within 1e6"},
      {"NrrdDirectionOverflows", nrrd("(1e300,0,0) (0,1,0) (0,0,1)"), kInput, "space directions"},
      {"NrrdDirectionNone", nrrd("none (0,1,0) (0,0,1)"), kInput, "space directions"},
      {"NrrdDirectionNan", nrrd("(nan,0,0) (0,1,0) (0,0,1)"), kInput, "space directions"},
      {"NrrdInMetres",
       nrrd("(1,0,0) (0,1,0) (0,0,1)", "space units: \"m\" \"m\" \"m\"\n"),
       kInput,
       "space units"},
      {"NrrdLeftHanded",
       text_file(nrrd_in_space("space: 3D-left-handed\n")),
       kInput,
       "space = 3D-left-handed"},
      {"NrrdAxesInAnotherOrder",
       text_file(nrrd_in_space("space: posterior-left-superior\n")),
       kInput,
       "space = posterior-left-superior"},
      {"NrrdOfColours",
       nrrd("(1,0,0) (0,1,0) (0,0,1)", "kinds: RGB-color domain domain\n"),
       kInput,
       "kinds = RGB-color domain domain"},
      {"NrrdOriginIsText",
       nrrd("(1,0,0) (0,1,0) (0,0,1)", "space origin: (1,two,3)\n"),
       kInput,
       "space origin"},
      {"MetaSlope",
       meta({{"ElementToIntensityFunctionSlope", "2"}}),
       kInput,
       "ElementToIntensityFunctionSlope = 2: must be 1"},
      {"MetaOffsetOfValues",
       meta({{"ElementToIntensityFunctionSlope", "1"}, {"ElementToIntensityFunctionOffset", "-5"}}),
       kInput,
       "ElementToIntensityFunctionOffset = -5: must be 0"},
      {"MetaInMetres", meta({{"DistanceUnits", "m"}}), kInput, "DistanceUnits"},
      {"MetaTwoOrigins", meta({{"Position", "1 0 0"}}), kFile, "contradicts another key"},
      {"NrrdKeyTwice", nrrd("(1,0,0) (0,1,0) (0,0,1)", "encoding: gzip\n"), kFile, "stands twice"},
      {"NiftiHugeSlope", nifti_with<float>(112, {1e30f}), kInput, "scl_slope"},
      {"NiftiSlopeNextToNothing", nifti_with<float>(112, {1e-30f}), kInput, "scl_slope"},
      {"NiftiHugeSpacing", nifti_with<float>(80, {1e30f}), kInput, "pixdim[1]"},
      {"NotAFile",
       [](const fs::path& f) {
         if (mkfifo((f / "bad.mha").c_str(), 0600) != 0) throw std::runtime_error("no pipe");
         return f / "bad.mha";
       },
       kFile,
       "is a pipe"},
      // Values.
      {"Nan",
       meta({{"ElementType", "MET_FLOAT"}}, bytes_of(floats_with(nan))),
       kInput,
       "voxel (1, 0, 1) = NaN or infinite"},
      {"Infinite",
       meta({{"ElementType", "MET_FLOAT"}}, bytes_of(floats_with(infinity))),
       kInput,
       "NaN or infinite"},
      {"AllAir",
       meta({}, bytes_of(std::vector<std::int16_t>(24, -1000))),
       kInput,
       "nothing but air"},
      // NIfTI.
      {"NiftiGzipTruncated", truncated("bad.nii.gz", 0.8), kFile, "truncated"},
      {"NiftiGzipLastByteMissing", truncated("bad.nii.gz", 0.9999), kFile, "truncated"},
      {"NiftiGzipCorrupt",
       [](const fs::path& f) {
         write_ct(asymmetric_ct(small_grid()), f / "bad.nii.gz");
         std::string bytes = read_bytes(f / "bad.nii.gz");
         bytes[bytes.size() - 6] = static_cast<char>(~bytes[bytes.size() - 6]);  // stored CRC
         write_bytes(f / "bad.nii.gz", bytes);
         return f / "bad.nii.gz";
       },
       kFile,
       "corrupt"},
      {"NiftiHeaderOnly", nifti_with<std::int16_t>(40, {3, 7, 6, 50}), kFile, "truncated"},
      {"NiftiHugeSize",
       nifti_with<std::int16_t>(40, {3, 32767, 32767, 32767}),
       kFile,
       "image size"},
      {"NiftiNegativeSize", nifti_with<std::int16_t>(40, {3, -7, 6, 5}), kFile, "at least 1"},
      {"NiftiBadRank", nifti_with<std::int16_t>(40, {77, 7, 6, 5}), kFile, "dim[0]"},
      {"NiftiFourDimensional", nifti_with<std::int16_t>(40, {4, 7, 6, 2, 2}), kInput, "4-D"},
      {"NiftiRgb",  // dim, intent, datatype and bitpix
       nifti_with<std::int16_t>(40, {3, 7, 6, 3, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 128, 24}),
       kInput,
       "channels = 3"},
      {"NiftiComplex", nifti_with<std::int16_t>(70, {32, 64}), kFile, "datatype"},
      {"NiftiMetres", nifti_with<char>(123, {1}), kInput, "xyzt_units = metres"},
      {"NiftiZeroSpacing", nifti_with<float>(80, {0.0f}), kInput, "pixdim[1]"},
      // srow_x = srow_y: two axes of the patient are one.
      {"NiftiFlatSform",
       nifti_with_sform({0.8f, 0, 0, 0, 0.8f, 0, 0, 0, 0, 0, 1.5f, 0}),
       kInput,
       "sform = an axis of 1.13"},
      {"NiftiShearedSform",  // as long as pixdim says
       nifti_with_sform({-0.8f, 0.72f, 0, 0, 0, -0.54f, 0, 0, 0, 0, 1.5f, 0}),
       kInput,
       "must be orthonormal"},
      {"NiftiScaledSform",
       nifti_with_sform({-0.8f, 0, 0, 0, 0, -0.91f, 0, 0, 0, 0, 1.5f, 0}),
       kInput,
       "sform = an axis of 0.91"},
      {"NiftiNanSform", nifti_with<float>(280, {nan}), kInput, "must be finite"},
      {"NiftiNanIntercept", nifti_with<float>(112, {2.0f, nan}), kInput, "scl_inter"},
      {"NiftiBadOffset", nifti_with<float>(108, {1e30f}), kFile, "vox_offset"},
      {"NiftiVersion2", nifti_with<std::int32_t>(0, {540}), kFile, "NIfTI-2"},
      // NRRD.
      {"NrrdTruncated", truncated("bad.nrrd", 0.9), kFile, "truncated"},
      {"NrrdHeaderCut", text_file("NRRD0004\ntype: short\ndimension: 3\n"), kFile, "cut short"},
      {"NrrdOverflowingSize",
       text_file("NRRD0004\ntype: short\ndimension: 3\nsizes: 9999999999 9999999999 9\n"
                 "encoding: raw\nendian: little\n\n12"),
       kFile,
       "image size"},
      {"NrrdTextEncoding",
       text_file("NRRD0004\ntype: short\ndimension: 3\nsizes: 2 2 2\nencoding: ascii\n\n"
                 "1 2 3 4 5 6 7 8"),
       kFile,
       "raw or gzip"},
      // DICOM.
      {"DicomTwoSeries",
       [](const fs::path& f) {
         const CtVolume ct = asymmetric_ct(small_grid());
         write_dicom_series(ct, f / "dicom", {}, "1.2.3.4", "A");
         write_dicom_series(ct, f / "dicom", {}, "1.2.3.5", "B");
         return f / "dicom";
       },
       kInput,
       "--series UID:\n  1.2.3.4  5 slices, 'test series A', modality CT\n  1.2.3.5  5 slices"},
      {"DicomMr", dicom_text({0x0008, 0x0060}, "CS", "MR"), kInput, "Modality = 'MR'"},
      {"DicomTilt",
       dicom_text({0x0018, 0x1120}, "DS", "12.5"),
       kInput,
       "GantryDetectorTilt = 12.5 deg"},
      {"DicomShearedStack",
       dicom([](int slice, test::DicomTestFile& file) {
         file.set_text(
             {0x0020, 0x0032}, "DS", position(-31.25, 12.5 + 0.3 * slice, -107 + 1.5 * slice));
       }),
       kInput,
       "gantry tilt or shifted slices"},
      {"DicomMissingSlice",
       dicom([](int slice, test::DicomTestFile& file) {
         file.set_text({0x0020, 0x0032},
                       "DS",
                       position(-31.25, 12.5, -107 + 1.5 * (slice > 2 ? slice + 1 : slice)));
       }),
       kInput,
       "between slice 3 (-104 mm) and slice 4 (-101 mm) the distance is 3 mm, elsewhere 1.5 mm: "
       "a slice is missing"},
      {"DicomUnevenSlices",
       dicom_text({0x0020, 0x0032}, "DS", position(-31.25, 12.5, -102.3)),
       kInput,
       "not evenly spaced"},
      {"DicomDuplicateSlice",
       dicom_text({0x0020, 0x0032}, "DS", position(-31.25, 12.5, -104)),
       kInput,
       "two slices at one position"},
      {"DicomOtherOrientation",
       dicom_text({0x0020, 0x0037}, "DS", "1\\0\\0\\0\\0\\-1"),
       kInput,
       "localizer"},
      {"DicomOrientationNotOrthogonal",
       dicom_text({0x0020, 0x0037}, "DS", "1\\0\\0\\1\\0\\0"),
       kInput,
       "orthogonal unit vectors"},
      {"DicomOtherFrameOfReference",
       dicom([](int slice, test::DicomTestFile& file) {
         file.set_text({0x0020, 0x0052}, "UI", slice == 3 ? "1.2.4" : "1.2.3");
       }),
       kInput,
       "FrameOfReferenceUID = '1.2."},
      {"DicomOtherSpacing",
       dicom_text({0x0028, 0x0030}, "DS", "0.9\\0.7"),
       kInput,
       "must be as in IM"},
      {"DicomZeroSpacing", dicom_text({0x0028, 0x0030}, "DS", "0\\0"), kInput, "positive"},
      {"DicomOtherSize",
       dicom([](int slice, test::DicomTestFile& file) {
         if (slice == 3) file.set_u16({0x0028, 0x0010}, 5);
       }),
       kInput,
       "Columns x Rows"},
      {"DicomPositionMissing",
       dicom([](int, test::DicomTestFile& file) {
         file.erase({0x0020, 0x0032});
       }),
       kInput,
       "ImagePositionPatient = (absent)"},
      {"DicomPositionIsText",
       dicom_text({0x0020, 0x0032}, "DS", "a\\b\\c"),
       kInput,
       "must be finite numbers"},
      {"DicomSlopeZero", dicom_text({0x0028, 0x1053}, "DS", "0"), kInput, "slope not 0"},
      {"DicomMultiFrame", dicom_text({0x0028, 0x0008}, "IS", "20"), kInput, "multi-frame"},
      {"DicomColour",
       dicom_text({0x0028, 0x0004}, "CS", "RGB"),
       kInput,
       "PhotometricInterpretation = 'RGB'"},
      {"DicomPixelsMissing",
       dicom([](int slice, test::DicomTestFile& file) {
         if (slice == 1) file.set_pixels({1, 2, 3});
       }),
       kFile,
       "IM6.dcm"},
      {"DicomHugeRows",
       dicom([](int, test::DicomTestFile& file) {
         file.set_u16({0x0028, 0x0010}, 65535);
         file.set_u16({0x0028, 0x0011}, 10000);
       }),
       kFile,
       "expected 1310700000 bytes, found 84"},
      {"DicomTruncatedFile",
       [](const fs::path& f) {
         write_dicom_series(asymmetric_ct(small_grid()), f / "dicom");
         fs::resize_file(f / "dicom/IM6.dcm", fs::file_size(f / "dicom/IM6.dcm") - 40);
         return f / "dicom";
       },
       kFile,
       "IM6.dcm"},
      {"DicomTruncatedHeader",
       [](const fs::path& f) {
         write_dicom_series(asymmetric_ct(small_grid()), f / "dicom");
         fs::resize_file(f / "dicom/IM6.dcm", 300);
         return f / "dicom";
       },
       kFile,
       "IM6.dcm"},
      {"DicomOneSlice",
       [](const fs::path& f) {
         write_dicom_series(asymmetric_ct(small_grid()), f / "all");
         fs::create_directory(f / "dicom");
         fs::copy(f / "all/IM6.dcm", f / "dicom/IM6.dcm");
         return f / "dicom";
       },
       kInput,
       "one slice"},
      {"DicomSingleFile",
       [](const fs::path& f) {
         write_dicom_series(asymmetric_ct(small_grid()), f / "dicom");
         return f / "dicom/IM6.dcm";
       },
       kInput,
       "give the folder"},
  };
}

TEST(CtReader, ANiftiSlopeThatIsNoNumberIsNone) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float slope : {nan, infinity, 0.0f}) {
    const ScratchFolder folder;
    // The intercept does not matter: nibabel leaves it out together with the slope.
    const fs::path path = nifti_with<float>(112, {slope, nan})(folder.path());
    expect_same_ct(asymmetric_ct(small_grid()), read_ct(path));
  }
}

/// The small grid's axes, the second one leaning towards the first by a cosine.
Eigen::Matrix3d leaning_axes(double cosine) {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  axes.col(1) = Eigen::Vector3d(cosine, std::sqrt(1.0 - cosine * cosine), 0.0);
  return axes;
}

// The outer voxel centres are 5 x 0.9 mm apart along the leaning axis and 6 x 0.8 mm along the
// first. So a cosine c moves corners by half of 4.5 c mm along the first axis and by half of 4.8 c
// mm along the second.
TEST(CtReader, TakesTheNearestUprightAxesInEveryFormat) {
  for (const double cosine : {5e-5, 2e-4, 9e-4, 1.1e-3}) {
    SCOPED_TRACE(cosine);
    const ScratchFolder folder;
    const Eigen::Matrix3d axes = leaning_axes(cosine);
    const CtGrid grid = small_grid();
    const auto text = [](double value) {
      std::ostringstream out;
      out << std::setprecision(12) << value;
      return out.str();
    };
    const auto join = [&](const Eigen::Vector3d& v, const char* between) {
      return text(v.x()) + between + text(v.y()) + between + text(v.z());
    };
    const CtVolume upright = asymmetric_ct(grid);
    const std::string voxels =
        bytes_of(std::vector(upright.hu.view().begin(), upright.hu.view().end()));
    write_bytes(folder / "ct.mha",
                meta_header({{"DimSize", "7 6 5"},
                             {"ElementSpacing", join(grid.spacing_mm, " ")},
                             {"Offset", join(grid.origin_mm, " ")},
                             {"TransformMatrix",
                              join(axes.col(0), " ") + " " + join(axes.col(1), " ") + " " +
                                  join(axes.col(2), " ")}}) +
                    voxels);
    std::string directions;
    std::vector<float> rows(12);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d column = axes.col(axis) * grid.spacing_mm[axis];
      directions += (axis > 0 ? " (" : "(") + join(column, ",") + ")";
      for (Eigen::Index row = 0; row < 3; ++row)
        rows[static_cast<std::size_t>(4 * row + axis)] =
            static_cast<float>(row < 2 ? -column[row] : column[row]);
    }
    for (std::size_t row = 0; row < 3; ++row)
      rows[4 * row + 3] =
          static_cast<float>((row < 2 ? -1 : 1) * grid.origin_mm[static_cast<Eigen::Index>(row)]);
    write_bytes(folder / "ct.nrrd",
                "NRRD0004\ntype: short\ndimension: 3\nspace: LPS\nsizes: 7 6 5\nencoding: raw\n"
                "endian: little\nspace directions: " +
                    directions + "\nspace origin: (" + join(grid.origin_mm, ",") + ")\n\n" +
                    voxels);
    for (const fs::path& path :
         {folder / "ct.mha", folder / "ct.nrrd", nifti_with_sform(rows)(folder.path())}) {
      SCOPED_TRACE(path);
      std::vector<std::string> warnings;
      if (cosine > 1e-3) {
        EXPECT_THAT(test::message_of<InputError>([&] { (void)read_ct(path); }),
                    HasSubstr("orthonormal"));
        continue;
      }
      const CtVolume found = read_ct(path, {}, &warnings);
      EXPECT_LT(
          (found.grid.direction.transpose() * found.grid.direction - Eigen::Matrix3d::Identity())
              .norm(),
          1e-12);
      EXPECT_LT(largest_corner_shift_mm(upright.grid, found.grid), 4.8 * cosine + 1e-5);
      EXPECT_EQ(warnings.size(), cosine * 4.8 / 2.0 * std::sqrt(0.5) > 1e-3 ? 1U : 0U);
    }
  }
}

TEST(CtReader, TurnsEverySpaceOfANrrdIntoLps) {
  struct Space {
    const char* name;
    Eigen::Vector3d signs;
    bool is_of_patient;
  };
  for (const Space& space : {Space{"space: left-posterior-superior\n", {1, 1, 1}, true},
                             Space{"space: LPS\n", {1, 1, 1}, true},
                             Space{"space: right-anterior-superior\n", {-1, -1, 1}, true},
                             Space{"space: RAS\n", {-1, -1, 1}, true},
                             Space{"space: left-anterior-superior\n", {1, -1, 1}, true},
                             Space{"space: las\n", {1, -1, 1}, true},
                             Space{"space: right-posterior-inferior\n", {-1, 1, -1}, true},
                             Space{"space: right-anterior-superior-time\n", {-1, -1, 1}, true},
                             Space{"space: scanner-xyz\n", {1, 1, 1}, false},
                             Space{"space: 3D-right-handed\n", {1, 1, 1}, false},
                             Space{"space dimension: 3\n", {1, 1, 1}, false}}) {
    SCOPED_TRACE(space.name);
    const ScratchFolder folder;
    write_bytes(folder / "ct.nrrd", nrrd_in_space(space.name));
    std::vector<std::string> warnings;
    const CtVolume ct = read_ct(folder / "ct.nrrd", {}, &warnings);
    const Eigen::Vector3d expected = Eigen::Vector3d(1.5 + 3 * 0.5, 2.5 + 2 * 0.75, 3.5 + 2);
    EXPECT_EQ(ct.grid.point_mm({3, 2, 1}), space.signs.cwiseProduct(expected));
    EXPECT_EQ(warnings.size(), space.is_of_patient ? 0U : 1U);
  }
}

/// Gives the process decimal commas for its lifetime, unless the locale cannot be made.
class CommaLocale {
 public:
  CommaLocale() {
    const std::string made = folder_ / "de_DE.UTF-8";
    const std::string command = "localedef -i de_DE -f UTF-8 " + made + " >/dev/null 2>&1";
    is_there_ = std::system(command.c_str()) == 0 &&
                ::setenv("LOCPATH", folder_.path().c_str(), 1) == 0 &&
                std::setlocale(LC_ALL, "de_DE.UTF-8") != nullptr && std::to_string(0.5)[1] == ',';
  }
  ~CommaLocale() {
    std::setlocale(LC_ALL, "C");
    ::unsetenv("LOCPATH");
  }
  CommaLocale(const CommaLocale&) = delete;
  CommaLocale& operator=(const CommaLocale&) = delete;
  [[nodiscard]] bool is_there() const { return is_there_; }

 private:
  ScratchFolder folder_;
  bool is_there_ = false;
};

TEST(CtReader, ReadsAndWritesPointsWhateverTheHostProgramsLocale) {
  const CommaLocale locale;
  if (!locale.is_there()) GTEST_SKIP() << "no German locale can be made here";
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(small_grid());
  for (const char* name : {"ct.mha", "ct.nrrd", "ct.nii.gz"}) {
    SCOPED_TRACE(name);
    write_ct(ct, folder / name);
    expect_same_ct(ct, read_ct(folder / name));
  }
  write_dicom_series(ct, folder / "dicom");
  expect_same_ct(ct, read_ct(folder / "dicom"));
}

class CtReaderRefuses : public testing::TestWithParam<BadCt> {};

TEST_P(CtReaderRefuses, WithItsMessageAndCodeAndNothingOnTheTerminal) {
  const ScratchFolder folder;
  const fs::path path = GetParam().make(folder.path());
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  std::string message = "(nothing was thrown)";
  ExitCode code = ExitCode::Done;
  try {
    (void)read_ct(path);
  } catch (const Error& error) {
    message = error.what();
    code = error.exit_code();
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(static_cast<int>(code), static_cast<int>(GetParam().code)) << message;
  EXPECT_THAT(message, HasSubstr(GetParam().message));
  EXPECT_THAT(message, HasSubstr(path.parent_path().string()));
}

INSTANTIATE_TEST_SUITE_P(BadInputs,
                         CtReaderRefuses,
                         testing::ValuesIn(bad_cts()),
                         [](const auto& bad) { return bad.param.name; });

/// Pixels in the RLE encoding of DICOM (PS3.5, annex G): high bytes, then low bytes, as literal
/// runs.
std::string rle_encoded(const std::vector<std::int16_t>& pixels) {
  std::string segments[2];
  for (std::size_t first = 0; first < pixels.size(); first += 128) {
    const std::size_t count = std::min<std::size_t>(128, pixels.size() - first);
    for (std::string& segment : segments) segment += static_cast<char>(count - 1);
    for (std::size_t i = first; i < first + count; ++i) {
      segments[0] += static_cast<char>(pixels[i] >> 8 & 0xff);
      segments[1] += static_cast<char>(pixels[i] & 0xff);
    }
  }
  for (std::string& segment : segments)
    if (segment.size() % 2 != 0) segment += '\0';
  std::vector<std::uint32_t> header(16);
  header[0] = 2;
  header[1] = 64;
  header[2] = static_cast<std::uint32_t>(64 + segments[0].size());
  return bytes_of(header) + segments[0] + segments[1];
}

TEST(CtReader, DecodesCompressedDicomPixels) {
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(small_grid());
  write_dicom_series(ct, folder / "dicom", [&](int slice, test::DicomTestFile& file) {
    std::vector<std::int16_t> stored;
    for (std::size_t i = 0; i < 42; ++i)
      stored.push_back(
          static_cast<std::int16_t>(ct.hu[static_cast<std::size_t>(slice) * 42 + i] + 1024));
    file.set_fragment("1.2.840.10008.1.2.5", rle_encoded(stored));
  });
  expect_same_ct(ct, read_ct(folder / "dicom"));
}

// A pose in DICOM names its frame of reference. It must be that of the series read, whatever lies
// beside it.
TEST(CtReader, GivesTheFrameOfReferenceOfTheSeriesThatIsRead) {
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(small_grid());
  const auto in_frame = [](const std::string& uid) {
    return [uid](int /*slice*/, test::DicomTestFile& file) {
      file.set_text({0x0020, 0x0052}, "UI", uid);
      file.set_fragment("1.2.840.10008.1.2.5", rle_encoded(std::vector<std::int16_t>(42)));
    };
  };
  // The names that sort first belong to the other series, to a file without an image and to an
  // empty file.
  write_dicom_series(ct, folder / "ct", in_frame("5.1"), "1.2.1", "A");
  write_dicom_series(ct, folder / "ct", in_frame("5.2"), "1.2.2", "B");
  test::DicomTestFile report;
  report.set_text({0x0008, 0x0016}, "UI", "1.2.840.10008.5.1.4.1.1.88.11");
  report.set_text({0x0020, 0x0052}, "UI", "5.3");
  report.write(folder / "ct/0.dcm");
  test::write_input(folder / "ct/1.dcm", "");
  CtReadOptions options;
  const auto frame_of = [&](const fs::path& path) { return ct_frame_of_reference(path, options); };
  EXPECT_THAT(test::message_of<InputError>([&] { frame_of(folder / "ct"); }), HasSubstr("1.2.2"));
  options.series_uid = "1.2.2";
  EXPECT_EQ(frame_of(folder / "ct"), "5.2");
  options.series_uid = "1.2.1";
  EXPECT_EQ(frame_of(folder / "ct"), "5.1");
  EXPECT_EQ(frame_of(folder / "ct/A3.dcm"), "5.1");
  write_ct(ct, folder / "ct.mha");
  EXPECT_EQ(frame_of(folder / "ct.mha"), "");
}

TEST(CtReader, CutsTwelveStoredBitsOutOfSixteenAndExtendsTheirSign) {
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(small_grid());
  write_dicom_series(ct, folder / "dicom", [&](int slice, test::DicomTestFile& file) {
    // HU themselves, in bits 2 ... 13, with rubbish (an overlay) in the others.
    std::vector<std::int16_t> stored;
    for (std::size_t i = 0; i < 42; ++i) {
      const int hu = ct.hu[static_cast<std::size_t>(slice) * 42 + i];
      stored.push_back(static_cast<std::int16_t>((hu & 0xfff) << 2 | 0xc001));
    }
    file.set_pixels(stored);
    file.set_u16({0x0028, 0x0101}, 12);
    file.set_u16({0x0028, 0x0102}, 13);
    file.set_text({0x0028, 0x1052}, "DS", "0");
  });
  expect_same_ct(ct, read_ct(folder / "dicom"));
}

TEST(CtReader, ReadsCompressedVolumesThatFillEveryBuffer) {
  // 5 MB of nearly constant voxels pack into a few kB: output waits while no input is left.
  const ScratchFolder folder;
  CtVolume ct;
  ct.grid.size = {160, 160, 100};
  std::vector<std::int16_t> hu(ct.grid.voxel_count(), -1000);
  hu.back() = 500;
  ct.hu = SharedArray<std::int16_t>(std::move(hu));
  write_ct(ct, folder / "ct.nii.gz");
  EXPECT_EQ(identity_of(read_ct(folder / "ct.nii.gz")).content_sha256,
            identity_of(ct).content_sha256);
}

/// A NIfTI file of floats, its voxels `extra` bytes behind where they usually begin.
void write_float_nifti(const std::vector<float>& voxels,
                       const std::array<std::size_t, 3>& size,
                       std::size_t extra,
                       const fs::path& path) {
  RawImage image;
  image.size.assign(size.begin(), size.end());
  image.spacing_mm = {0.8, 0.9, 1.5};
  image.origin_mm = {-31.25, 12.5, -107.0};
  image.directions = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
  image.type = ValueType::Float32;
  const auto bytes = std::as_bytes(std::span(voxels));
  image.values.assign(bytes.begin(), bytes.end());
  write_raw_image(image, path);
  std::string file = read_bytes(path);
  constexpr std::size_t kUsual = 352;
  file.insert(kUsual, std::string(extra, 'x'));
  file.replace(108, 4, bytes_of(std::vector<float>{static_cast<float>(kUsual + extra)}));
  write_bytes(path, file);
}

TEST(CtReader, ReadsFloatNiftiInPiecesWhereverTheVoxelsBegin) {
  const ScratchFolder folder;
  // 3.3 MB: pieces of 1 MiB end within a row.
  const std::array<std::size_t, 3> size = {101, 91, 89};
  std::vector<float> voxels(size[0] * size[1] * size[2]);
  for (std::size_t i = 0; i < voxels.size(); ++i)
    voxels[i] = static_cast<float>(i * 7919 % 3001) - 1000.0f;
  // 3: floats no longer begin at multiples of 4 bytes of the file.
  for (const std::size_t extra : {std::size_t{0}, std::size_t{3}}) {
    const fs::path plain = folder / ("ct-" + std::to_string(extra) + ".nii");
    write_float_nifti(voxels, size, extra, plain);
    ASSERT_EQ(std::system(("gzip -k " + plain.string()).c_str()), 0);
    for (const std::string& name : {plain.string(), plain.string() + ".gz"}) {
      const CtVolume ct = read_ct(name);
      ASSERT_EQ(ct.hu.size(), voxels.size());
      for (std::size_t i = 0; i < voxels.size(); ++i)
        ASSERT_EQ(static_cast<float>(ct.hu[i]), voxels[i]) << name << ", voxel " << i;
    }
  }
}

/// Every way to cut a small file short, and one wrong bit in each byte of its header.
TEST(CtReader, NeitherAcceptsAnyTruncationNorDiesOfAnyFlippedHeaderByte) {
  const ScratchFolder folder;
  const CtVolume ct = asymmetric_ct(small_grid());
  write_dicom_series(ct, folder / "dicom");
  write_ct(ct, folder / "ct.mha");
  write_ct(ct, folder / "ct.nrrd");
  write_ct(ct, folder / "ct.nii.gz");
  const auto refused = [](const fs::path& path) {
    try {
      (void)read_ct(path);
      return false;
    } catch (const Error&) {
      return true;
    }
  };
  testing::internal::CaptureStderr();
  for (const char* name : {"dicom/IM6.dcm", "ct.mha", "ct.nrrd", "ct.nii.gz"}) {
    const fs::path file = folder / name;
    const fs::path path = file.extension() == ".dcm" ? file.parent_path() : file;
    const std::string good = read_bytes(file);
    for (std::size_t length = 0; length < good.size(); length += 1 + length / 16) {
      write_bytes(file, good.substr(0, length));
      EXPECT_TRUE(refused(path)) << name << " cut to " << length << " of " << good.size();
    }
    for (std::size_t at = 0; at < std::min<std::size_t>(good.size(), 560); at += 3) {
      std::string bad = good;
      bad[at] = static_cast<char>(bad[at] ^ 0x11);
      write_bytes(file, bad);
      (void)refused(path);  // either is right; ending the process is not
    }
    write_bytes(file, good);
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(CtReader, NamesAnUnknownSeriesAndTheKnownOnes) {
  const ScratchFolder folder;
  write_dicom_series(asymmetric_ct(small_grid()), folder / "dicom");
  CtReadOptions options;
  options.series_uid = "9.9";
  try {
    (void)read_ct(folder / "dicom", options);
    FAIL() << "an unknown series was accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("--series = 9.9: no such series"));
    EXPECT_THAT(error.what(), HasSubstr("1.2.826.0.1.3680043.2.1  5 slices"));
  }
}

TEST(CtWriter, RefusesAFormatThatCannotHoldACt) {
  const ScratchFolder folder;
  EXPECT_THROW(write_ct(asymmetric_ct(small_grid()), folder / "ct.png"), UsageError);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

/// A body that is a ramp along all axes, in HU.
double body_hu(const Eigen::Vector3d& point) {
  return 100.0 + Eigen::Vector3d(20.0, -15.0, 30.0).dot(point - Eigen::Vector3d(-29, 15, -104));
}

/// The small series with its slices moved by `shift_mm(slice)`; voxels hold body_hu().
void write_moved_series(const std::filesystem::path& folder,
                        const std::function<Eigen::Vector3d(int)>& shift_mm) {
  const CtGrid grid = test::small_grid();
  std::vector<std::int16_t> hu;
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i)
        hu.push_back(static_cast<std::int16_t>(
            std::lround(body_hu(grid.point_mm(Eigen::Vector3d(i, j, k)) + shift_mm(k)))));
  CtVolume ct;
  ct.grid = grid;
  ct.hu = SharedArray<std::int16_t>(std::move(hu));
  test::write_dicom_series(ct, folder, [&](int slice, test::DicomTestFile& file) {
    const Eigen::Vector3d at = grid.point_mm({0, 0, static_cast<double>(slice)}) + shift_mm(slice);
    std::ostringstream text;
    text << std::setprecision(10) << at.x() << '\\' << at.y() << '\\' << at.z();
    file.set_text({0x0020, 0x0032}, "DS", text.str());
  });
}

void expect_body(const CtVolume& ct, std::size_t least_compared) {
  std::size_t compared = 0;
  std::size_t at = 0;
  for (int k = 0; k < ct.grid.size[2]; ++k)
    for (int j = 0; j < ct.grid.size[1]; ++j)
      for (int i = 0; i < ct.grid.size[0]; ++i, ++at) {
        if (ct.hu[at] == -1000) continue;
        ++compared;
        EXPECT_NEAR(ct.hu[at], body_hu(ct.grid.point_mm(Eigen::Vector3d(i, j, k))), 1.01);
      }
  EXPECT_GE(compared, least_compared);
}

TEST(CtReaderResamples, ATiltedGantryWhenAskedTo) {
  const test::ScratchFolder folder;
  write_moved_series(folder / "ct",
                     [](int slice) { return Eigen::Vector3d(0.0, 0.5 * slice, 0.0); });
  const std::string refusal = test::message_of<InputError>([&] { (void)read_ct(folder / "ct"); });
  EXPECT_THAT(refusal, testing::HasSubstr("gantry tilt"));
  EXPECT_THAT(refusal, testing::HasSubstr("--resample"));
  CtReadOptions options;
  options.resamples = true;
  std::vector<std::string> warnings;
  const CtVolume ct = read_ct(folder / "ct", options, &warnings);
  EXPECT_EQ(ct.grid.size, (std::array<int, 3>{7, 9, 5}));
  EXPECT_THAT(warnings, testing::Contains(testing::HasSubstr("resampled to 7 x 9 x 5 voxels")));
  expect_body(ct, 7 * 5 * 5);
}

TEST(CtReaderResamples, UnevenSlicesAndLeavesEvenOnesAlone) {
  const test::ScratchFolder folder;
  write_moved_series(folder / "ct",
                     [](int slice) { return Eigen::Vector3d(0.0, 0.0, slice == 2 ? 0.6 : 0.0); });
  CtReadOptions options;
  options.resamples = true;
  const CtVolume ct = read_ct(folder / "ct", options);
  EXPECT_EQ(ct.grid.size, test::small_grid().size);
  expect_body(ct, ct.grid.voxel_count());
  const CtVolume even = test::asymmetric_ct(test::small_grid());
  test::write_dicom_series(even, folder / "even");
  EXPECT_EQ(identity_of(read_ct(folder / "even", options)).content_sha256,
            identity_of(even).content_sha256);
}

TEST(CtReaderResamples, PaddingAsTheAirThatItIs) {
  const test::ScratchFolder folder;
  (void)padded_series(folder / "ct", 30000, [slice = 0](test::DicomTestFile& file) mutable {
    file.set_u16(kPaddingTag, 30000);
    file.set_text(
        {0x0020, 0x0032}, "DS", position(-31.25, 12.5 + 0.45 * slice, -107 + 1.5 * slice));
    ++slice;
  });
  CtReadOptions options;
  options.resamples = true;
  const CtVolume ct = read_ct(folder / "ct", options);
  // The stored CT's highest HU is 1004; between air and tissue all is lower.
  EXPECT_LT(*std::max_element(ct.hu.view().begin(), ct.hu.view().end()), 1100);
}

TEST(CtReaderResamples, NoGapThatWouldBeMadeUp) {
  const test::ScratchFolder folder;
  write_moved_series(folder / "ct",
                     [](int slice) { return Eigen::Vector3d(0.0, 0.0, slice > 2 ? 6.0 : 0.0); });
  CtReadOptions options;
  options.resamples = true;
  EXPECT_THAT(test::message_of<InputError>([&] { (void)read_ct(folder / "ct", options); }),
              testing::HasSubstr("too wide to be resampled"));
}

TEST(CtReaderValues, OfAttenuationAndLabelsBecomeHuAndAnotherContent) {
  const test::ScratchFolder folder;
  const CtVolume ct = test::asymmetric_ct(test::small_grid());
  write_ct(ct, folder / "ct.mha");
  CtReadOptions options;
  options.values = "raw";
  options.raw_slope_per_mm = 1e-5;
  options.raw_offset_per_mm = 0.01;
  const CtVolume raw = read_ct(folder / "ct.mha", options);
  for (std::size_t i = 0; i < ct.hu.size(); ++i)
    ASSERT_NEAR(raw.hu[i], (1e-5 * ct.hu[i] + 0.01) / 2e-5 - 1000.0, 0.5 + 1e-9) << i;
  EXPECT_NE(identity_of(raw).content_sha256, identity_of(ct).content_sha256);
  CtReadOptions labels;
  labels.values = "labels";
  labels.label_hu = {std::to_string(ct.hu[100]) + "=55"};
  const CtVolume labelled = read_ct(folder / "ct.mha", labels);
  for (std::size_t i = 0; i < ct.hu.size(); ++i)
    ASSERT_EQ(labelled.hu[i], ct.hu[i] == ct.hu[100] ? 55 : -1000);
}

}  // namespace
}  // namespace af
