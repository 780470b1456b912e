// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace af::test {

/// A DICOM file (explicit VR, little endian) written byte by byte, independently of the library
/// that reads it, so that tests can also write wrong ones.
class DicomTestFile {
 public:
  using Tag = std::pair<std::uint16_t, std::uint16_t>;

  void set_text(Tag tag, const std::string& vr, std::string value) {
    if (value.size() % 2 != 0) value += vr == "UI" ? '\0' : ' ';
    elements_[tag] = {vr, std::move(value)};
  }
  void set_u16(Tag tag, std::uint16_t value) {
    std::string bytes;
    append(bytes, value, 2);
    elements_[tag] = {"US", bytes};
  }
  void set_pixels(const std::vector<std::int16_t>& pixels) {
    std::string bytes;
    for (const std::int16_t pixel : pixels) append(bytes, static_cast<std::uint16_t>(pixel), 2);
    elements_[{0x7fe0, 0x0010}] = {"OW", bytes};
  }
  /// Pixels as one compressed fragment behind an empty offset table.
  void set_fragment(const std::string& transfer_syntax, std::string bytes) {
    if (bytes.size() % 2 != 0) bytes += '\0';
    std::string stream;
    for (const std::string& item : {std::string(), bytes}) {
      append(stream, 0xe000fffe, 4);
      append(stream, item.size(), 4);
      stream += item;
    }
    append(stream, 0xe0ddfffe, 4);
    append(stream, 0, 4);
    elements_[{0x7fe0, 0x0010}] = {"OB", stream};
    transfer_syntax_ = transfer_syntax;
    if (transfer_syntax_.size() % 2 != 0) transfer_syntax_ += '\0';
  }
  /// A sequence of items, each with the elements of another file; of stated or undefined length.
  void set_items(Tag tag, const std::vector<DicomTestFile>& items, bool is_undefined = false) {
    std::string bytes;
    for (const DicomTestFile& item : items) {
      std::string inner;
      for (const auto& [inner_tag, element] : item.elements_)
        append_element(inner, inner_tag, element);
      append(bytes, 0xe000fffe, 4);
      append(bytes, is_undefined ? 0xffffffff : inner.size(), 4);
      bytes += inner;
      if (is_undefined) bytes += std::string("\xfe\xff\x0d\xe0\0\0\0\0", 8);
    }
    if (is_undefined) bytes += std::string("\xfe\xff\xdd\xe0\0\0\0\0", 8);
    elements_[tag] = {is_undefined ? "SQ*" : "SQ", bytes};
  }
  void set_u16s(Tag tag, const std::vector<std::uint16_t>& values, const std::string& vr = "US") {
    std::string bytes;
    for (const std::uint16_t value : values) append(bytes, value, 2);
    elements_[tag] = {vr, bytes};
  }
  void set_float(Tag tag, float value) {
    std::string bytes;
    append(bytes, std::bit_cast<std::uint32_t>(value), 4);
    elements_[tag] = {"FL", bytes};
  }
  void erase(Tag tag) { elements_.erase(tag); }

  void write(const std::filesystem::path& path) const {
    std::string meta;
    append_element(meta, {0x0002, 0x0002}, {"UI", text_or({0x0008, 0x0016})});
    append_element(meta, {0x0002, 0x0003}, {"UI", text_or({0x0008, 0x0018})});
    append_element(meta, {0x0002, 0x0010}, {"UI", transfer_syntax_});
    std::string length;
    append(length, meta.size(), 4);
    std::string bytes(128, '\0');
    bytes += "DICM";
    append_element(bytes, {0x0002, 0x0000}, {"UL", length});
    bytes += meta;
    for (const auto& [tag, element] : elements_) append_element(bytes, tag, element);
    std::ofstream(path, std::ios::binary) << bytes;
  }

 private:
  struct Element {
    std::string vr;
    std::string bytes;
  };

  static void append(std::string& bytes, std::uint64_t value, int count) {
    for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xff);
  }
  static void append_element(std::string& bytes, Tag tag, const Element& element) {
    append(bytes, tag.first, 2);
    append(bytes, tag.second, 2);
    bytes += element.vr.substr(0, 2);
    if (element.vr == "OW" || element.vr == "OB" || element.vr.starts_with("SQ")) {
      append(bytes, 0, 2);
      // Fragments and some sequences have their own end mark: undefined length.
      const bool is_undefined = element.vr == "OB" || element.vr == "SQ*";
      append(bytes, is_undefined ? 0xffffffff : element.bytes.size(), 4);
    } else {
      append(bytes, element.bytes.size(), 2);
    }
    bytes += element.bytes;
  }
  [[nodiscard]] std::string text_or(Tag tag) const {
    const auto found = elements_.find(tag);
    return found == elements_.end() ? std::string() : found->second.bytes;
  }

  std::map<Tag, Element> elements_;
  std::string transfer_syntax_ = std::string("1.2.840.10008.1.2.1\0", 20);
};

}  // namespace af::test
