// SPDX-License-Identifier: Apache-2.0
// Cameras of plastimatch: the text that `plastimatch drr` writes beside each projection, and the
// command itself. Room: DICOM's patient frame (LPS, mm). The normal points from the isocentre to
// the source, which is SAD away from it; the detector stands SID from the source; view-up points to
// the top row. "row col" in plastimatch's help is columns first in effect: -r "240 200" makes
// images of 240 columns.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <Eigen/Dense>

#include "base/error.h"
#include "base/number_text.h"
#include "base/toml_text.h"
#include "camera_files/camera_text.h"
#include "camera_files/format_readers.h"
#include "geometry/pinhole_camera.h"

namespace af {

namespace {

constexpr std::size_t kExtrinsicLine = 8;
constexpr std::size_t kIntrinsicLine = 13;
constexpr std::size_t kProjectionLines = 16;

/// The numbered lines of a projection file.
class ProjectionFile {
 public:
  explicit ProjectionFile(const CameraFile& file) : file_(file.name()) {
    lines_ = word_lines(file.text);
    if (lines_.size() < kProjectionLines)
      throw FileError(file_, "truncated: a projection file has 16 lines");
    if (lines_.size() > kProjectionLines)
      throw InputError(place_of(lines_[kProjectionLines], file_) + ": line",
                       "'" + beginning_of(lines_[kProjectionLines].text, 60) + "'",
                       "must not be there: a projection file has 16 lines");
    if (lines_[kExtrinsicLine - 1].text != "Extrinsic" ||
        lines_[kIntrinsicLine - 1].text != "Intrinsic")
      throw FileError(file_, "the lines 'Extrinsic' and 'Intrinsic' are not where they belong");
  }

  [[nodiscard]] Eigen::MatrixXd rows(std::size_t first,
                                     Eigen::Index count,
                                     Eigen::Index columns) const {
    Eigen::MatrixXd matrix(count, columns);
    for (Eigen::Index row = 0; row < count; ++row)
      matrix.row(row) =
          numbers_of(lines_[first + static_cast<std::size_t>(row)], columns, file_).transpose();
    return matrix;
  }

  [[nodiscard]] const std::string& name() const { return file_; }

 private:
  std::string file_;
  std::vector<WordLine> lines_;
};

/// The matrix of the first lines is that of the two below, but for rounding to 9 digits.
void check_agreement(const Eigen::MatrixXd& matrix,
                     const Eigen::MatrixXd& product,
                     const std::string& file) {
  constexpr double kTolerance = 1e-5;
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    if (!((matrix.row(row) - product.row(row)).norm() <= kTolerance * product.row(row).norm()))
      throw InputError(file + ": row " + std::to_string(row + 1) +
                       " of the projection matrix is not Intrinsic times Extrinsic");
}

/// The options of a `plastimatch drr` command, by their long names, and its words.
class DrrCommand {
 public:
  explicit DrrCommand(const CameraFile& file) : file_(file.name()) {
    const std::vector<std::string> words = words_of_drr(file.text);
    for (auto word = words.begin(); word != words.end(); ++word) {
      if (!word->starts_with('-') || is_number(*word)) continue;
      std::string name = *word;
      std::string value;
      if (const std::size_t equals = name.find('='); equals != std::string::npos) {
        value = name.substr(equals + 1);
        name = name.substr(0, equals);
      } else if (word + 1 != words.end()) {
        value = *(word + 1);
      }
      values_[long_name(name)] = value;
    }
  }

  /// All but what decides no camera: the image's values, its files, how it is computed.
  void refuse_other_than(const std::set<std::string>& known) const {
    static const std::set<std::string> indifferent = {
        "-A", "--threading",       "--autoscale", "--autoscale-range", "-e", "--exponential",
        "-G", "--geometry-only",   "-H",          "--hu-conversion",   "-I", "--input",
        "-i", "--algorithm",       "-O",          "--output",          "-P", "--preprocess",
        "-s", "--intensity-scale", "-t",          "--output-format"};
    for (const auto& [name, value] : values_)
      if (!known.contains(name) && !indifferent.contains(name))
        throw InputError(file_ + ": " + beginning_of(name, 40) +
                         " is not read: the projection files that plastimatch drr -G writes are");
  }

  [[nodiscard]] Eigen::VectorXd numbers(const char* name,
                                        Eigen::Index count,
                                        const std::optional<Eigen::VectorXd>& otherwise) const {
    const auto found = values_.find(name);
    if (found == values_.end()) {
      if (otherwise) return *otherwise;
      throw InputError(file_ + ": the command has no " + name);
    }
    const auto lines = word_lines(found->second);
    if (lines.size() != 1)
      throw FileError(file_, name, std::to_string(count) + " numbers", "'" + found->second + "'");
    return numbers_of({0, lines[0].text, lines[0].words}, count, file_ + ": " + name);
  }

 private:
  /// The words from "drr" on of the only command that has it.
  [[nodiscard]] std::vector<std::string> words_of_drr(const std::string& text) const {
    std::vector<std::vector<std::string>> found;
    for (const std::string& command : commands_of(text)) {
      const std::vector<std::string> words = shell_like_words(command);
      const auto start = std::ranges::find(words, "drr");
      if (start != words.end()) found.emplace_back(start, words.end());
    }
    if (found.empty()) throw FileError(file_, "no plastimatch drr command");
    if (found.size() > 1)
      throw InputError(file_ + ": holds " + std::to_string(found.size()) +
                       " plastimatch drr commands; give a file with one");
    return found.front();
  }

  /// Parts that a shell runs one after the other: between line ends without a backslash, ';' and
  /// '&', outside quotes.
  static std::vector<std::string> commands_of(const std::string& text) {
    std::vector<std::string> commands(1);
    char quote = '\0';
    char before = '\0';
    for (const char c : text) {
      if (quote == '\0' && (c == '"' || c == '\''))
        quote = c;
      else if (c == quote)
        quote = '\0';
      const bool ends = c == ';' || c == '&' || (c == '\n' && before != '\\');
      if (quote == '\0' && ends)
        commands.emplace_back();
      else
        commands.back() += c;
      if (c != '\r') before = c;
    }
    return commands;
  }

  /// Words as a shell takes them: quotes, and a backslash before the end of a line.
  static std::vector<std::string> shell_like_words(const std::string& text) {
    std::vector<std::string> words;
    std::string word;
    char quote = '\0';
    bool is_open = false;
    for (const char c : text) {
      if (quote != '\0') {
        if (c == quote)
          quote = '\0';
        else
          word += c;
      } else if (c == '"' || c == '\'') {
        quote = c;
        is_open = true;
      } else if (c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\\') {
        if (is_open || !word.empty()) words.push_back(word);
        word.clear();
        is_open = false;
      } else {
        word += c;
      }
    }
    if (is_open || !word.empty()) words.push_back(word);
    return words;
  }

  static std::string long_name(const std::string& name) {
    static const std::map<std::string, std::string> long_names = {{"-n", "--nrm"},
                                                                  {"-r", "--dim"},
                                                                  {"-z", "--detector-size"},
                                                                  {"-c", "--image-center"},
                                                                  {"-o", "--isocenter"},
                                                                  {"-y", "--gantry-angle"},
                                                                  {"-a", "--num-angles"},
                                                                  {"-w", "--subwindow"}};
    const auto found = long_names.find(name);
    return found == long_names.end() ? name : found->second;
  }

  std::string file_;
  std::map<std::string, std::string> values_;
};

}  // namespace

bool is_plastimatch(const CameraFile& file) {
  const auto lines = word_lines(std::string_view(file.text).substr(0, CameraFile::kHeadBytes));
  return lines.size() > kExtrinsicLine && lines[0].words.size() == 2 &&
         is_number(lines[0].words[0]) && lines[kExtrinsicLine - 1].text == "Extrinsic";
}

/// Pixels are the image centre of line 1 plus (P x) / w. Columns are the first coordinate.
StatedRig read_plastimatch(const CameraFile& file, const CameraFileOptions& /*options*/) {
  const ProjectionFile projection(file);
  const Eigen::MatrixXd center_px = projection.rows(0, 1, 2);
  const double source_axis_mm = projection.rows(4, 1, 1)(0, 0);
  const Eigen::MatrixXd extrinsic = projection.rows(kExtrinsicLine, 4, 4);
  const Eigen::MatrixXd intrinsic = projection.rows(kIntrinsicLine, 3, 4);
  check_agreement(projection.rows(1, 3, 4), intrinsic * extrinsic, file.name());
  const double inverse_distance = intrinsic(2, 2);
  const double spacing_mm = 1.0 / intrinsic(0, 0);
  if (!(inverse_distance > 0.0) || !(spacing_mm > 0.0) || !(intrinsic(1, 1) > 0.0) ||
      !(source_axis_mm > 0.0))
    throw InputError(file.name() + ": SAD and the diagonal of Intrinsic must be above 0");
  PinholeCamera pinhole;
  pinhole.pixels_from_camera << intrinsic(0, 0) / inverse_distance, 0.0, center_px(0, 0), 0.0,
      intrinsic(1, 1) / inverse_distance, center_px(0, 1), 0.0, 0.0, 1.0;
  pinhole.camera_from_room = extrinsic.topLeftCorner(3, 3);
  pinhole.translation_mm = extrinsic.topRightCorner(3, 1);
  StatedRig stated;
  stated.cameras.push_back(
      {.geometry = camera_from_pinhole(file.name(), pinhole, spacing_mm, {1, 1}),
       .has_size = false});
  const CameraGeometry& camera = stated.cameras.front().geometry;
  stated.isocenter_point = camera.source_point + source_axis_mm * camera.beam_direction();
  return stated;
}

std::string write_plastimatch(const CameraRig& rig) {
  const CameraGeometry& camera = rig.cameras.front();
  if (camera.is_mirrored())
    throw InputError("camera '" + camera.name + "': plastimatch cannot state a mirrored camera");
  const double source_axis_mm = camera.depth_mm(rig.isocenter_point);
  const Eigen::Vector3d on_axis = camera.source_point + source_axis_mm * camera.beam_direction();
  constexpr double kOnAxisMm = 1e-6;
  if (!((on_axis - rig.isocenter_point).norm() <= kOnAxisMm))
    throw InputError("camera '" + camera.name +
                     "': plastimatch has the isocentre on the detector's normal through the "
                     "source; the rig's is " +
                     number_text((on_axis - rig.isocenter_point).norm()) + " mm off");
  const PinholeCamera pinhole = pinhole_of(camera);
  const Eigen::Matrix3d& k = pinhole.pixels_from_camera;
  const double distance_mm = camera.source_detector_distance_mm();
  Eigen::Matrix4d extrinsic = Eigen::Matrix4d::Identity();
  extrinsic.topLeftCorner<3, 3>() = pinhole.camera_from_room;
  extrinsic.topRightCorner<3, 1>() = pinhole.translation_mm;
  Eigen::Matrix<double, 3, 4> intrinsic = Eigen::Matrix<double, 3, 4>::Zero();
  intrinsic.diagonal() << 1.0 / camera.pixel_spacing_mm.x(), 1.0 / camera.pixel_spacing_mm.y(),
      1.0 / distance_mm;
  return rows_text(k.topRightCorner<2, 1>().transpose(), " ") +
         rows_text(intrinsic * extrinsic, " ") + number_text(source_axis_mm) + "\n" +
         number_text(distance_mm) + "\n" + rows_text(camera.beam_direction().transpose(), " ") +
         "Extrinsic\n" + rows_text(extrinsic, " ") + "Intrinsic\n" + rows_text(intrinsic, " ");
}

bool is_plastimatch_command(const CameraFile& file) {
  const auto lines = word_lines(file.text);
  return std::ranges::any_of(lines, [](const WordLine& line) {
    const auto at = std::ranges::find(line.words, "plastimatch");
    return at != line.words.end() && at + 1 != line.words.end() && *(at + 1) == "drr";
  });
}

StatedRig read_plastimatch_command(const CameraFile& file, const CameraFileOptions& /*options*/) {
  const DrrCommand command(file);
  command.refuse_other_than({"--nrm",
                             "--vup",
                             "--sad",
                             "--sid",
                             "--dim",
                             "--detector-size",
                             "--image-center",
                             "--isocenter"});
  using Eigen::Vector2d;
  using Eigen::Vector3d;
  const auto default_distance = [](double mm) { return Eigen::VectorXd::Constant(1, mm); };
  const Vector3d normal = command.numbers("--nrm", 3, std::nullopt);
  const Vector3d up = command.numbers("--vup", 3, Vector3d(0.0, 0.0, 1.0));
  const double source_axis_mm = command.numbers("--sad", 1, default_distance(1000.0))[0];
  const double distance_mm = command.numbers("--sid", 1, default_distance(1500.0))[0];
  const Vector2d size = command.numbers("--dim", 2, std::nullopt);
  const Vector2d detector_mm = command.numbers("--detector-size", 2, std::nullopt);
  const Vector2d center_px =
      command.numbers("--image-center", 2, Vector2d(0.5 * (size - Vector2d::Ones())));
  const Vector3d isocenter = command.numbers("--isocenter", 3, Vector3d(0.0, 0.0, 0.0));
  const Vector3d across = normal.cross(up);
  if (!(across.norm() > 1e-6 * normal.norm() * up.norm()))
    throw InputError(file.name() + ": --nrm and --vup must not be parallel");
  if (!(detector_mm.minCoeff() > 0.0) || !(distance_mm > 0.0) || !(source_axis_mm > 0.0))
    throw InputError(file.name() + ": --detector-size, --sad and --sid must be above 0");

  StatedRig stated;
  StatedCamera camera;
  CameraGeometry& geometry = camera.geometry;
  geometry.size_px = size_of(size, file.name() + ": --dim");
  geometry.pixel_spacing_mm = detector_mm.cwiseQuotient(size);
  const Vector3d beam = -normal.normalized();
  // From behind the detector the top is up and, along the beam, columns run to the right.
  geometry.column_direction = beam.cross(up).normalized();
  geometry.row_direction = beam.cross(geometry.column_direction);
  geometry.source_point = isocenter - source_axis_mm * beam;
  geometry.detector_origin_point =
      geometry.source_point + distance_mm * beam -
      center_px.x() * geometry.pixel_spacing_mm.x() * geometry.column_direction -
      center_px.y() * geometry.pixel_spacing_mm.y() * geometry.row_direction;
  stated.isocenter_point = isocenter;
  stated.cameras.push_back(camera);
  return stated;
}

}  // namespace af
