// SPDX-License-Identifier: Apache-2.0
#include "io/image_header.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <new>
#include <sstream>
#include <zlib.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "base/error.h"
#include "io/csv_table.h"

namespace af {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxTextHeaderBytes = 1u << 20;
constexpr std::uint64_t kMaxVoxels = std::uint64_t{1} << 32;
/// Deflate cannot expand a byte to more than this many.
constexpr std::uint64_t kMaxDeflateRatio = 1040;
constexpr float kMaxOrientation = 1e6f;
constexpr float kMinOrientation = 1e-30f;
constexpr std::size_t kNifti1HeaderBytes = 348;
constexpr std::size_t kNifti2HeaderBytes = 540;

std::string read_prefix(const fs::path& path, std::size_t bytes) {
  std::error_code error;
  if (!fs::exists(path, error)) throw FileError(path.string(), "does not exist");
  if (fs::is_directory(path, error)) throw FileError(path.string(), "is a folder, not a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw FileError(path.string(), "cannot be opened: " + std::string(strerror(errno)));
  std::string prefix(bytes, '\0');
  file.read(prefix.data(), static_cast<std::streamsize>(bytes));
  prefix.resize(static_cast<std::size_t>(file.gcount()));
  return prefix;
}

bool is_gzip(std::string_view bytes) {
  return bytes.starts_with("\x1f\x8b");
}

/// An inflating zlib stream (zlib or gzip wrapped) that releases itself.
class Inflater {
 public:
  Inflater() {
    // 15 bits of window; + 32 detects zlib or gzip framing by itself.
    if (inflateInit2(&stream_, 15 + 32) != Z_OK) throw std::bad_alloc();
  }
  ~Inflater() { inflateEnd(&stream_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  z_stream& stream() { return stream_; }

 private:
  z_stream stream_{};
};

/// First bytes of a file, inflated when it is gzip; fewer when there are not as many.
std::string read_inflated_prefix(const fs::path& path, std::size_t bytes) {
  constexpr std::size_t kInputBytes = 1u << 14;
  std::string input = read_prefix(path, std::max(bytes, kInputBytes));
  if (!is_gzip(input)) return input.substr(0, bytes);
  std::string prefix(bytes, '\0');
  Inflater inflater;
  z_stream& stream = inflater.stream();
  stream.next_in = reinterpret_cast<unsigned char*>(input.data());
  stream.avail_in = static_cast<unsigned>(input.size());
  stream.next_out = reinterpret_cast<unsigned char*>(prefix.data());
  stream.avail_out = static_cast<unsigned>(bytes);
  (void)inflate(&stream, Z_SYNC_FLUSH);  // what came out before an error is still told apart
  prefix.resize(bytes - stream.avail_out);
  return prefix;
}

bool looks_like_nifti(std::string_view header) {
  if (header.size() >= 348) {
    const std::string_view magic = header.substr(344, 3);
    if (magic == "n+1" || magic == "ni1") return true;
  }
  return header.size() >= 7 && (header.substr(4, 3) == "n+2" || header.substr(4, 3) == "ni2");
}

bool looks_like_meta_image(std::string_view header) {
  // MetaIO accepts any order of keys; NDims stands in every header.
  const std::string_view start = header.substr(0, 1024);
  return start.find("NDims") != std::string_view::npos &&
         (start.starts_with("ObjectType") || start.starts_with("NDims") ||
          start.starts_with("Comment"));
}

template <typename T>
T load(std::string_view bytes, std::size_t offset, bool swapped) {
  std::array<char, sizeof(T)> raw{};
  std::copy_n(bytes.data() + offset, sizeof(T), raw.begin());
  if (swapped) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

std::string trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(" \t\r") - first + 1));
}

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// "key = value" or "key: value" lines of a text header, with where it ends. MetaIO wants its keys
/// in their exact case; NRRD fields are kept in lower case.
struct TextHeader {
  std::string path;
  std::map<std::string, std::string> fields;
  std::uint64_t end_offset = 0;

  [[nodiscard]] const std::string* find(const std::string& key) const {
    const auto found = fields.find(key);
    return found == fields.end() ? nullptr : &found->second;
  }
  [[nodiscard]] const std::string& require(const std::string& key) const {
    const std::string* value = find(key);
    if (value == nullptr) throw FileError(path, "header has no '" + key + "'");
    return *value;
  }
  [[nodiscard]] std::int64_t integer(const std::string& key, std::int64_t fallback) const {
    const std::string* value = find(key);
    if (value == nullptr) return fallback;
    std::int64_t number = 0;
    const auto [end, error] = std::from_chars(value->data(), value->data() + value->size(), number);
    if (error != std::errc() || end != value->data() + value->size())
      throw FileError(path, "header field '" + key + "'", "an integer", "'" + *value + "'");
    return number;
  }
};

std::uint64_t checked_extent(const std::string& path, const std::string& text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number == 0)
    throw FileError(path, "size of an axis", "a positive integer", "'" + text + "'");
  return number;
}

std::vector<std::uint64_t> parse_sizes(const std::string& path,
                                       const std::string& text,
                                       std::int64_t dimension) {
  std::istringstream words(text);
  std::vector<std::uint64_t> sizes;
  for (std::string word; words >> word;) sizes.push_back(checked_extent(path, word));
  if (static_cast<std::int64_t>(sizes.size()) != dimension)
    throw FileError(path, "sizes", std::to_string(dimension) + " numbers", "'" + text + "'");
  return sizes;
}

std::int64_t checked_dimension(const TextHeader& header, const std::string& key) {
  (void)header.require(key);
  const std::int64_t dimension = header.integer(key, 0);
  if (dimension < 1 || dimension > 10)
    throw FileError(header.path, key, "1 to 10", std::to_string(dimension));
  return dimension;
}

/// Bytes of the voxels that a header promises; FileError when the product overflows or is absurd.
std::uint64_t checked_payload_bytes(const fs::path& path, const ImageHeader& header) {
  std::uint64_t voxels = 1;
  for (const std::uint64_t extent : header.size) {
    if (extent == 0 || voxels > kMaxVoxels / extent)
      throw FileError(path.string(),
                      "image size",
                      "at most " + std::to_string(kMaxVoxels) + " voxels",
                      "a header that says more");
    voxels *= extent;
  }
  return voxels * header.value_bytes;
}

fs::path beside(const fs::path& header_path, const std::string& name) {
  const fs::path data(name);
  return data.is_absolute() ? data : header_path.parent_path() / data;
}

std::uint64_t existing_file_size(const fs::path& header_path, const fs::path& data_file) {
  std::error_code error;
  const std::uint64_t bytes = fs::file_size(data_file, error);
  if (error)
    throw FileError(header_path.string(),
                    "its voxel file '" + data_file.string() + "': " + error.message());
  return bytes;
}

// ---- MetaImage ----

TextHeader parse_meta_text(const fs::path& path) {
  const std::string text = read_prefix(path, kMaxTextHeaderBytes);
  TextHeader header{path.string(), {}, 0};
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos) {
      // A header file may end without a newline after its last line.
      if (text.size() == kMaxTextHeaderBytes || text.find('\0', at) != std::string::npos) break;
    }
    const std::string_view line =
        std::string_view(text).substr(at, end == std::string::npos ? std::string::npos : end - at);
    at = end == std::string::npos ? text.size() : end + 1;
    const auto separator = line.find_first_of("=:");
    if (separator == std::string_view::npos) {
      if (trimmed(line).empty()) continue;
      break;
    }
    const std::string key = trimmed(line.substr(0, separator));
    header.fields[key] = trimmed(line.substr(separator + 1));
    if (key == "ElementDataFile") {
      header.end_offset = at;
      return header;
    }
  }
  throw FileError(path.string(), "MetaImage header ends without ElementDataFile");
}

std::uint64_t meta_type_bytes(const TextHeader& header) {
  static const std::map<std::string, std::uint64_t> bytes_of_type = {{"MET_CHAR", 1},
                                                                     {"MET_UCHAR", 1},
                                                                     {"MET_SHORT", 2},
                                                                     {"MET_USHORT", 2},
                                                                     {"MET_INT", 4},
                                                                     {"MET_UINT", 4},
                                                                     {"MET_LONG", 4},
                                                                     {"MET_ULONG", 4},
                                                                     {"MET_LONG_LONG", 8},
                                                                     {"MET_ULONG_LONG", 8},
                                                                     {"MET_FLOAT", 4},
                                                                     {"MET_DOUBLE", 8}};
  const std::string& type = header.require("ElementType");
  const auto found = bytes_of_type.find(type);
  if (found == bytes_of_type.end())
    throw FileError(header.path, "ElementType", "one of MET_CHAR ... MET_DOUBLE", type);
  return found->second;
}

bool is_true(const TextHeader& header, const std::string& key, bool fallback) {
  const std::string* value = header.find(key);
  if (value == nullptr || value->empty()) return fallback;
  return (*value)[0] == 'T' || (*value)[0] == 't' || (*value)[0] == '1';
}

void check_meta_numbers(const TextHeader& header, const std::string& key, std::int64_t expected) {
  const std::string* text = header.find(key);
  if (text == nullptr) return;
  std::int64_t count = 0;
  std::istringstream words(*text);
  for (std::string word; words >> word; ++count) {
    double value = 0.0;
    const char* first = word.data() + (word[0] == '+' ? 1 : 0);
    const auto [end, error] = std::from_chars(first, word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size())
      throw FileError(header.path, key, "numbers", "'" + *text + "'");
    if (!std::isfinite(value))
      throw InputError(key, "'" + *text + "'", "must be finite", header.path);
  }
  if (count != expected)
    throw FileError(header.path, key, std::to_string(expected) + " numbers", "'" + *text + "'");
}

/// MetaIO prints to the terminal when numbers are missing or are none.
void check_meta_numbers(const TextHeader& header, std::int64_t dimension) {
  for (const char* key : {"TransformMatrix", "Rotation", "Orientation"})
    check_meta_numbers(header, key, dimension * dimension);
  for (const char* key :
       {"ElementSpacing", "ElementSize", "Offset", "Position", "Origin", "CenterOfRotation"})
    check_meta_numbers(header, key, dimension);
}

ImageHeader read_meta_header(const fs::path& path) {
  const TextHeader text = parse_meta_text(path);
  ImageHeader header;
  header.format = ImageFormat::MetaImage;
  const std::int64_t dimension = checked_dimension(text, "NDims");
  header.size = parse_sizes(text.path, text.require("DimSize"), dimension);
  check_meta_numbers(text, dimension);
  const std::int64_t channels = text.integer("ElementNumberOfChannels", 1);
  if (channels < 1 || channels > 1024)
    throw FileError(text.path, "ElementNumberOfChannels", "1 to 1024", std::to_string(channels));
  header.value_bytes = meta_type_bytes(text) * static_cast<std::uint64_t>(channels);
  if (!is_true(text, "BinaryData", true))
    throw FileError(text.path, "BinaryData = False: text voxels are not supported");
  header.compressed = is_true(text, "CompressedData", false);
  header.has_orientation = text.find("TransformMatrix") != nullptr ||
                           text.find("Rotation") != nullptr || text.find("Orientation") != nullptr;
  const std::string& data_file = text.require("ElementDataFile");
  const std::string kind = lower(data_file);
  if (kind.starts_with("list") || data_file.find('%') != std::string::npos)
    throw FileError(text.path,
                    "ElementDataFile = " + data_file +
                        ": one file per slice is not supported; give one raw file");
  const bool local = kind == "local";
  header.data_file = local ? path : beside(path, data_file);
  const std::uint64_t bytes = existing_file_size(path, header.data_file);
  const std::int64_t header_size = text.integer("HeaderSize", 0);
  const std::uint64_t payload = checked_payload_bytes(path, header);
  header.payload_offset = local ? text.end_offset : 0;
  if (header_size > 0) header.payload_offset = static_cast<std::uint64_t>(header_size);
  if (header_size == -1 && !header.compressed)
    header.payload_offset = bytes > payload ? bytes - payload : 0;
  return header;
}

// ---- NRRD ----

TextHeader parse_nrrd_text(const fs::path& path) {
  const std::string text = read_prefix(path, kMaxTextHeaderBytes);
  TextHeader header{path.string(), {}, 0};
  std::size_t at = text.find('\n');
  if (at == std::string::npos) throw FileError(path.string(), "NRRD header is cut short");
  for (++at; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string line = trimmed(std::string_view(text).substr(at, end - at));
    at = std::min(end + 1, text.size());
    if (line.empty()) {
      header.end_offset = at;
      return header;
    }
    const auto separator = line.find(':');
    if (line[0] == '#' || separator == std::string::npos) continue;
    if (line.compare(separator, 2, ":=") == 0) continue;  // a key/value pair, not a field
    header.fields[lower(line.substr(0, separator))] =
        trimmed(std::string_view(line).substr(separator + 1));
  }
  // A detached header may end with its last line.
  if (text.size() == kMaxTextHeaderBytes ||
      (header.find("data file") == nullptr && header.find("datafile") == nullptr))
    throw FileError(path.string(), "NRRD header is cut short");
  header.end_offset = text.size();
  return header;
}

std::uint64_t nrrd_type_bytes(const TextHeader& header) {
  static const std::map<std::string, std::uint64_t> bytes_of_type = {{"signed char", 1},
                                                                     {"int8", 1},
                                                                     {"int8_t", 1},
                                                                     {"uchar", 1},
                                                                     {"unsigned char", 1},
                                                                     {"uint8", 1},
                                                                     {"uint8_t", 1},
                                                                     {"short", 2},
                                                                     {"short int", 2},
                                                                     {"signed short", 2},
                                                                     {"signed short int", 2},
                                                                     {"int16", 2},
                                                                     {"int16_t", 2},
                                                                     {"ushort", 2},
                                                                     {"unsigned short", 2},
                                                                     {"unsigned short int", 2},
                                                                     {"uint16", 2},
                                                                     {"uint16_t", 2},
                                                                     {"int", 4},
                                                                     {"signed int", 4},
                                                                     {"int32", 4},
                                                                     {"int32_t", 4},
                                                                     {"uint", 4},
                                                                     {"unsigned int", 4},
                                                                     {"uint32", 4},
                                                                     {"uint32_t", 4},
                                                                     {"longlong", 8},
                                                                     {"long long", 8},
                                                                     {"long long int", 8},
                                                                     {"signed long long", 8},
                                                                     {"signed long long int", 8},
                                                                     {"int64", 8},
                                                                     {"int64_t", 8},
                                                                     {"ulonglong", 8},
                                                                     {"unsigned long long", 8},
                                                                     {"unsigned long long int", 8},
                                                                     {"uint64", 8},
                                                                     {"uint64_t", 8},
                                                                     {"float", 4},
                                                                     {"double", 8}};
  const std::string type = lower(header.require("type"));
  const auto found = bytes_of_type.find(type);
  if (found == bytes_of_type.end())
    throw FileError(header.path, "type", "a number type of NRRD", "'" + type + "'");
  return found->second;
}

const std::string* either(const TextHeader& header, const char* a, const char* b) {
  const std::string* value = header.find(a);
  return value != nullptr ? value : header.find(b);
}

ImageHeader read_nrrd_header(const fs::path& path) {
  const TextHeader text = parse_nrrd_text(path);
  ImageHeader header;
  header.format = ImageFormat::Nrrd;
  const std::int64_t dimension = checked_dimension(text, "dimension");
  header.size = parse_sizes(text.path, text.require("sizes"), dimension);
  header.value_bytes = nrrd_type_bytes(text);
  header.has_orientation = text.find("space directions") != nullptr;
  const std::string encoding = lower(text.require("encoding"));
  header.compressed = encoding == "gzip" || encoding == "gz";
  if (!header.compressed && encoding != "raw")
    throw FileError(text.path, "encoding", "raw or gzip", "'" + encoding + "'");
  if (text.integer("line skip", 0) != 0 || text.integer("lineskip", 0) != 0)
    throw FileError(text.path, "'line skip' is not supported");
  const std::string* data_file = either(text, "data file", "datafile");
  if (data_file != nullptr &&
      (data_file->starts_with("LIST") || data_file->find('%') != std::string::npos))
    throw FileError(text.path,
                    "data file: " + *data_file + ": one file per slice is not supported");
  header.data_file = data_file == nullptr ? path : beside(path, *data_file);
  header.payload_offset = data_file == nullptr ? text.end_offset : 0;
  const std::uint64_t bytes = existing_file_size(path, header.data_file);
  const std::int64_t skip = text.integer("byte skip", text.integer("byteskip", 0));
  const std::uint64_t payload = checked_payload_bytes(path, header);
  if (skip > 0) header.skip_bytes = static_cast<std::uint64_t>(skip);
  if (skip == -1 && !header.compressed)
    header.payload_offset = bytes > payload ? bytes - payload : 0;
  return header;
}

// ---- NIfTI-1 ----

std::uint64_t nifti_type_bytes(const std::string& path, int datatype) {
  static const std::map<int, std::uint64_t> bytes_of_type = {{2, 1},
                                                             {4, 2},
                                                             {8, 4},
                                                             {16, 4},
                                                             {64, 8},
                                                             {128, 3},
                                                             {256, 1},
                                                             {512, 2},
                                                             {768, 4},
                                                             {1024, 8},
                                                             {1280, 8},
                                                             {2304, 4}};
  const auto found = bytes_of_type.find(datatype);
  if (found == bytes_of_type.end())
    throw FileError(path, "datatype", "a real number type of NIfTI-1", std::to_string(datatype));
  return found->second;
}

RasAffine qform_affine(std::string_view raw, bool swapped) {
  const auto at = [&](std::size_t offset) {
    return static_cast<double>(load<float>(raw, offset, swapped));
  };
  const Eigen::Vector3d q(at(256), at(260), at(264));
  const double w = std::sqrt(std::max(0.0, 1.0 - q.squaredNorm()));
  const double handedness = at(76) < 0.0 ? -1.0 : 1.0;
  const Eigen::Matrix3d linear =
      Eigen::Quaterniond(w, q.x(), q.y(), q.z()).normalized().toRotationMatrix() *
      Eigen::Vector3d(at(80), at(84), handedness * at(88)).asDiagonal();
  RasAffine affine{};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column)
      affine[row][column] =
          linear(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column));
    affine[row][3] = at(268 + 4 * row);
  }
  return affine;
}

RasAffine sform_affine(std::string_view raw, bool swapped) {
  RasAffine affine{};
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 4; ++column)
      affine[row][column] =
          static_cast<double>(load<float>(raw, 280 + 4 * (4 * row + column), swapped));
  return affine;
}

/// ITK decomposes a map that is not orthogonal, prints its complaint, and may accept a flat one.
void check_is_orthogonal(const std::string& path, const char* name, const RasAffine& affine) {
  constexpr double kMaxShear = 1e-3;  // cosine between axes
  Eigen::Matrix3d axes;
  for (Eigen::Index row = 0; row < 3; ++row)
    for (Eigen::Index column = 0; column < 3; ++column)
      axes(row, column) = affine[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
  const Eigen::Matrix3d unit = axes.colwise().normalized();
  const Eigen::Matrix3d gram = unit.transpose() * unit;
  if (!gram.allFinite() ||
      !((gram - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= kMaxShear))
    throw InputError(
        name, "a sheared or singular map", "its axes must be orthogonal; resample the CT", path);
}

NiftiOrientation nifti_orientation(std::string_view raw, bool swapped) {
  NiftiOrientation orientation;
  if (load<std::int16_t>(raw, 252, swapped) > 0) orientation.qform = qform_affine(raw, swapped);
  if (load<std::int16_t>(raw, 254, swapped) > 0) orientation.sform = sform_affine(raw, swapped);
  return orientation;
}

void check_nifti_numbers(const std::string& path, std::string_view raw, bool swapped) {
  const int units = load<char>(raw, 123, false) & 7;
  if (units == 1 || units == 3)
    throw InputError("xyzt_units",
                     units == 1 ? "metres" : "micrometres",
                     "lengths must be in mm (unit code 2)",
                     path);
  for (std::size_t axis = 1; axis <= 3; ++axis) {
    const float spacing = load<float>(raw, 76 + 4 * axis, swapped);
    if (axis <= static_cast<std::size_t>(load<std::int16_t>(raw, 40, swapped)) &&
        !(spacing > 0.0f && std::isfinite(spacing)))
      throw InputError("pixdim[" + std::to_string(axis) + "]",
                       std::to_string(spacing),
                       "spacing must be positive and finite (mm)",
                       path);
  }
  // Quaternion, offsets, and the rows of the sform. What is not finite makes ITK's singular value
  // decomposition run for ever, what is next to nothing makes it print.
  for (std::size_t offset = 256; offset < 328; offset += 4) {
    const float value = std::abs(load<float>(raw, offset, swapped));
    if (!(value < kMaxOrientation) || (value > 0.0f && value < kMinOrientation))
      throw InputError("orientation (header byte " + std::to_string(offset) + ")",
                       number_text(static_cast<double>(value)),
                       "must be finite, 0 or between 1e-30 and 1e6",
                       path);
  }
  const float slope = load<float>(raw, 112, swapped);
  const float intercept = load<float>(raw, 116, swapped);
  if (!std::isfinite(slope) || !std::isfinite(intercept))
    throw InputError("scl_slope, scl_inter",
                     std::to_string(slope) + ", " + std::to_string(intercept),
                     "must be finite",
                     path);
}

ImageHeader read_nifti_header(const fs::path& path) {
  const std::string name = path.string();
  const std::string raw = read_inflated_prefix(path, kNifti1HeaderBytes);
  if (raw.size() < kNifti1HeaderBytes)
    throw FileError(name, "NIfTI header", "348 bytes", std::to_string(raw.size()));
  const auto header_bytes = load<std::int32_t>(raw, 0, false);
  const bool swapped = header_bytes != static_cast<std::int32_t>(kNifti1HeaderBytes);
  if (header_bytes == static_cast<std::int32_t>(kNifti2HeaderBytes) ||
      load<std::int32_t>(raw, 0, true) == static_cast<std::int32_t>(kNifti2HeaderBytes))
    throw FileError(name, "NIfTI-2 is not supported; convert to NIfTI-1 (.nii.gz)");
  if (swapped && load<std::int32_t>(raw, 0, true) != static_cast<std::int32_t>(kNifti1HeaderBytes))
    throw FileError(name, "sizeof_hdr", "348", std::to_string(header_bytes));
  if (raw.compare(344, 3, "n+1") != 0)
    throw FileError(name, "pairs of .hdr and .img are not supported; convert to .nii.gz");

  ImageHeader header;
  header.format = ImageFormat::Nifti;
  header.data_file = path;
  header.compressed = is_gzip(read_prefix(path, 2));
  const int dimension = load<std::int16_t>(raw, 40, swapped);
  if (dimension < 1 || dimension > 7)
    throw FileError(name, "dim[0]", "1 to 7", std::to_string(dimension));
  for (int axis = 1; axis <= dimension; ++axis) {
    const int extent = load<std::int16_t>(raw, 40 + 2 * static_cast<std::size_t>(axis), swapped);
    if (extent < 1)
      throw FileError(
          name, "dim[" + std::to_string(axis) + "]", "at least 1", std::to_string(extent));
    header.size.push_back(static_cast<std::uint64_t>(extent));
  }
  header.value_bytes = nifti_type_bytes(name, load<std::int16_t>(raw, 70, swapped));
  const int bits = load<std::int16_t>(raw, 72, swapped);
  if (static_cast<std::uint64_t>(bits) != 8 * header.value_bytes)
    throw FileError(name, "bitpix", std::to_string(8 * header.value_bytes), std::to_string(bits));
  const float offset = load<float>(raw, 108, swapped);
  if (!(offset >= 352.0f && offset <= 1e9f))
    throw FileError(name, "vox_offset", "352 to 1e9", std::to_string(offset));
  header.skip_bytes = static_cast<std::uint64_t>(offset);
  check_nifti_numbers(name, raw, swapped);
  const float slope = load<float>(raw, 112, swapped);
  const float intercept = load<float>(raw, 116, swapped);
  // A slope of 0 means that there is none.
  header.has_plain_values = !swapped && (slope == 0.0f || slope == 1.0f) && intercept == 0.0f;
  header.nifti = nifti_orientation(raw, swapped);
  if (header.nifti.sform) check_is_orthogonal(name, "sform", *header.nifti.sform);
  header.has_orientation = header.nifti.qform.has_value() || header.nifti.sform.has_value();
  return header;
}

// ---- PNG ----

std::uint32_t big_endian(std::string_view bytes) {
  std::uint32_t value = 0;
  for (const char byte : bytes) value = value << 8 | static_cast<unsigned char>(byte);
  return value;
}

/// Checks IHDR; libpng aborts the process on what it does not like there.
void check_png_header(const std::string& path, std::string_view data) {
  constexpr std::uint32_t kMaxPngSide = 1000000;  // libpng's own limit
  const std::uint32_t width = big_endian(data.substr(0, 4));
  const std::uint32_t height = big_endian(data.substr(4, 4));
  if (width < 1 || height < 1 || width > kMaxPngSide || height > kMaxPngSide)
    throw FileError(path,
                    "PNG size",
                    "1 to 1000000 pixels",
                    std::to_string(width) + " x " + std::to_string(height));
  const int depth = static_cast<unsigned char>(data[8]);
  const int color = static_cast<unsigned char>(data[9]);
  if (color == 2 || color == 3 || color == 4 || color == 6)
    throw InputError("PNG colour type", std::to_string(color), "must be 0, plain grey", path);
  if (color != 0 || std::string_view("\1\2\4\10\20").find(data[8]) == std::string_view::npos ||
      data[10] != 0 || data[11] != 0 || (data[12] & ~1) != 0)
    throw FileError(
        path,
        "PNG header",
        "grey of 1 to 16 bits",
        "colour type " + std::to_string(color) + ", " + std::to_string(depth) + " bits");
}

/// Walks the chunks of a PNG file with their checksums up to its end mark.
void check_png(const fs::path& path) {
  const std::uint64_t file_bytes = existing_file_size(path, path);
  std::ifstream file(path, std::ios::binary);
  std::uint64_t at = 8;  // behind the signature
  for (bool is_first = true;; is_first = false) {
    std::array<char, 8> head{};
    file.seekg(static_cast<std::streamoff>(at));
    file.read(head.data(), head.size());
    const std::uint64_t length = big_endian({head.data(), 4});
    const std::string_view type(head.data() + 4, 4);
    if (!file || at + 12 + length > file_bytes)
      throw FileError(path.string(), "truncated: a PNG chunk reaches beyond the end of the file");
    std::string data(length + 4, '\0');
    file.read(data.data(), static_cast<std::streamsize>(data.size()));
    uLong crc = crc32(0, reinterpret_cast<const unsigned char*>(type.data()), 4);
    crc =
        crc32(crc, reinterpret_cast<const unsigned char*>(data.data()), static_cast<uInt>(length));
    if (crc != big_endian(std::string_view(data).substr(length)))
      throw FileError(path.string(),
                      "corrupt: the checksum of PNG chunk " + std::string(type) + " is wrong");
    if (is_first && (type != "IHDR" || length != 13))
      throw FileError(path.string(), "PNG file does not begin with its header");
    if (is_first) check_png_header(path.string(), data);
    if (type == "IEND") return;
    at += 12 + length;
  }
}

// ---- payload ----

using Bytes = std::span<const std::byte>;
using ByteVisitor = std::function<void(Bytes)>;

constexpr std::size_t kPieceBytes = std::size_t{1} << 20;

/// Bytes that a compressed stream inflates to, handed to `visit` on the way; throws when it is cut
/// or its checksum is wrong.
std::uint64_t inflate_file(const fs::path& path, std::uint64_t offset, const ByteVisitor& visit) {
  std::ifstream file(path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(offset));
  Inflater inflater;
  z_stream& stream = inflater.stream();
  std::vector<unsigned char> input(1u << 16);
  std::vector<unsigned char> output(1u << 18);
  std::uint64_t total = 0;
  bool finished = false;
  while (file && !finished) {
    file.read(reinterpret_cast<char*>(input.data()), static_cast<std::streamsize>(input.size()));
    stream.next_in = input.data();
    stream.avail_in = static_cast<unsigned>(file.gcount());
    // A full output buffer may hide more output that needs no more input.
    do {
      stream.next_out = output.data();
      stream.avail_out = static_cast<unsigned>(output.size());
      const int status = inflate(&stream, Z_NO_FLUSH);
      const std::size_t inflated = output.size() - stream.avail_out;
      visit(std::as_bytes(std::span(output).first(inflated)));
      total += inflated;
      finished = status == Z_STREAM_END;
      // Z_BUF_ERROR: nothing was left to do; the next input goes on.
      if (!finished && status != Z_OK && status != Z_BUF_ERROR)
        throw FileError(path.string(),
                        "compressed data are corrupt after " + std::to_string(total) +
                            " bytes: " + (stream.msg != nullptr ? stream.msg : "bad stream"));
      // Another gzip member may follow; anything else is padding that readers ignore.
      if (finished && stream.avail_in > 0 && stream.next_in[0] == 0x1f) {
        inflateReset(&stream);
        finished = false;
      }
    } while (!finished && (stream.avail_in > 0 || stream.avail_out == 0));
  }
  if (!finished)
    throw FileError(path.string(),
                    "truncated: the compressed data end after " + std::to_string(total) +
                        " bytes without their end mark");
  return total;
}

/// The bytes of a file from `offset` on, read whole only when somebody wants them.
std::uint64_t read_plain_file(const fs::path& path,
                              std::uint64_t offset,
                              const ByteVisitor& visit) {
  std::ifstream file(path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(offset));
  std::vector<char> piece(kPieceBytes);
  std::uint64_t total = 0;
  while (file) {
    file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    const auto found = static_cast<std::size_t>(file.gcount());
    visit(std::as_bytes(std::span(piece).first(found)));
    total += found;
  }
  return total;
}

/// Cuts a stream of bytes into pieces of kPieceBytes, without what stands before and after the
/// voxels.
class PayloadPieces {
 public:
  PayloadPieces(std::uint64_t skipped_bytes, std::uint64_t payload_bytes, ByteVisitor visit)
      : to_skip_(skipped_bytes), to_come_(payload_bytes), visit_(std::move(visit)) {}

  void add(Bytes bytes) {
    const auto skipped = std::min<std::uint64_t>(to_skip_, bytes.size());
    to_skip_ -= skipped;
    bytes = bytes.subspan(skipped);
    bytes = bytes.first(std::min<std::uint64_t>(to_come_, bytes.size()));
    to_come_ -= bytes.size();
    while (!bytes.empty()) {
      const std::size_t taken = std::min(bytes.size(), kPieceBytes - piece_.size());
      piece_.insert(
          piece_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(taken));
      bytes = bytes.subspan(taken);
      if (piece_.size() == kPieceBytes) flush();
    }
    if (to_come_ == 0) flush();
  }

 private:
  void flush() {
    if (!piece_.empty()) visit_(piece_);
    piece_.clear();
  }

  std::uint64_t to_skip_;
  std::uint64_t to_come_;
  ByteVisitor visit_;
  std::vector<std::byte> piece_;
};

}  // namespace

std::string_view format_name(ImageFormat format) {
  switch (format) {
    case ImageFormat::MetaImage:
      return "MetaImage";
    case ImageFormat::Nifti:
      return "NIfTI";
    case ImageFormat::Nrrd:
      return "NRRD";
    case ImageFormat::Png:
      return "PNG";
    case ImageFormat::Tiff:
      return "TIFF";
    case ImageFormat::Dicom:
      return "DICOM";
  }
  return "unknown";
}

std::optional<ImageFormat> sniff_image_format(const fs::path& path) {
  const std::string start = read_prefix(path, 1024);
  const std::string_view bytes(start);
  if (bytes.starts_with("NRRD00")) return ImageFormat::Nrrd;
  if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return ImageFormat::Png;
  using namespace std::string_view_literals;
  if (bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv)) return ImageFormat::Tiff;
  if (bytes.size() >= 132 && bytes.substr(128, 4) == "DICM") return ImageFormat::Dicom;
  if (looks_like_meta_image(bytes)) return ImageFormat::MetaImage;
  if (looks_like_nifti(bytes)) return ImageFormat::Nifti;
  if (is_gzip(bytes) && looks_like_nifti(read_inflated_prefix(path, kNifti1HeaderBytes)))
    return ImageFormat::Nifti;
  return std::nullopt;
}

ImageHeader read_image_header(const fs::path& path, ImageFormat format) {
  ImageHeader header;
  switch (format) {
    case ImageFormat::MetaImage:
      header = read_meta_header(path);
      break;
    case ImageFormat::Nifti:
      header = read_nifti_header(path);
      break;
    case ImageFormat::Nrrd:
      header = read_nrrd_header(path);
      break;
    default:
      header.format = format;
      header.data_file = path;
      return header;
  }
  (void)checked_payload_bytes(path, header);
  return header;
}

void check_image_payload(const fs::path& path,
                         const ImageHeader& header,
                         std::vector<std::string>* warnings) {
  read_image_payload(path, header, warnings, nullptr);
}

void read_image_payload(const fs::path& path,
                        const ImageHeader& header,
                        std::vector<std::string>* warnings,
                        const ByteVisitor& visit) {
  if (header.format == ImageFormat::Png) check_png(path);
  if (header.size.empty()) return;
  const std::uint64_t payload = checked_payload_bytes(path, header);
  const std::uint64_t expected = payload + header.skip_bytes;
  const std::uint64_t file_bytes = existing_file_size(path, header.data_file);
  const std::uint64_t stored =
      file_bytes > header.payload_offset ? file_bytes - header.payload_offset : 0;
  if (header.compressed && stored < expected / kMaxDeflateRatio)
    throw FileError(path.string(),
                    "truncated: " + std::to_string(stored) + " compressed bytes cannot hold the " +
                        std::to_string(expected) + " bytes that the header promises");
  PayloadPieces pieces(header.skip_bytes, payload, visit);
  const ByteVisitor take = [&](Bytes bytes) {
    if (visit) pieces.add(bytes);
  };
  std::uint64_t found = stored;
  if (header.compressed)
    found = inflate_file(header.data_file, header.payload_offset, take);
  else if (visit && stored >= expected)
    found = read_plain_file(header.data_file, header.payload_offset, take);
  if (found < expected)
    throw FileError(header.data_file.string(),
                    "truncated: voxel data",
                    std::to_string(expected) + " bytes",
                    std::to_string(found));
  if (found > expected && warnings != nullptr)
    warnings->push_back(header.data_file.string() + ": " + std::to_string(found - expected) +
                        " bytes more than the header says; they are ignored");
}

}  // namespace af
