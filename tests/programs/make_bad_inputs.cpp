// SPDX-License-Identifier: Apache-2.0
// Writes the inputs of bad_inputs.sh into a folder: a small valid study in valid/, and CTs that are
// wrong in one way each.
#include <exception>
#include <fstream>
#include <iostream>
#include <limits>
#include <span>
#include <string>
#include <vector>
#include <zlib.h>

#include "base/hash_random.h"
#include "programs/small_study.h"
#include "unit/ct/ct_test_data.h"
#include "unit/ct/encoded_frames.h"

namespace {

namespace fs = std::filesystem;
using namespace af;
using test::DicomTestFile;

constexpr DicomTestFile::Tag kModality{0x0008, 0x0060};
constexpr DicomTestFile::Tag kTilt{0x0018, 0x1120};
constexpr DicomTestFile::Tag kPosition{0x0020, 0x0032};

std::string position(double z_mm) {
  return "-31.25\\12.5\\" + std::to_string(z_mm);
}

void write_dicom_folders(const fs::path& folder) {
  const CtVolume ct = test::asymmetric_ct(test::small_grid());
  test::write_dicom_series(ct, folder / "two-series", {}, "1.2.3.4", "A");
  test::write_dicom_series(ct, folder / "two-series", {}, "1.2.3.5", "B");
  test::write_dicom_series(
      ct, folder / "mr", [](int, DicomTestFile& file) { file.set_text(kModality, "CS", "MR"); });
  test::write_dicom_series(
      ct, folder / "tilted", [](int, DicomTestFile& file) { file.set_text(kTilt, "DS", "12.5"); });
  test::write_dicom_series(ct, folder / "missing-slice", [](int slice, DicomTestFile& file) {
    file.set_text(kPosition, "DS", position(-107.0 + 1.5 * (slice > 2 ? slice + 1 : slice)));
  });
  test::write_dicom_series(ct, folder / "uneven", [](int slice, DicomTestFile& file) {
    file.set_text(kPosition, "DS", position(-107.0 + 1.5 * slice + (slice == 2 ? 0.6 : 0.0)));
  });
}

/// DICOM X-rays of the valid study's detector (48 x 48), each wrong in one way.
void write_dicom_xrays(const fs::path& folder) {
  std::vector<int> levels(48 * 48, 3000);
  levels[48 * 24 + 24] = 100;
  const auto write = [&](const char* name, int frames, const auto& edit) {
    DicomTestFile file = test::xa_file(48, 48, frames, levels);
    file.erase({0x0018, 0x1164});
    edit(file);
    file.write(folder / name);
  };
  write("frames.dcm", 2, [](DicomTestFile&) {});
  write("other-spacing.dcm", 1, [](DicomTestFile& file) {
    file.set_text({0x0018, 0x1164}, "DS", "0.1\\0.1");
  });
  write("logarithms.dcm", 1, [](DicomTestFile& file) {
    file.set_text({0x0028, 0x1040}, "CS", "LOG");
  });
  write("colour.dcm", 1, [](DicomTestFile& file) { file.set_text({0x0028, 0x0004}, "CS", "RGB"); });
  write("promises-frames.dcm", 1, [](DicomTestFile& file) {
    file.set_text({0x0028, 0x0008}, "IS", "99999");
  });
}

/// Frames on which GDCM 3.0.21 crashed with signals 6 and 11. Whether it does depends on what is in
/// memory.
void write_damaged_frames(const fs::path& folder) {
  const auto write =
      [&](const std::string& name, const test::EncodedFrame& frame, std::uint64_t key) {
        std::string bytes = test::bytes_of_hex(frame.hex);
        HashRandom random(1, key);
        for (int change = 0; change < 3; ++change)
          bytes[random.below(bytes.size())] = static_cast<char>(random.below(256));
        DicomTestFile file = test::xa_file(16, 12, 1, std::vector<int>(16 * 12, 0));
        file.set_fragment(frame.transfer_syntax, bytes);
        file.write(folder / name);
      };
  write("damaged-jpeg.dcm", test::kEncodedFrames[0], 7);
  write("damaged-rle.dcm", test::kEncodedFrames[2], 17);
}

/// A MetaImage of 4 x 4 x 4 voxels (x 2 when there are four dimensions).
template <typename T>
void write_meta(const fs::path& path, const std::string& type, int dimensions, T first, T other) {
  std::ofstream out(path, std::ios::binary);
  out << "ObjectType = Image\nNDims = " << dimensions
      << "\nBinaryData = True\nBinaryDataByteOrderMSB = False\nElementSpacing = 1 1 1"
      << (dimensions == 4 ? " 1\nDimSize = 4 4 4 2" : "\nDimSize = 4 4 4")
      << "\nElementType = " << type << "\nElementDataFile = LOCAL\n";
  std::vector<T> voxels(dimensions == 4 ? 128 : 64, other);
  voxels.front() = first;
  out.write(reinterpret_cast<const char*>(voxels.data()),
            static_cast<std::streamsize>(voxels.size() * sizeof(T)));
  if (!out.flush()) throw std::runtime_error("cannot write " + path.string());
}

std::string deflated(std::span<const std::int16_t> voxels) {
  const auto raw = std::as_bytes(voxels);
  uLongf size = compressBound(raw.size());
  std::string stream(size, '\0');
  compress(reinterpret_cast<Bytef*>(stream.data()),
           &size,
           reinterpret_cast<const Bytef*>(raw.data()),
           raw.size());
  stream.resize(size);
  return stream;
}

/// MetaImages with sound compressed voxels and one thing wrong in the header.
void write_broken_meta(const fs::path& folder) {
  const CtVolume ct = test::asymmetric_ct(test::small_grid());
  const std::string voxels = deflated(ct.hu.view());
  const auto write = [&](const std::string& name,
                         const std::string& lines,
                         const std::string& spacing = "1 1 1",
                         const std::string& offset = "0 0 0") {
    std::ofstream out(folder / name, std::ios::binary);
    out << "ObjectType = Image\nNDims = 3\nBinaryData = True\nCompressedData = True\n"
        << lines << "Offset = " << offset << "\nElementSpacing = " << spacing
        << "\nDimSize = " << ct.grid.size[0] << ' ' << ct.grid.size[1] << ' ' << ct.grid.size[2]
        << "\nElementType = MET_SHORT\nElementDataFile = LOCAL\n"
        << voxels;
    if (!out.flush()) throw std::runtime_error("cannot write " + name);
  };
  const auto size_line = [&](std::size_t size) {
    return "CompressedDataSize = " + std::to_string(size) + "\n";
  };
  write("no-compressed-size.mha", "");
  write("wrong-compressed-size.mha", size_line(voxels.size() - 20));
  write("huge-spacing.mha", size_line(voxels.size()), "1 1e300 1");
  write("huge-offset.mha", size_line(voxels.size()), "1 1 1", "0 1e300 0");
}

void write_inputs(const fs::path& folder) {
  fs::create_directories(folder / "valid");
  test::write_small_study(folder / "valid");
  write_dicom_folders(folder);
  write_dicom_xrays(folder);
  write_damaged_frames(folder);
  write_meta<float>(folder / "nan.mha", "MET_FLOAT", 3, std::numeric_limits<float>::quiet_NaN(), 0);
  write_meta<short>(folder / "all-air.mha", "MET_SHORT", 3, -1000, -1000);
  write_meta<short>(folder / "four-d.mha", "MET_SHORT", 4, 40, 40);
  write_meta<float>(folder / "huge-hu.mha", "MET_FLOAT", 3, 1e30f, 0);
  write_broken_meta(folder);
  // A second CT, of the valid one's size, that the valid one's field does not belong to.
  CtVolume other = test::five_ellipsoids();
  std::vector<std::int16_t> hu(other.hu.view().begin(), other.hu.view().end());
  hu[hu.size() / 2] = 321;
  other.hu = SharedArray<std::int16_t>(std::move(hu));
  write_ct(other, folder / "other.nii.gz");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: make_bad_inputs FOLDER\n";
    return 2;
  }
  try {
    write_inputs(argv[1]);
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
  return 0;
}
