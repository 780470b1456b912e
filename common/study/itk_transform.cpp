// SPDX-License-Identifier: Apache-2.0
#include "study/itk_transform.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <sstream>

#include "base/error.h"
#include "base/named_rows.h"
#include "base/number_text.h"
#include "base/toml_text.h"
#include "study/pose_file.h"

namespace af {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using RowMajorMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// x' = A (x - c) + c + t, where c is the fixed parameters (itk::MatrixOffsetTransformBase).
struct ItkTransform {
  std::string type;  ///< "Euler3DTransform_double_3_3"
  std::vector<double> parameters;
  std::vector<double> fixed_parameters;
};

Matrix3d rotation_about(const Vector3d& axis, double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix();
}

/// What a rotation of a file must be beside finite.
Matrix3d rotation_of_versor(const ItkTransform& transform, const std::string& file) {
  const Vector3d versor = Eigen::Map<const Vector3d>(transform.parameters.data());
  const double squared_norm = versor.squaredNorm();
  constexpr double kRoundingTolerance = 1e-9;
  if (!(squared_norm <= 1.0 + kRoundingTolerance))
    throw InputError(file + ": the versor's vector part is longer than 1");
  const double scalar = std::sqrt(std::max(0.0, 1.0 - squared_norm));
  return Eigen::Quaterniond(scalar, versor.x(), versor.y(), versor.z())
      .normalized()
      .toRotationMatrix();
}

/// The vector part comes first. ITK divides by the norm.
Matrix3d rotation_of_quaternion(const ItkTransform& transform, const std::string& file) {
  const double* const q = transform.parameters.data();
  const Eigen::Quaterniond quaternion(q[3], q[0], q[1], q[2]);
  constexpr double kTolerance = 1e-5;
  if (!(std::abs(quaternion.norm() - 1.0) <= kTolerance))
    throw InputError(file + ": the quaternion's norm is not 1");
  return quaternion.normalized().toRotationMatrix();
}

/// Rz Rx Ry, or Rz Ry Rx when a fourth fixed parameter says so (itk::Euler3DTransform::ComputeZYX).
Matrix3d rotation_of_euler_angles(const ItkTransform& transform, const std::string& /*file*/) {
  const double* const angle_rad = transform.parameters.data();
  const Matrix3d about_x = rotation_about(Vector3d::UnitX(), angle_rad[0]);
  const Matrix3d about_y = rotation_about(Vector3d::UnitY(), angle_rad[1]);
  const Matrix3d about_z = rotation_about(Vector3d::UnitZ(), angle_rad[2]);
  const bool is_zyx = transform.fixed_parameters.size() > 3 && transform.fixed_parameters[3] != 0.0;
  return is_zyx ? about_z * about_y * about_x : about_z * about_x * about_y;
}

Matrix3d linear_of_matrix(const ItkTransform& transform, const std::string& /*file*/) {
  return Eigen::Map<const RowMajorMatrix3d>(transform.parameters.data());
}

Matrix3d no_rotation(const ItkTransform& /*transform*/, const std::string& /*file*/) {
  return Matrix3d::Identity();
}

/// Translations are the last three parameters, if a type has any.
struct ItkType {
  const char* name;
  std::size_t parameters;
  bool has_translation;
  std::size_t least_fixed;
  std::size_t most_fixed;
  Matrix3d (*linear)(const ItkTransform& transform, const std::string& file);
};

constexpr std::array kItkTypes = {
    ItkType{"AffineTransform", 12, true, 3, 3, linear_of_matrix},
    ItkType{"MatrixOffsetTransformBase", 12, true, 3, 3, linear_of_matrix},
    ItkType{"Rigid3DTransform", 12, true, 3, 3, linear_of_matrix},
    ItkType{"VersorRigid3DTransform", 6, true, 3, 3, rotation_of_versor},
    ItkType{"VersorTransform", 3, false, 3, 3, rotation_of_versor},
    ItkType{"QuaternionRigidTransform", 7, true, 3, 3, rotation_of_quaternion},
    ItkType{"Euler3DTransform", 6, true, 3, 4, rotation_of_euler_angles},
    ItkType{"TranslationTransform", 3, true, 0, 0, no_rotation},
};

constexpr std::array kItkFields = {"Transform", "Parameters", "FixedParameters"};

/// The "Key: value" lines of the one transform in an ITK transform text.
std::map<std::string, std::string> itk_fields(const std::string& text, const std::string& file) {
  std::map<std::string, std::string> fields;
  for (const std::string& line : lines_of(text)) {
    if (line.front() == '#') continue;
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos)
      throw FileError(file, "line '" + beginning_of(line, 40) + "' has no colon");
    if (std::ranges::find(kItkFields, line.substr(0, colon)) == kItkFields.end())
      throw InputError(file + ": field",
                       "'" + beginning_of(line.substr(0, colon), 40) + "'",
                       "must be one of " + joined(kItkFields));
    if (!fields.emplace(line.substr(0, colon), line.substr(colon + 1)).second)
      throw FileError(file,
                      "'" + line.substr(0, colon) + "' is repeated; one transform is expected");
  }
  for (const char* key : kItkFields)
    if (fields.count(key) == 0) throw FileError(file, std::string("has no '") + key + ":' line");
  return fields;
}

/// The map of points by the transform, as a rigid transform. Throws InputError for other types and
/// for transforms that are not rigid, FileError for wrong numbers of parameters.
RigidTransform map_of_itk_transform(const ItkTransform& transform, const std::string& file) {
  const std::string name = transform.type.substr(0, transform.type.find('_'));
  const ItkType* const type = find_row(kItkTypes, name);
  if (type == nullptr || !transform.type.ends_with("_3_3"))
    throw InputError(
        file + ": Transform",
        beginning_of(transform.type, 60),
        "must be one of " + joined(names_of(kItkTypes)) + ", in three dimensions (_double_3_3)");
  const auto check_count =
      [&](const char* what, std::size_t least, std::size_t most, std::size_t found) {
        if (found < least || found > most)
          throw FileError(
              file,
              std::string("number of ") + what,
              std::to_string(least) + (most > least ? " or " + std::to_string(most) : ""),
              std::to_string(found));
      };
  check_count("Parameters", type->parameters, type->parameters, transform.parameters.size());
  check_count(
      "FixedParameters", type->least_fixed, type->most_fixed, transform.fixed_parameters.size());
  const Vector3d center =
      type->least_fixed == 0
          ? Vector3d(Vector3d::Zero())
          : Vector3d(Eigen::Map<const Vector3d>(transform.fixed_parameters.data()));
  const Vector3d translation =
      type->has_translation
          ? Vector3d(Eigen::Map<const Vector3d>(&transform.parameters[type->parameters - 3]))
          : Vector3d(Vector3d::Zero());
  Eigen::Matrix4d map = Eigen::Matrix4d::Identity();
  map.topLeftCorner<3, 3>() = type->linear(transform, file);
  map.topRightCorner<3, 1>() = translation + center - map.topLeftCorner<3, 3>() * center;
  return rigid_or_throw(map, file);
}

}  // namespace

bool is_itk_text(const PoseFileBytes& file) {
  const std::size_t start = file.bytes.find_first_not_of(" \t\r\n");
  return start != std::string::npos && file.bytes.compare(start, 8, "#Insight") == 0;
}

PosesInFile read_itk_text(const PoseFileBytes& file, const PoseContext& /*context*/) {
  const std::string name = file.path.string();
  const auto fields = itk_fields(file.bytes, name);
  ItkTransform transform;
  std::istringstream(fields.at("Transform")) >> transform.type;
  transform.parameters = numbers_of(fields.at("Parameters"), name + ": Parameters");
  transform.fixed_parameters = numbers_of(fields.at("FixedParameters"), name + ": FixedParameters");
  return {{{1, map_of_itk_transform(transform, name).inverse()}}, {}};
}

std::string pose_to_itk_transform(const RigidTransform& room_from_ct) {
  const RigidTransform ct_from_room = room_from_ct.inverse();
  std::string parameters;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      parameters += " " + number_text(ct_from_room.linear()(row, column));
  for (int row = 0; row < 3; ++row)
    parameters += " " + number_text(ct_from_room.translation()[row]);
  return "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
         "Parameters:" +
         parameters + "\nFixedParameters: 0 0 0\n";
}

}  // namespace af
