// SPDX-License-Identifier: Apache-2.0
#include "unit/ct/ct_test_data.h"

#include <iomanip>
#include <sstream>

namespace af::test {

namespace {

template <typename... Numbers>
std::string decimals(const Numbers... numbers) {
  std::ostringstream text;
  text << std::setprecision(10);  // a DICOM decimal string has at most 16 characters
  const char* separator = "";
  ((text << separator << numbers, separator = "\\"), ...);
  return text.str();
}

constexpr int kIntercept = -1024;

std::vector<std::int16_t> stored_pixels(const CtVolume& ct, int slice) {
  const std::size_t count =
      static_cast<std::size_t>(ct.grid.size[0]) * static_cast<std::size_t>(ct.grid.size[1]);
  std::vector<std::int16_t> pixels;
  for (std::size_t i = 0; i < count; ++i)
    pixels.push_back(
        static_cast<std::int16_t>(ct.hu[static_cast<std::size_t>(slice) * count + i] - kIntercept));
  return pixels;
}

}  // namespace

CtGrid small_grid() {
  CtGrid grid;
  grid.size = {7, 6, 5};
  grid.origin_mm = {-31.25, 12.5, -107.0};
  grid.spacing_mm = {0.8, 0.9, 1.5};
  return grid;
}

CtVolume asymmetric_ct(const CtGrid& grid) {
  std::vector<std::int16_t> hu;
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i) {
        const bool inside = i > 1 && j > 0;
        const int base = inside ? (k > 2 && i > 4 ? 900 : 20) : -1000;
        hu.push_back(static_cast<std::int16_t>(base + i + 7 * j + 13 * k));
      }
  CtVolume ct;
  ct.grid = grid;
  ct.hu = SharedArray<std::int16_t>(std::move(hu));
  return ct;
}

void write_dicom_series(const CtVolume& ct,
                        const std::filesystem::path& folder,
                        const SliceEdit& edit,
                        const std::string& series_uid,
                        const std::string& name_prefix) {
  std::filesystem::create_directories(folder);
  const auto& direction = ct.grid.direction;
  for (int k = 0; k < ct.grid.size[2]; ++k) {
    const Eigen::Vector3d position = ct.grid.point_mm({0, 0, static_cast<double>(k)});
    DicomTestFile file;
    file.set_text({0x0008, 0x0016}, "UI", "1.2.840.10008.5.1.4.1.1.2");
    file.set_text({0x0008, 0x0018}, "UI", series_uid + "." + std::to_string(k + 1));
    file.set_text({0x0008, 0x0060}, "CS", "CT");
    file.set_text({0x0008, 0x103e}, "LO", "test series " + name_prefix);
    file.set_text({0x0020, 0x000e}, "UI", series_uid);
    file.set_text({0x0020, 0x0032}, "DS", decimals(position.x(), position.y(), position.z()));
    file.set_text({0x0020, 0x0037},
                  "DS",
                  decimals(direction(0, 0),
                           direction(1, 0),
                           direction(2, 0),
                           direction(0, 1),
                           direction(1, 1),
                           direction(2, 1)));
    file.set_u16({0x0028, 0x0002}, 1);
    file.set_text({0x0028, 0x0004}, "CS", "MONOCHROME2");
    file.set_u16({0x0028, 0x0010}, static_cast<std::uint16_t>(ct.grid.size[1]));
    file.set_u16({0x0028, 0x0011}, static_cast<std::uint16_t>(ct.grid.size[0]));
    file.set_text({0x0028, 0x0030}, "DS", decimals(ct.grid.spacing_mm.y(), ct.grid.spacing_mm.x()));
    file.set_u16({0x0028, 0x0100}, 16);
    file.set_u16({0x0028, 0x0101}, 16);
    file.set_u16({0x0028, 0x0102}, 15);
    file.set_u16({0x0028, 0x0103}, 1);
    file.set_text({0x0028, 0x1052}, "DS", decimals(kIntercept));
    file.set_text({0x0028, 0x1053}, "DS", "1");
    file.set_pixels(stored_pixels(ct, k));
    if (edit) edit(k, file);
    // Multiplying by 3 modulo 101 shuffles the names of fewer than 101 slices.
    const int scrambled = (3 * (k + 1)) % 101;
    file.write(folder / (name_prefix + std::to_string(scrambled) + ".dcm"));
  }
}

DicomTestFile xa_file(int columns, int rows, int frames, const std::vector<int>& levels) {
  DicomTestFile file;
  file.set_text({0x0008, 0x0016}, "UI", "1.2.840.10008.5.1.4.1.1.12.1");
  file.set_text({0x0008, 0x0060}, "CS", "XA");
  file.set_text({0x0018, 0x1164}, "DS", "0.4\\0.4");
  file.set_u16({0x0028, 0x0002}, 1);
  file.set_text({0x0028, 0x0004}, "CS", "MONOCHROME2");
  if (frames > 1) file.set_text({0x0028, 0x0008}, "IS", std::to_string(frames));
  file.set_u16({0x0028, 0x0010}, static_cast<std::uint16_t>(rows));
  file.set_u16({0x0028, 0x0011}, static_cast<std::uint16_t>(columns));
  file.set_u16({0x0028, 0x0100}, 16);
  file.set_u16({0x0028, 0x0101}, 12);
  file.set_u16({0x0028, 0x0102}, 11);
  file.set_u16({0x0028, 0x0103}, 0);
  file.set_text({0x0028, 0x1040}, "CS", "LIN");
  file.set_text({0x0028, 0x1050}, "DS", "40");
  file.set_text({0x0028, 0x1051}, "DS", "80");
  std::vector<std::int16_t> pixels;
  for (int frame = 0; frame < frames; ++frame)
    for (const int level : levels) pixels.push_back(static_cast<std::int16_t>(level + frame));
  file.set_pixels(pixels);
  return file;
}

}  // namespace af::test
