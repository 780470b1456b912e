// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace af {

/// (group, element).
using DicomTag = std::pair<std::uint16_t, std::uint16_t>;

/// The top-level elements of a DICOM file, read by walking its structure to the end of the pixel
/// data. GDCM is only shown files that passed here: Debian's build of it aborts the process on a
/// header that is cut short, and takes cut pixel data for granted.
class DicomElements {
 public:
  /// FileError when the file is cut short or its structure is broken; InputError when its transfer
  /// syntax is not supported (deflated, unknown).
  static DicomElements read(const std::filesystem::path& path);

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] bool has_pixels() const { return has_pixels_; }
  /// In fragments of an encoded stream, not one plain value.
  [[nodiscard]] bool has_compressed_pixels() const { return has_compressed_pixels_; }
  /// Bytes of pixel data that stand in the file.
  [[nodiscard]] std::uint64_t pixel_bytes() const { return pixel_bytes_; }
  /// An element as text without padding; numbers in binary are written out. Empty when absent.
  [[nodiscard]] std::string text(DicomTag tag) const;
  /// Backslash-separated numbers; empty when the element is absent, InputError naming `name` when
  /// it holds anything but finite numbers.
  [[nodiscard]] std::vector<double> numbers(DicomTag tag, const char* name) const;
  [[nodiscard]] std::optional<double> number_or_none(DicomTag tag, const char* name) const;

 private:
  friend class DicomWalker;
  std::filesystem::path path_;
  std::map<DicomTag, std::string> texts_;
  bool has_pixels_ = false;
  bool has_compressed_pixels_ = false;
  std::uint64_t pixel_bytes_ = 0;
};

/// True for a file with the mark of DICOM, or without its preamble as old files are. Reads a few
/// bytes only.
bool is_marked_dicom(const std::filesystem::path& path);
bool may_be_bare_dicom(const std::filesystem::path& path);

}  // namespace af
