// SPDX-License-Identifier: Apache-2.0
// ITK's transforms in HDF5 (itk::HDF5TransformIO): a group of each transform, whose datasets are
// its type and its two lists of numbers. Files are read from and written to memory.
#include <algorithm>
#include <array>

#include "base/error.h"
#include "hdf5_files/hdf5_input.h"
#include "hdf5_files/hdf5_output.h"
#include "pose_files/itk_transform.h"

namespace af {
namespace {

constexpr const char* kGroup = "/TransformGroup";
constexpr const char* kTransform = "/TransformGroup/0";
constexpr const char* kTypeName = "/TransformGroup/0/TransformType";
/// ITK 4 wrote both lists without the s.
constexpr const char* kParameters = "/TransformGroup/0/TransformParameters";
constexpr const char* kParametersOfItk4 = "/TransformGroup/0/TranformParameters";
constexpr const char* kFixed = "/TransformGroup/0/TransformFixedParameters";
constexpr const char* kFixedOfItk4 = "/TransformGroup/0/TranformFixedParameters";

std::vector<double> list_in(const Hdf5Input& file, const char* name, const char* name_of_itk4) {
  constexpr std::size_t kMost = 16;
  return file.numbers(file.holds(name) || !file.holds(name_of_itk4) ? name : name_of_itk4, kMost)
      .values;
}

ItkTransform transform_in(const Hdf5Input& file) {
  if (!file.holds(kTransform))
    throw FileError(file.name(), std::string("has no ") + kTransform + ": not an ITK transform");
  if (file.holds("/TransformGroup/1"))
    throw InputError(file.name() + ": holds several transforms (a composite one); one is expected");
  constexpr std::array kKnown = {kTypeName, kParameters, kParametersOfItk4, kFixed, kFixedOfItk4};
  for (const std::string& name : file.names_in(kTransform))
    if (std::ranges::find(kKnown, std::string(kTransform) + "/" + name) == kKnown.end())
      throw InputError(file.name() + ": " + kTransform, name, "is not known in a transform");
  return {file.text(kTypeName),
          list_in(file, kParameters, kParametersOfItk4),
          list_in(file, kFixed, kFixedOfItk4)};
}

template <typename Read>
auto read_hdf5(const PoseFileBytes& file, const Read& read) {
  const std::string name = file.path.string();
  return read_distrusted(
      name, [&] { return Hdf5Input::of_bytes(file.bytes, name); }, read);
}

}  // namespace

bool is_hdf5(const PoseFileBytes& file) {
  return is_hdf5_head(file.bytes);
}

bool holds_itk_hdf5_transform(const PoseFileBytes& file) {
  if (!is_hdf5(file)) return false;
  try {
    return read_hdf5(file, [](const Hdf5Input& hdf5) { return hdf5.holds(kGroup); });
  } catch (const FileError&) {
    return false;
  }
}

PosesInFile read_itk_hdf5(const PoseFileBytes& file, const PoseContext& /*context*/) {
  const ItkTransform transform = read_hdf5(file, transform_in);
  return {{{1, map_of_itk_transform(transform, file.path.string()).inverse()}}, {}};
}

std::string write_itk_hdf5(std::span<const RigidTransform> room_from_ct,
                           const PoseContext& /*context*/) {
  const ItkTransform transform =
      itk_transform_of_map(only_pose(room_from_ct, "itk-hdf5").inverse());
  Hdf5Output file;
  file.add_text("/ITKVersion", "5.2.1");
  file.add_text("/HDFVersion", "HDF5");
  file.add_text("/OSName", "-");
  file.add_text("/OSVersion", "-");
  file.add_group(kGroup);
  file.add_group(kTransform);
  file.add_text(kTypeName, transform.type);
  file.add_numbers(kFixed, transform.fixed_parameters);
  file.add_numbers(kParameters, transform.parameters);
  return file.bytes();
}

}  // namespace af
