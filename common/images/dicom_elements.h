// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace af {

/// (group, element).
using DicomTag = std::pair<std::uint16_t, std::uint16_t>;

inline constexpr DicomTag kDicomFrameOfReference = {0x0020, 0x0052};

/// A stretch of a file.
struct DicomPart {
  std::uint64_t offset = 0;
  std::uint32_t bytes = 0;
};

/// Elements of a data set, or of an item of one of its sequences.
class DicomValues {
 public:
  /// An element as text without padding; numbers in binary are written out. Empty when absent.
  [[nodiscard]] std::string text(DicomTag tag) const;
  /// Backslash-separated numbers; empty when the element is absent. Throws InputError naming `name`
  /// and `file` when it holds anything but finite numbers.
  [[nodiscard]] std::vector<double> numbers(DicomTag tag,
                                            const char* name,
                                            const std::string& file) const;
  /// Items of the sequences that readers ask for: Modality LUT, functional groups and what they
  /// hold. Empty when absent.
  [[nodiscard]] const std::vector<DicomValues>& items(DicomTag sequence) const;
  /// The only or first item of a sequence; an empty one when it is absent.
  [[nodiscard]] const DicomValues& item(DicomTag sequence) const;

 private:
  friend class DicomWalker;
  std::map<DicomTag, std::string> texts_;
  std::map<DicomTag, std::vector<DicomValues>> sequences_;
};

/// The top-level elements of a DICOM file, read by walking its structure to the end of the pixel
/// data. GDCM's own parser is not used. On copies of a file that are cut within their data set,
/// version 3.0.21 ends the process for two thirds, and reads most others without their pixels.
class DicomElements {
 public:
  /// Throws FileError when the file is cut short or its structure is broken, InputError when its
  /// transfer syntax is not supported (deflated, unknown).
  static DicomElements read(const std::filesystem::path& path);

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Whether the element is there, whatever it holds. Includes sequences.
  [[nodiscard]] bool has(DicomTag tag) const { return tags_.contains(tag); }
  [[nodiscard]] bool has_pixels() const { return !pixel_parts_.empty(); }
  [[nodiscard]] bool has_compressed_pixels() const { return has_compressed_pixels_; }
  [[nodiscard]] bool is_big_endian() const { return is_big_endian_; }
  /// Whether pixels of 8 bits stand in words of two, whose bytes the byte order swaps.
  [[nodiscard]] bool has_pixel_words() const { return has_pixel_words_; }
  /// Where the pixel data are: one part, or the fragments of an encoded stream, whose first is its
  /// offset table.
  [[nodiscard]] const std::vector<DicomPart>& pixel_parts() const { return pixel_parts_; }
  /// Bytes of all parts.
  [[nodiscard]] std::uint64_t pixel_bytes() const;
  /// As in DicomValues, at the top level.
  [[nodiscard]] std::string text(DicomTag tag) const { return values_.text(tag); }
  [[nodiscard]] std::vector<double> numbers(DicomTag tag, const char* name) const {
    return values_.numbers(tag, name, path_.string());
  }
  [[nodiscard]] const DicomValues& values() const { return values_; }
  [[nodiscard]] std::optional<double> number_or_none(DicomTag tag, const char* name) const;

 private:
  friend class DicomWalker;
  std::filesystem::path path_;
  std::set<DicomTag> tags_;
  DicomValues values_;
  bool has_compressed_pixels_ = false;
  bool is_big_endian_ = false;
  bool has_pixel_words_ = false;
  std::vector<DicomPart> pixel_parts_;
};

/// An element of one frame (from 1) of an enhanced file. It comes from the macro's sequence in the
/// frame's functional groups, else from the shared ones, else it is nullptr. Files without
/// functional groups have none.
const DicomValues* functional_group(const DicomElements& header, int frame, DicomTag macro);

/// Column, row (mm), which DICOM states as "row\column"; none when the element is absent. Throws
/// InputError naming `name` and `file` when it is not two positive numbers.
std::optional<Eigen::Vector2d> dicom_spacing_mm(const DicomValues& values,
                                                DicomTag tag,
                                                const char* name,
                                                const std::string& file);

/// ImagerPixelSpacing (column, row; on the detector's plane) of a frame (from 1). It comes from the
/// frame's functional groups, else from the top level; none when the file states none. Throws
/// InputError when it is not two positive numbers.
std::optional<Eigen::Vector2d> imager_spacing_mm(const DicomElements& header, int frame);

/// True for a file with the mark of DICOM, or without its preamble, as old files are. Reads only a
/// few bytes.
bool is_marked_dicom(const std::filesystem::path& path);
bool may_be_bare_dicom(const std::filesystem::path& path);

}  // namespace af
