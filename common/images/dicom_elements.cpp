// SPDX-License-Identifier: Apache-2.0
#include "images/dicom_elements.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <fstream>
#include <limits>
#include <optional>
#include <string_view>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parsed_number.h"
#include "base/toml_text.h"
#include "files/input_file.h"
#include "files/input_guard.h"
#include "images/file_bytes.h"

namespace af {

namespace fs = std::filesystem;

namespace {

constexpr std::uint32_t kUndefinedLength = 0xffffffffu;
constexpr std::uint64_t kPreambleBytes = 132;
constexpr std::uint64_t kLongestKeptValue = 4096;
constexpr int kMaxDepth = 16;
constexpr DicomTag kItem = {0xfffe, 0xe000};
constexpr DicomTag kItemEnd = {0xfffe, 0xe00d};
constexpr DicomTag kSequenceEnd = {0xfffe, 0xe0dd};
constexpr DicomTag kTransferSyntax = {0x0002, 0x0010};
constexpr DicomTag kPixelData = {0x7fe0, 0x0010};
constexpr DicomTag kLutDescriptor = {0x0028, 0x3002};
constexpr DicomTag kLutData = {0x0028, 0x3006};
constexpr std::uint64_t kLongestLut = 1U << 18;
/// How many values within sequences one file may have. A moving C-arm has tens per frame.
constexpr std::size_t kMostNestedValues = std::size_t{1} << 20;

/// Sequences whose items are kept: Modality LUT; shared and per-frame functional groups, and of
/// these geometry, positioner, isocentre, field of view, pixel properties and intensity
/// relationship.
bool is_kept_sequence(DicomTag tag) {
  constexpr std::array<DicomTag, 9> kKept = {{{0x0028, 0x3000},
                                              {0x5200, 0x9229},
                                              {0x5200, 0x9230},
                                              {0x0018, 0x9405},
                                              {0x0018, 0x9432},
                                              {0x0018, 0x9462},
                                              {0x0018, 0x9476},
                                              {0x0028, 0x9443},
                                              {0x0028, 0x9422}}};
  return std::find(kKept.begin(), kKept.end(), tag) != kKept.end();
}

/// Value representations with a 4-byte length, and those with a 2-byte one (PS3.5, 7.1.2).
constexpr std::string_view kLongForms = "OB OD OF OL OV OW SQ SV UC UN UR UT UV ";
constexpr std::string_view kShortForms =
    "AE AS AT CS DA DS DT FL FD IS LO LT PN SH SL SS ST TM UI UL US ";

bool is_one_of(std::string_view forms, std::string_view form) {
  for (std::size_t at = 0; at < forms.size(); at += 3)
    if (forms.substr(at, 2) == form) return true;
  return false;
}

/// Bytes of one number in a binary form; 1 for text.
std::uint32_t unit_bytes(std::string_view form) {
  if (form == "US" || form == "SS") return 2;
  if (form == "UL" || form == "SL" || form == "FL" || form == "AT") return 4;
  return form == "FD" ? 8 : 1;
}

std::string trimmed(std::string text) {
  const auto is_padding = [](char c) { return c == ' ' || c == '\0' || c == '\t'; };
  while (!text.empty() && is_padding(text.back())) text.pop_back();
  std::size_t first = 0;
  while (first < text.size() && is_padding(text[first])) ++first;
  return text.substr(first);
}

struct Encoding {
  bool is_explicit = true;
  bool is_big_endian = false;
};

/// The form of elements that are read as binary numbers in implicit files, which do not state
/// forms. Empty for the others.
std::string_view implicit_form(DicomTag tag) {
  constexpr std::array<std::uint16_t, 9> kUnsigned = {
      0x0002, 0x0010, 0x0011, 0x0100, 0x0101, 0x0102, 0x0103, 0x0120, 0x0121};
  const auto [group, element] = tag;
  if (group == 0x0018 && (element == 0x9402 || (element >= 0x9463 && element <= 0x9471)))
    return "FL";
  if (group != 0x0028) return "";
  if (element == 0x1041) return "SS";
  return std::find(kUnsigned.begin(), kUnsigned.end(), element) != kUnsigned.end() ? "US" : "";
}

/// Numbers in binary as text, with backslashes between them.
template <typename Number>
std::string numbers_text(std::string_view bytes, bool is_big_endian) {
  const bool is_swapped = is_big_endian != (std::endian::native == std::endian::big);
  std::string text;
  for (std::size_t at = 0; at + sizeof(Number) <= bytes.size(); at += sizeof(Number))
    text += (at > 0 ? "\\" : "") +
            number_text(static_cast<double>(number_at<Number>(bytes, at, is_swapped)));
  return text;
}

}  // namespace

/// Walks the elements of one file, never past its end.
class DicomWalker {
 public:
  explicit DicomWalker(const fs::path& path)
      : path_(path.string()), file_(open_input_file(path)), size_(fs::file_size(path)) {
    elements_.path_ = path;
  }

  DicomElements walk() {
    at_ = is_marked_dicom(elements_.path_) ? kPreambleBytes : 0;
    DicomValues* const top = &elements_.values_;
    while (at_ < size_ && peek_group() == 0x0002) read_element({}, size_, 0, top);
    const Encoding encoding = data_encoding();
    elements_.is_big_endian_ = encoding.is_big_endian;
    while (at_ < size_ && !elements_.has_pixels()) read_element(encoding, size_, 0, top);
    return std::move(elements_);
  }

 private:
  struct Header {
    DicomTag tag;
    std::string form;  ///< empty in implicit files
    std::uint32_t length = 0;
  };

  [[noreturn]] void fail(const std::string& what) const {
    throw FileError(path_, "broken DICOM at byte " + std::to_string(at_) + ": " + what);
  }

  void need(std::uint64_t bytes, std::uint64_t end) const {
    if (bytes <= end - at_) return;
    if (end == size_)
      throw FileError(path_,
                      "truncated: byte " + std::to_string(at_ + bytes) +
                          " is needed, the file has " + std::to_string(size_));
    fail("an element reaches beyond the one it stands in");
  }

  std::string take(std::uint64_t bytes, std::uint64_t end) {
    need(bytes, end);
    std::string value(bytes, '\0');
    file_.seekg(static_cast<std::streamoff>(at_));
    file_.read(value.data(), static_cast<std::streamsize>(bytes));
    if (!file_) fail("cannot be read");
    at_ += bytes;
    return value;
  }

  static std::uint32_t number(std::string_view bytes, bool is_big_endian) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      const auto byte = static_cast<unsigned char>(bytes[is_big_endian ? i : bytes.size() - 1 - i]);
      value = value << 8 | byte;
    }
    return value;
  }

  std::uint16_t peek_group() {
    const std::uint64_t start = at_;
    const auto group = static_cast<std::uint16_t>(number(take(2, size_), false));
    at_ = start;
    return group;
  }

  Encoding data_encoding() {
    const std::string syntax = elements_.text(kTransferSyntax);
    if (syntax == "1.2.840.10008.1.2") return {false, false};
    if (syntax == "1.2.840.10008.1.2.2") return {true, true};
    if (syntax == "1.2.840.10008.1.2.1.99")
      throw InputError("transfer syntax", syntax, "deflated DICOM is not supported", path_);
    if (!syntax.empty() && !syntax.starts_with("1.2.840.10008.1.2."))
      throw InputError("transfer syntax", syntax, "is not known", path_);
    if (!syntax.empty() || size_ - at_ < 6) return {};
    // A file without file header is explicit when a known form stands behind its first tag.
    const std::uint64_t start = at_;
    const std::string first = take(6, size_);
    at_ = start;
    const std::string form = first.substr(4);
    return {is_one_of(kLongForms, form) || is_one_of(kShortForms, form), false};
  }

  Header read_header(const Encoding& encoding, std::uint64_t end) {
    Header header;
    const std::string bytes = take(8, end);
    const bool big = encoding.is_big_endian;
    const std::string_view view(bytes);
    header.tag = {static_cast<std::uint16_t>(number(view.substr(0, 2), big)),
                  static_cast<std::uint16_t>(number(view.substr(2, 2), big))};
    if (!encoding.is_explicit || header.tag.first == 0xfffe) {
      header.length = number(view.substr(4, 4), big);
      return header;
    }
    header.form = bytes.substr(4, 2);
    if (is_one_of(kLongForms, header.form))
      header.length = number(take(4, end), big);
    else if (is_one_of(kShortForms, header.form))
      header.length = number(view.substr(6, 2), big);
    else
      fail("unknown value representation");
    return header;
  }

  /// Its value goes to `into`, unless that is nullptr.
  void read_element(const Encoding& encoding, std::uint64_t end, int depth, DicomValues* into) {
    const Header header = read_header(encoding, end);
    if (header.tag.first == 0xfffe) fail("an item outside of a sequence");
    if (depth == 0) elements_.tags_.insert(header.tag);
    const bool is_pixels = depth == 0 && header.tag == kPixelData;
    if (is_pixels) elements_.has_pixel_words_ = header.form != "OB";
    if (header.length == kUndefinedLength) {
      if (is_pixels)
        read_fragments(encoding, end);
      else  // an unknown form of undefined length holds implicit elements (PS3.5, 6.2.2)
        read_items(header.form == "UN" ? Encoding{false, false} : encoding,
                   end,
                   true,
                   depth + 1,
                   kept_sequence(header.tag, into));
    } else {
      need(header.length, end);
      if (header.length % unit_bytes(header.form) != 0) fail("a length that does not fit its form");
      if (header.form == "SQ" || is_implicit_sequence(header, into))
        read_items(
            encoding, at_ + header.length, false, depth + 1, kept_sequence(header.tag, into));
      else if (into != nullptr && header.length <= longest_kept(header.tag) && !is_pixels)
        keep(header, take(header.length, end), encoding.is_big_endian, depth, *into);
      else
        skip(header.length, is_pixels);
    }
  }

  static std::uint64_t longest_kept(DicomTag tag) {
    return tag == kLutData ? kLongestLut : kLongestKeptValue;
  }

  /// Implicit files do not say that an element of stated length is a sequence.
  static bool is_implicit_sequence(const Header& header, const DicomValues* into) {
    return header.form.empty() && into != nullptr && is_kept_sequence(header.tag);
  }

  /// Where the items of a sequence go; nullptr where they are skipped.
  static std::vector<DicomValues>* kept_sequence(DicomTag tag, DicomValues* into) {
    return into != nullptr && is_kept_sequence(tag) ? &into->sequences_[tag] : nullptr;
  }

  void read_items(const Encoding& encoding,
                  std::uint64_t end,
                  bool until_mark,
                  int depth,
                  std::vector<DicomValues>* items) {
    if (depth > kMaxDepth) fail("sequences are nested too deeply");
    while (until_mark || at_ < end) {
      const Header item = read_header(encoding, end);
      if (until_mark && item.tag == kSequenceEnd) return;
      if (item.tag != kItem) fail("a sequence holds something that is no item");
      DicomValues* const into = items == nullptr ? nullptr : &items->emplace_back();
      if (into != nullptr) count_nested();
      if (item.length == kUndefinedLength) {
        while (!at_item_end(encoding, end)) read_element(encoding, end, depth, into);
      } else {
        need(item.length, end);
        const std::uint64_t item_end = at_ + item.length;
        while (at_ < item_end) read_element(encoding, item_end, depth, into);
      }
    }
  }

  bool at_item_end(const Encoding& encoding, std::uint64_t end) {
    const std::uint64_t start = at_;
    const std::string bytes = take(8, end);
    const std::string_view view(bytes);
    const bool big = encoding.is_big_endian;
    if (number(view.substr(0, 2), big) == kItemEnd.first &&
        number(view.substr(2, 2), big) == kItemEnd.second)
      return true;
    at_ = start;
    return false;
  }

  void skip(std::uint32_t bytes, bool is_pixels) {
    if (is_pixels) elements_.pixel_parts_.push_back({at_, bytes});
    at_ += bytes;
  }

  void read_fragments(const Encoding& encoding, std::uint64_t end) {
    elements_.has_compressed_pixels_ = true;
    for (;;) {
      const Header fragment = read_header(encoding, end);
      if (fragment.tag == kSequenceEnd) return;
      if (fragment.tag != kItem || fragment.length == kUndefinedLength)
        fail("compressed pixels hold something that is no fragment");
      need(fragment.length, end);
      skip(fragment.length, true);
    }
  }

  void count_nested() {
    if (++nested_values_ > kMostNestedValues) fail("its sequences hold too many values");
  }

  void keep(const Header& header,
            const std::string& bytes,
            bool is_big_endian,
            int depth,
            DicomValues& into) {
    if (depth > 0) count_nested();
    const std::string_view form =
        header.form.empty() ? implicit_form(header.tag) : std::string_view(header.form);
    const bool is_lut = header.tag == kLutData || header.tag == kLutDescriptor;
    std::string& text = into.texts_[header.tag];
    if (form == "FL")
      text = numbers_text<float>(bytes, is_big_endian);
    else if (form == "FD")
      text = numbers_text<double>(bytes, is_big_endian);
    else if (form == "SS")
      text = numbers_text<std::int16_t>(bytes, is_big_endian);
    else if (form == "US" || is_lut)
      text = numbers_text<std::uint16_t>(bytes, is_big_endian);
    else
      text = trimmed(bytes);
  }

  std::string path_;
  std::ifstream file_;
  std::uint64_t size_ = 0;
  std::uint64_t at_ = 0;
  std::size_t nested_values_ = 0;
  DicomElements elements_;
};

DicomElements DicomElements::read(const fs::path& path) {
  note_input(path);
  return DicomWalker(path).walk();
}

const DicomValues* functional_group(const DicomElements& header, int frame, DicomTag macro) {
  const std::vector<DicomValues>& frames = header.values().items({0x5200, 0x9230});
  const auto at = static_cast<std::size_t>(frame - 1);
  if (frame >= 1 && at < frames.size() && !frames[at].items(macro).empty())
    return &frames[at].item(macro);
  const DicomValues& shared = header.values().item({0x5200, 0x9229});
  return shared.items(macro).empty() ? nullptr : &shared.item(macro);
}

std::optional<Eigen::Vector2d> dicom_spacing_mm(const DicomValues& values,
                                                DicomTag tag,
                                                const char* name,
                                                const std::string& file) {
  const std::vector<double> found = values.numbers(tag, name, file);
  if (found.empty()) return std::nullopt;
  if (found.size() != 2 || !(found[0] > 0.0 && found[1] > 0.0))
    throw InputError(name, "'" + values.text(tag) + "'", "must be two positive numbers (mm)", file);
  return Eigen::Vector2d(found[1], found[0]);
}

std::optional<Eigen::Vector2d> imager_spacing_mm(const DicomElements& header, int frame) {
  constexpr DicomTag kPixelProperties = {0x0028, 0x9443};
  constexpr DicomTag kImagerSpacing = {0x0018, 0x1164};
  constexpr const char* kName = "ImagerPixelSpacing (0018,1164)";
  const std::string file = header.path().string();
  if (const DicomValues* const pixels = functional_group(header, frame, kPixelProperties);
      pixels != nullptr)
    if (auto spacing = dicom_spacing_mm(*pixels, kImagerSpacing, kName, file)) return spacing;
  return dicom_spacing_mm(header.values(), kImagerSpacing, kName, file);
}

std::uint64_t DicomElements::pixel_bytes() const {
  std::uint64_t bytes = 0;
  for (const DicomPart& part : pixel_parts_) bytes += part.bytes;
  return bytes;
}

std::string DicomValues::text(DicomTag tag) const {
  const auto found = texts_.find(tag);
  return found == texts_.end() ? std::string() : found->second;
}

const std::vector<DicomValues>& DicomValues::items(DicomTag sequence) const {
  static const std::vector<DicomValues> none;
  const auto found = sequences_.find(sequence);
  return found == sequences_.end() ? none : found->second;
}

const DicomValues& DicomValues::item(DicomTag sequence) const {
  static const DicomValues none;
  const std::vector<DicomValues>& all = items(sequence);
  return all.empty() ? none : all.front();
}

std::vector<double> DicomValues::numbers(DicomTag tag,
                                         const char* name,
                                         const std::string& file) const {
  constexpr std::size_t kMostBytes = 200;  // of the text in the message
  const std::string all = text(tag);
  std::vector<double> values;
  for (std::size_t at = 0; at < all.size();) {
    const std::size_t end = std::min(all.find('\\', at), all.size());
    const std::optional<double> value = finite_number(trimmed(all.substr(at, end - at)));
    if (!value)
      throw InputError(
          name, "'" + beginning_of(all, kMostBytes) + "'", "must be finite numbers", file);
    values.push_back(*value);
    at = end + 1;
  }
  return values;
}

std::optional<double> DicomElements::number_or_none(DicomTag tag, const char* name) const {
  const std::vector<double> values = numbers(tag, name);
  if (values.empty()) return std::nullopt;
  return values.front();
}

bool is_marked_dicom(const fs::path& path) {
  std::ifstream file = open_input_file(path);
  std::array<char, kPreambleBytes> start{};
  file.read(start.data(), start.size());
  return file.gcount() == static_cast<std::streamsize>(start.size()) &&
         std::memcmp(start.data() + 128, "DICM", 4) == 0;
}

bool may_be_bare_dicom(const fs::path& path) {
  // Files without the mark begin directly with an element of group 0002 or 0008.
  std::ifstream file = open_input_file(path);
  std::array<unsigned char, 4> start{};
  file.read(reinterpret_cast<char*>(start.data()), start.size());
  return file.gcount() == 4 && (start[0] == 0x08 || start[0] == 0x02) && start[1] == 0 &&
         start[3] == 0;
}

}  // namespace af
