// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/scan_file.h"

#include <cmath>
#include <cstdint>
#include <optional>
#include <sstream>

#include "base/file_name.h"
#include "base/number_text.h"
#include "base/parsed_number.h"
#include "files/output_file.h"
#include "files/toml_reader.h"
#include "geometry/rigid_transform.h"

namespace af::tools {

namespace {

/// "{}" or "{:0N}" of a file pattern.
struct IndexPlace {
  std::size_t begin;
  std::size_t length;
  std::size_t digits;  ///< least number of digits, filled with zeros
};

std::optional<IndexPlace> index_place(const std::string& pattern) {
  const std::size_t open = pattern.find('{');
  const std::size_t close = pattern.find('}');
  if (open == std::string::npos || close == std::string::npos || close < open) return std::nullopt;
  if (pattern.find_first_of("{}", close + 1) != std::string::npos ||
      pattern.find('{', open + 1) != std::string::npos)
    return std::nullopt;
  const std::string inside = pattern.substr(open + 1, close - open - 1);
  if (inside.empty()) return IndexPlace{open, 2, 1};
  const bool has_form =
      inside.size() == 3 && inside.starts_with(":0") && inside[2] >= '1' && inside[2] <= '9';
  if (!has_form) return std::nullopt;
  return IndexPlace{open, close - open + 1, static_cast<std::size_t>(inside[2] - '0')};
}

/// A finite number of a magnitude of at most `most`.
std::optional<double> get_number(TomlTableReader& reader,
                                 const char* key,
                                 Presence presence,
                                 double most = kMaxRoomMm) {
  if (!reader.has(key)) {
    if (presence == Presence::Required) (void)reader.get_string(key, presence);  // notes it
    return std::nullopt;
  }
  const toml::node& node = reader.node(key);
  const auto value = node.is_number() ? node.value<double>() : std::nullopt;
  if (!value || !std::isfinite(*value) || std::abs(*value) > most) {
    reader.add_problem(key, "must be a number, finite and within " + number_text(most));
    return std::nullopt;
  }
  return value;
}

std::optional<int> get_index(TomlTableReader& reader,
                             const char* key,
                             int least,
                             Presence presence) {
  const auto value = get_number(reader, key, presence);
  if (!value) return std::nullopt;
  constexpr int kMost = 100000;
  if (*value != std::floor(*value) || *value < least || *value > kMost) {
    reader.add_problem(key,
                       "must be a whole number between " + std::to_string(least) + " and 100000");
    return std::nullopt;
  }
  return static_cast<int>(*value);
}

void read_geometry(TomlTableReader& reader, CircularScan& scan) {
  const auto to_axis = get_number(reader, "source_to_axis_mm", Presence::Required);
  const auto to_detector = get_number(reader, "axis_to_detector_mm", Presence::Required);
  const auto spacing = reader.get_vector<2>("pixel_spacing_mm", Presence::Required);
  const auto size = reader.get_integers("size_px", 2, Presence::Required);
  const auto axis = reader.get_string("rotation_axis", Presence::Required);
  if (axis && *axis != "columns" && *axis != "rows")
    reader.add_problem("rotation_axis",
                       "must be \"columns\" (it runs along increasing columns) or \"rows\"");
  if (to_detector && !(*to_detector > 0.0))
    reader.add_problem("axis_to_detector_mm", "must be above 0");
  scan.source_to_axis_mm = to_axis.value_or(1.0);
  scan.source_to_detector_mm = scan.source_to_axis_mm + to_detector.value_or(1.0);
  scan.pixel_spacing_mm = spacing.value_or(Eigen::Vector2d::Ones());
  scan.size_px = size ? Eigen::Vector2i((*size)[0], (*size)[1]) : Eigen::Vector2i(16, 16);
  scan.axis_along = axis == "columns" ? AxisAlong::Columns : AxisAlong::Rows;
  scan.beam_foot_px = reader.get_vector<2>("beam_foot_px", Presence::Optional);
  constexpr double kMostTolerance = 0.3;
  const auto tolerance = get_number(reader, "distance_tolerance", Presence::Optional);
  scan.distance_tolerance = tolerance.value_or(0.0);
  if (!(scan.distance_tolerance >= 0.0 && scan.distance_tolerance <= kMostTolerance))
    reader.add_problem("distance_tolerance",
                       "must be between 0 (the distances were measured) and 0.3");
}

/// The lines without surrounding blanks. Empty lines and those that begin with # are left out.
std::vector<std::string> lines_of_file(const std::filesystem::path& path) {
  std::istringstream text(read_text_file(path, kMostTomlBytes));
  std::vector<std::string> found;
  constexpr const char* kBlanks = " \t\r";
  for (std::string line; std::getline(text, line);) {
    const std::size_t begin = line.find_first_not_of(kBlanks);
    if (begin == std::string::npos || line[begin] == '#') continue;
    found.push_back(line.substr(begin, line.find_last_not_of(kBlanks) + 1 - begin));
  }
  return found;
}

/// Numbers between blanks or line ends, of any count. # begins a comment.
std::vector<double> read_angles_file(const std::filesystem::path& path) {
  std::istringstream lines(read_text_file(path, kMostTomlBytes));
  std::vector<double> angles_deg;
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::istringstream words(line.substr(0, line.find('#')));
    for (std::string word; words >> word;) {
      const std::optional<double> angle_deg = finite_number(word);
      if (!angle_deg)
        throw FileError(path.string() + ":" + std::to_string(number),
                        "'" + word + "' is not an angle: angles_file holds a number per view");
      angles_deg.push_back(*angle_deg);
    }
  }
  return angles_deg;
}

/// The angles one by one, from angles_deg or angles_file.
std::vector<double> read_listed_angles(TomlTableReader& reader,
                                       const std::filesystem::path& folder) {
  for (const char* const key : {"view_count", "step_deg", "first_angle_deg"})
    if (reader.has(key))
      reader.add_problem(key, "must not be given together with a list of angles");
  if (reader.has("angles_deg") && reader.has("angles_file"))
    reader.add_problem("angles_file",
                       "must not be given together with angles_deg, which says the same");
  if (const auto listed = reader.get_number_list("angles_deg", Presence::Optional)) return *listed;
  const auto file = reader.get_string("angles_file", Presence::Optional);
  return file ? read_angles_file(folder / *file) : std::vector<double>{};
}

void read_angles(TomlTableReader& reader, const std::filesystem::path& folder, CircularScan& scan) {
  if (reader.has("angles_deg") || reader.has("angles_file")) {
    for (const double angle_deg : read_listed_angles(reader, folder))
      scan.angles_rad.push_back(angle_deg * kRadPerDeg);
    if (const auto continued = continued_rad(scan.angles_rad)) scan.angles_rad = *continued;
    return;
  }
  const auto count = get_index(reader, "view_count", 1, Presence::Required);
  const auto step_deg = get_number(reader, "step_deg", Presence::Required);
  const auto first_deg = get_number(reader, "first_angle_deg", Presence::Optional);
  if (step_deg && (*step_deg == 0.0 || std::abs(*step_deg) > 90.0))
    reader.add_problem("step_deg", "must be between -90 and 90 degrees, and not 0");
  for (int view = 0; view < count.value_or(0); ++view)
    scan.angles_rad.push_back((first_deg.value_or(0.0) + view * step_deg.value_or(1.0)) *
                              kRadPerDeg);
}

/// The names of files_file, one per view.
void read_listed_files(TomlTableReader& reader,
                       const std::filesystem::path& folder,
                       ScanFile& file) {
  for (const char* const key : {"files", "first_index", "index_step"})
    if (reader.has(key)) reader.add_problem(key, "must not be given together with files_file");
  const auto list = reader.get_string("files_file", Presence::Required);
  if (!list) return;
  file.listed_files = lines_of_file(folder / *list);
  if (file.listed_files.size() != file.scan.angles_rad.size())
    reader.add_problem(
        "files_file",
        "must hold a line with a file name per view: " + std::to_string(file.listed_files.size()) +
            " for " + std::to_string(file.scan.angles_rad.size()) + " views");
}

/// Names given by a pattern, or the name of a stack.
void read_file_pattern(TomlTableReader& reader, ScanFile& file) {
  file.files = reader.get_string("files", Presence::Required).value_or("{}");
  const bool has_braces = file.files.find_first_of("{}") != std::string::npos;
  if (has_braces && !index_place(file.files))
    reader.add_problem(
        "files",
        "must contain {} once in place of the view's index ({:04} for four digits), or, for a "
        "stack of all views, no braces at all");
  for (const char* const key : {"first_index", "index_step"})
    if (file.is_stack() && reader.has(key))
      reader.add_problem(key,
                         "is for files with an index; a stack's images are the views in their "
                         "order");
  file.first_index = get_index(reader, "first_index", 0, Presence::Optional).value_or(0);
  file.index_step = get_index(reader, "index_step", 1, Presence::Optional).value_or(1);
}

void read_image_keys(TomlTableReader& reader, const std::filesystem::path& folder, ScanFile& file) {
  if (reader.has("files_file"))
    read_listed_files(reader, folder, file);
  else
    read_file_pattern(reader, file);
  const auto domain = reader.get_string("xray_domain", Presence::Required);
  if (domain && *domain != "intensity" && *domain != "attenuation")
    reader.add_problem("xray_domain", "must be \"intensity\" or \"attenuation\"");
  file.xray_domain = domain == "attenuation" ? XrayDomain::Attenuation : XrayDomain::Intensity;
  file.attenuation_scale =
      get_number(reader, "attenuation_scale", Presence::Optional).value_or(1.0);
  if (reader.has("attenuation_scale") && file.xray_domain == XrayDomain::Intensity)
    reader.add_problem("attenuation_scale", "is for xray_domain = \"attenuation\" alone");
  if (!(file.attenuation_scale > 0.0)) reader.add_problem("attenuation_scale", "must be above 0");
  constexpr double kMostCounts = 1e12;
  const auto dark_level = get_number(reader, "dark_level", Presence::Optional, kMostCounts);
  file.dark_level = dark_level.value_or(0.0);
  file.dark = reader.get_string("dark", Presence::Optional);
  file.flat = reader.get_string("flat", Presence::Optional);
  file.flat_level = get_number(reader, "flat_level", Presence::Optional, kMostCounts);
  if (file.flat_level && !(*file.flat_level > file.dark_level))
    reader.add_problem("flat_level", "must be above dark_level: what the open beam counts");
  if (file.flat_level && file.flat)
    reader.add_problem("flat", "must not be given together with flat_level, which says the same");
  if (dark_level && file.dark)
    reader.add_problem("dark", "must not be given together with dark_level, which says the same");
  for (const char* const key : {"dark_level", "dark", "flat", "flat_level"})
    if (file.xray_domain == XrayDomain::Attenuation && reader.has(key))
      reader.add_problem(key, "is for xray_domain = \"intensity\" alone");
}

}  // namespace

bool ScanFile::is_stack() const {
  return listed_files.empty() && !index_place(files);
}

std::string ScanFile::file_of(int view) const {
  if (!listed_files.empty()) return listed_files.at(static_cast<std::size_t>(view));
  if (is_stack()) return files;
  const IndexPlace place = index_place(files).value();
  // Both may be up to 100000, so their product does not fit an int.
  std::string index = std::to_string(first_index + std::int64_t{view} * index_step);
  if (index.size() < place.digits) index.insert(0, place.digits - index.size(), '0');
  std::string path = files;
  return path.replace(place.begin, place.length, index);
}

ScanFile parse_scan_file(const std::string& text, const std::string& file) {
  const toml::table table = parse_toml(text, file);
  TomlProblems problems(file);
  TomlTableReader reader(table, "", problems);
  ScanFile result;
  result.name = reader.get_string("name", Presence::Optional).value_or("scan");
  if (!is_plain_file_name(result.name))
    reader.add_problem("name", std::string("must be usable in a file name") + kPlainFileName);
  read_geometry(reader, result.scan);
  const std::filesystem::path folder = std::filesystem::path(file).parent_path();
  read_angles(reader, folder, result.scan);
  read_image_keys(reader, folder, result);
  reader.refuse_unknown_keys();
  problems.throw_if_any();
  throw_if_any(af::problems(result.scan), file);
  return result;
}

ScanFile read_scan_file(const std::filesystem::path& path) {
  return parse_scan_file(read_text_file(path, kMostTomlBytes), path.string());
}

}  // namespace af::tools
