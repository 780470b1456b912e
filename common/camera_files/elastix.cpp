// SPDX-License-Identifier: Apache-2.0
// Transform parameters of elastix with (FocalPoint x y z) of its ray-casting interpolators: the
// fixed image is the X-ray, a slice of one voxel in the CT's physical space (LPS, mm), and its
// Size, Spacing, Origin and Direction stand beside. Rays run from its pixels to the focal point.
#include <algorithm>
#include <array>
#include <map>

#include <Eigen/Dense>

#include "base/error.h"
#include "base/joined.h"
#include "base/toml_text.h"
#include "camera_files/camera_text.h"
#include "camera_files/format_readers.h"

namespace af {

namespace {

/// "(Key value value ...)" lines; comments begin with "//".
class ElastixParameters {
 public:
  static constexpr std::array kKnown = {"FocalPoint",
                                        "Size",
                                        "Index",
                                        "Spacing",
                                        "Origin",
                                        "Direction",
                                        "PreParameters",
                                        "UseDirectionCosines",
                                        "Transform",
                                        "NumberOfParameters",
                                        "TransformParameters",
                                        "InitialTransformParametersFileName",
                                        "InitialTransformParameterFileName",
                                        "HowToCombineTransforms",
                                        "CenterOfRotationPoint",
                                        "ComputeZYX",
                                        "FixedImageDimension",
                                        "MovingImageDimension",
                                        "FixedInternalImagePixelType",
                                        "MovingInternalImagePixelType",
                                        "ResampleInterpolator",
                                        "FinalBSplineInterpolationOrder",
                                        "Threshold",
                                        "Resampler",
                                        "DefaultPixelValue",
                                        "ResultImageFormat",
                                        "ResultImagePixelType",
                                        "CompressResultImage"};

  explicit ElastixParameters(const CameraFile& file) : file_(file.name()) {
    for (const WordLine& line : word_lines(file.text)) {
      if (line.text.starts_with("//")) continue;
      if (!line.text.starts_with('('))
        throw FileError(place_of(line, file_),
                        "'" + beginning_of(line.text, 60) + "' is no parameter in brackets");
      const std::size_t close = line.text.find(')');
      if (close == std::string_view::npos)
        throw FileError(place_of(line, file_), "truncated: a parameter is not closed");
      const std::string_view inside = line.text.substr(1, close - 1);
      const std::size_t space = std::min(inside.find_first_of(" \t"), inside.size());
      const auto values = word_lines(inside.substr(space));
      const std::string key(inside.substr(0, space));
      const WordLine value = {
          line.number, line.text, values.empty() ? line_without_words() : values[0].words};
      if (!values_.emplace(key, value).second)
        throw InputError(place_of(line, file_) + ": (" + key + " ...) is there twice");
    }
  }

  /// Whether a parameter is that word, quoted.
  [[nodiscard]] bool says(const char* key, std::string_view word) const {
    const auto found = values_.find(key);
    return found != values_.end() && found->second.words.size() == 1 &&
           found->second.words.front() == word;
  }

  /// Parameters that are neither of the camera nor without meaning for it.
  [[nodiscard]] std::vector<std::string> unknown() const {
    std::vector<std::string> unknown;
    for (const auto& [key, value] : values_)
      if (std::ranges::find(kKnown, key) == kKnown.end()) unknown.push_back(key);
    return unknown;
  }

  [[nodiscard]] Eigen::VectorXd numbers(const char* key, Eigen::Index count) const {
    const auto found = values_.find(key);
    if (found == values_.end())
      throw InputError(file_ + ": (" + key +
                       " ...) is missing; transform parameters of elastix hold it");
    return numbers_of(found->second, count, file_);
  }

  /// All of a parameter's numbers are 0, or it is not there.
  [[nodiscard]] bool is_zero(const char* key) const {
    const auto found = values_.find(key);
    if (found == values_.end()) return true;
    return numbers_of(found->second, static_cast<Eigen::Index>(found->second.words.size()), file_)
        .isZero(0.0);
  }

 private:
  static std::vector<std::string_view> line_without_words() { return {}; }

  std::string file_;
  std::map<std::string, WordLine> values_;
};

}  // namespace

bool is_elastix(const CameraFile& file) {
  const auto lines = word_lines(file.text);
  return std::ranges::any_of(
      lines, [](const WordLine& line) { return line.text.starts_with("(FocalPoint"); });
}

StatedRig read_elastix(const CameraFile& file, const CameraFileOptions& /*options*/) {
  const ElastixParameters parameters(file);
  if (!parameters.is_zero("PreParameters"))
    throw InputError(file.name() + ": PreParameters must be 0: they turn the CT, not the camera");
  const Eigen::Vector3d size = parameters.numbers("Size", 3);
  if (size.z() != 1.0) throw InputError(file.name() + ": Size: the X-ray must be a single slice");
  if (!parameters.is_zero("Index")) throw InputError(file.name() + ": Index must be 0 0 0");
  const Eigen::Vector3d spacing_mm = parameters.numbers("Spacing", 3);
  const Eigen::VectorXd direction = parameters.numbers("Direction", 9);
  if (parameters.says("UseDirectionCosines", "\"false\""))
    throw InputError(file.name() + ": UseDirectionCosines must be \"true\": Direction is read");
  if (!(spacing_mm.minCoeff() > 0.0)) throw InputError(file.name() + ": Spacing must be above 0");
  StatedRig stated;
  StatedCamera camera;
  camera.geometry.size_px = size_of(size.head<2>(), file.name() + ": Size");
  camera.geometry.source_point = parameters.numbers("FocalPoint", 3);
  camera.geometry.detector_origin_point = parameters.numbers("Origin", 3);
  // elastix lists the matrix column by column: the first three are the direction of columns.
  camera.geometry.column_direction = direction.head<3>();
  camera.geometry.row_direction = direction.segment<3>(3);
  camera.geometry.pixel_spacing_mm = spacing_mm.head<2>();
  for (const std::string& problem : problems([&] {
         CameraGeometry named = camera.geometry;
         named.name = "of the file";
         return named;
       }()))
    throw InputError(file.name() + ": " + problem);
  stated.cameras.push_back(camera);
  if (!parameters.is_zero("TransformParameters"))
    stated.notes.push_back(file.name() +
                           ": TransformParameters are a pose of the CT and are not read");
  if (const auto unknown = parameters.unknown(); !unknown.empty())
    stated.notes.push_back(file.name() + ": not read: " + joined(unknown));
  return stated;
}

/// Parameters that transformix takes: the CT as moving image gives the DRR at the identity.
std::string write_elastix(const CameraRig& rig) {
  const CameraGeometry& camera = rig.cameras.front();
  Eigen::Matrix3d direction;
  direction << camera.column_direction, camera.row_direction,
      camera.column_direction.cross(camera.row_direction);
  const auto line = [](const char* key, const std::string& values) {
    return std::string("(") + key + " " + values + ")\n";
  };
  const auto numbers = [](const Eigen::MatrixXd& values) {
    return numbers_text(values.reshaped().transpose(), " ");
  };
  return "// Camera " + camera.name + "\n" + line("Transform", "\"EulerTransform\"") +
         line("NumberOfParameters", "6") + line("TransformParameters", "0 0 0 0 0 0") +
         line("InitialTransformParametersFileName", "\"NoInitialTransform\"") +
         line("HowToCombineTransforms", "\"Compose\"") +
         line("CenterOfRotationPoint", numbers(rig.isocenter_point)) +
         line("ComputeZYX", "\"false\"") + line("FixedImageDimension", "3") +
         line("MovingImageDimension", "3") + line("FixedInternalImagePixelType", "\"float\"") +
         line("MovingInternalImagePixelType", "\"float\"") +
         line(
             "Size",
             std::to_string(camera.size_px.x()) + " " + std::to_string(camera.size_px.y()) + " 1") +
         line("Index", "0 0 0") +
         line("Spacing", numbers_text(camera.pixel_spacing_mm.transpose(), " ") + " 1") +
         line("Origin", numbers(camera.detector_origin_point)) +
         line("Direction", numbers(direction)) + line("UseDirectionCosines", "\"true\"") +
         line("ResampleInterpolator", "\"FinalRayCastInterpolator\"") +
         line("FocalPoint", numbers(camera.source_point)) + line("PreParameters", "0 0 0 0 0 0") +
         line("Threshold", "0") + line("Resampler", "\"DefaultResampler\"") +
         line("DefaultPixelValue", "0") + line("ResultImageFormat", "\"mha\"") +
         line("ResultImagePixelType", "\"float\"") + line("CompressResultImage", "\"false\"");
}

}  // namespace af
