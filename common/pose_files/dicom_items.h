// SPDX-License-Identifier: Apache-2.0
// A small DICOM data set with its sequences, in memory, read and written: what a spatial
// registration is made of. Images are read by image_files/dicom_elements.h, from the file.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace af {

/// An item: elements (group, element) with values as text, and sequences of items.
struct DicomItem {
  using Tag = std::pair<std::uint16_t, std::uint16_t>;
  std::map<Tag, std::string> texts;  ///< without padding; binary numbers as their bytes
  std::map<Tag, std::vector<DicomItem>> sequences;

  /// Empty when the element is absent.
  [[nodiscard]] std::string text(Tag tag) const;
  [[nodiscard]] const std::vector<DicomItem>& items(Tag tag) const;
};

bool is_dicom_bytes(std::string_view bytes);

/// The data set of a DICOM file, little endian, its pixels and values beyond 64 KiB left out.
/// FileError naming `file` when it is cut short, its structure is broken or nested more than 16
/// deep, InputError for other transfer syntaxes.
DicomItem dicom_item_of_bytes(std::string_view bytes, const std::string& file);

/// One element to write; `form` is its value representation ("UI"). A sequence has items instead.
struct DicomElementToWrite {
  DicomItem::Tag tag;
  std::string form;
  std::string value;
  std::vector<std::vector<DicomElementToWrite>> items;
};

/// A file (PS3.10) in explicit little endian of elements in ascending order of their tags;
/// group 0002 is added.
std::string dicom_file_bytes(const std::vector<DicomElementToWrite>& elements,
                             const std::string& sop_class_uid,
                             const std::string& sop_instance_uid);

}  // namespace af
