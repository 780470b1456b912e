// SPDX-License-Identifier: Apache-2.0
#include "pose_files/dicom_items.h"

#include "base/error.h"

namespace af {
namespace {

using Tag = DicomItem::Tag;

constexpr std::size_t kPreambleBytes = 132;
constexpr std::uint32_t kUndefined = 0xffffffffu;
constexpr std::size_t kLongestKept = 1u << 16;
constexpr int kDeepest = 16;
constexpr Tag kItemTag = {0xfffe, 0xe000};
constexpr Tag kItemEndTag = {0xfffe, 0xe00d};
constexpr Tag kSequenceEndTag = {0xfffe, 0xe0dd};
constexpr Tag kPixelDataTag = {0x7fe0, 0x0010};
constexpr Tag kSyntaxTag = {0x0002, 0x0010};
constexpr const char* kExplicitLittle = "1.2.840.10008.1.2.1";
constexpr const char* kImplicitLittle = "1.2.840.10008.1.2";

/// Value representations with a length of four bytes behind two empty ones (PS3.5, 7.1.2).
bool has_long_length(std::string_view form) {
  constexpr std::string_view kForms = "OB OD OF OL OV OW SQ SV UC UN UR UT UV ";
  const std::size_t at = kForms.find(std::string(form) + " ");
  return at != std::string_view::npos && at % 3 == 0;
}

bool is_form(std::string_view form) {
  return form.size() == 2 && form[0] >= 'A' && form[0] <= 'Z' && form[1] >= 'A' && form[1] <= 'Z';
}

/// In implicit files the sequences of a registration are known by their tags.
bool is_known_sequence(Tag tag) {
  return tag == Tag{0x0070, 0x0308} || tag == Tag{0x0070, 0x0309} || tag == Tag{0x0070, 0x030a};
}

std::string without_padding(std::string_view text) {
  constexpr std::string_view kPadding("\0 ", 2);
  const std::size_t last = text.find_last_not_of(kPadding);
  if (last == std::string_view::npos) return {};
  const std::size_t first = text.find_first_not_of(' ');
  return std::string(text.substr(first, last + 1 - first));
}

/// Walks elements, never past the end.
class ItemParser {
 public:
  ItemParser(std::string_view bytes, std::string file) : bytes_(bytes), file_(std::move(file)) {}

  DicomItem parse() {
    at_ = is_dicom_bytes(bytes_) ? kPreambleBytes : 0;
    DicomItem item;
    while (at_ < bytes_.size() && group_ahead() == 0x0002) element(item, bytes_.size(), 0);
    const std::string syntax = item.text(kSyntaxTag);
    if (syntax != kExplicitLittle && syntax != kImplicitLittle)
      throw InputError("transfer syntax",
                       syntax.empty() ? "none" : syntax,
                       "must be explicit or implicit little endian",
                       file_);
    is_explicit_ = syntax == kExplicitLittle;
    while (at_ < bytes_.size() && !is_at_pixels_) element(item, bytes_.size(), 0);
    return item;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw FileError(file_, "broken DICOM at byte " + std::to_string(at_) + ": " + what);
  }

  std::string_view take(std::size_t count, std::size_t end) {
    if (count > end - at_) fail(end == bytes_.size() ? "truncated" : "an element is too long");
    const std::string_view taken = bytes_.substr(at_, count);
    at_ += count;
    return taken;
  }

  std::uint32_t number(std::size_t count, std::size_t end) {
    const std::string_view bytes = take(count, end);
    std::uint32_t value = 0;
    for (std::size_t i = count; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[i]);
    return value;
  }

  std::uint32_t group_ahead() {
    const std::size_t start = at_;
    const std::uint32_t group = number(2, bytes_.size());
    at_ = start;
    return group;
  }

  Tag tag(std::size_t end) {
    const auto group = static_cast<std::uint16_t>(number(2, end));
    return {group, static_cast<std::uint16_t>(number(2, end))};
  }

  void element(DicomItem& item, std::size_t end, int depth) {
    const Tag tag_read = tag(end);
    if (tag_read.first == 0xfffe) fail("an item outside of a sequence");
    std::string form;
    std::uint32_t length = 0;
    if (is_explicit_) {
      form = take(2, end);
      if (!is_form(form)) fail("unknown value representation");
      if (has_long_length(form)) take(2, end);
      length = number(has_long_length(form) ? 4 : 2, end);
    } else {
      length = number(4, end);
      if (is_known_sequence(tag_read)) form = "SQ";
    }
    if (depth == 0 && tag_read == kPixelDataTag) {
      is_at_pixels_ = true;
      return;
    }
    if (form == "SQ" || length == kUndefined) {
      const bool was_explicit = is_explicit_;
      if (form == "UN") is_explicit_ = false;  // PS3.5, 6.2.2
      sequence(item.sequences[tag_read], length, end, depth + 1);
      is_explicit_ = was_explicit;
      return;
    }
    const std::string_view value = take(length, end);
    if (value.size() <= kLongestKept) item.texts[tag_read] = without_padding(value);
  }

  void sequence(std::vector<DicomItem>& items, std::uint32_t length, std::size_t end, int depth) {
    if (depth > kDeepest) fail("sequences are nested too deeply");
    const bool is_open = length == kUndefined;
    if (!is_open && length > end - at_) fail("a sequence is too long");
    const std::size_t sequence_end = is_open ? end : at_ + length;
    while (is_open || at_ < sequence_end) {
      const Tag mark = tag(sequence_end);
      const std::uint32_t item_length = number(4, sequence_end);
      if (is_open && mark == kSequenceEndTag) return;
      if (mark != kItemTag) fail("a sequence holds something that is no item");
      items.emplace_back();
      if (item_length != kUndefined && item_length > sequence_end - at_)
        fail("an item is too long");
      const std::size_t item_end = item_length == kUndefined ? sequence_end : at_ + item_length;
      while (item_length == kUndefined ? !passes_item_end(item_end) : at_ < item_end)
        element(items.back(), item_end, depth);
    }
  }

  bool passes_item_end(std::size_t end) {
    const std::size_t start = at_;
    const bool is_end = tag(end) == kItemEndTag;
    at_ = is_end ? start + 8 : start;
    if (at_ > end) fail("truncated");
    return is_end;
  }

  std::string_view bytes_;
  std::string file_;
  std::size_t at_ = 0;
  bool is_explicit_ = true;
  bool is_at_pixels_ = false;
};

std::string little_endian(std::uint32_t value, int count) {
  std::string bytes;
  for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xffu);
  return bytes;
}

std::string element_bytes(const DicomElementToWrite& element) {
  std::string value = element.value;
  for (const auto& item : element.items) {
    std::string content;
    for (const DicomElementToWrite& inner : item) content += element_bytes(inner);
    value += little_endian(kItemTag.first, 2) + little_endian(kItemTag.second, 2) +
             little_endian(static_cast<std::uint32_t>(content.size()), 4) + content;
  }
  if (value.size() % 2 != 0) value += element.form == "UI" || element.form == "OB" ? '\0' : ' ';
  const bool is_long = has_long_length(element.form);
  return little_endian(element.tag.first, 2) + little_endian(element.tag.second, 2) + element.form +
         (is_long ? std::string(2, '\0') : "") +
         little_endian(static_cast<std::uint32_t>(value.size()), is_long ? 4 : 2) + value;
}

}  // namespace

std::string DicomItem::text(Tag tag) const {
  const auto found = texts.find(tag);
  return found == texts.end() ? std::string() : found->second;
}

const std::vector<DicomItem>& DicomItem::items(Tag tag) const {
  static const std::vector<DicomItem> none;
  const auto found = sequences.find(tag);
  return found == sequences.end() ? none : found->second;
}

bool is_dicom_bytes(std::string_view bytes) {
  return bytes.size() >= kPreambleBytes && bytes.substr(128, 4) == "DICM";
}

DicomItem dicom_item_of_bytes(std::string_view bytes, const std::string& file) {
  return ItemParser(bytes, file).parse();
}

std::string dicom_file_bytes(const std::vector<DicomElementToWrite>& elements,
                             const std::string& sop_class_uid,
                             const std::string& sop_instance_uid) {
  const std::vector<DicomElementToWrite> meta = {
      {{0x0002, 0x0001}, "OB", std::string("\0\1", 2), {}},
      {{0x0002, 0x0002}, "UI", sop_class_uid, {}},
      {{0x0002, 0x0003}, "UI", sop_instance_uid, {}},
      {kSyntaxTag, "UI", kExplicitLittle, {}},
      {{0x0002, 0x0012}, "UI", "2.25.194378151219367187215338912740285619473", {}}};
  std::string group;
  for (const DicomElementToWrite& element : meta) group += element_bytes(element);
  std::string bytes(128, '\0');
  bytes += "DICM";
  bytes += element_bytes({{0x0002, 0x0000},
                          "UL",
                          little_endian(static_cast<std::uint32_t>(group.size()), 4),
                          {}}) +
           group;
  for (const DicomElementToWrite& element : elements) bytes += element_bytes(element);
  return bytes;
}

}  // namespace af
