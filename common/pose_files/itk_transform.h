// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "geometry/rigid_transform.h"
#include "pose_files/pose_format.h"

namespace af {

/// A transform as ITK stores it, in text and in HDF5: x' = A (x - c) + c + t, c the fixed
/// parameters (itk::MatrixOffsetTransformBase).
struct ItkTransform {
  std::string type;  ///< "Euler3DTransform_double_3_3"
  std::vector<double> parameters;
  std::vector<double> fixed_parameters;
};

/// The map of the points that the transform maps, as rigid transform. Affine, rigid, versor,
/// quaternion, Euler and translation transforms in three dimensions. InputError for other types
/// and for ones that are not rigid; FileError for wrong numbers of parameters.
RigidTransform map_of_itk_transform(const ItkTransform& transform, const std::string& file);

/// AffineTransform_double_3_3 with its centre at the origin.
ItkTransform itk_transform_of_map(const RigidTransform& map);

// A pose is the resampling direction, ct_from_room in LPS mm: Slicer, applying it to the CT, shows
// the CT in the room.
bool is_itk_text(const PoseFileBytes& file);
PosesInFile read_itk_text(const PoseFileBytes& file, const PoseContext& context);
std::string write_itk_text(std::span<const RigidTransform> room_from_ct,
                           const PoseContext& context);

// The same in HDF5, which xReg and ITK's newer programs write.
bool is_hdf5(const PoseFileBytes& file);
/// Whether an HDF5 file has the group of a transform; false for damaged ones.
bool holds_itk_hdf5_transform(const PoseFileBytes& file);
PosesInFile read_itk_hdf5(const PoseFileBytes& file, const PoseContext& context);
std::string write_itk_hdf5(std::span<const RigidTransform> room_from_ct,
                           const PoseContext& context);

}  // namespace af
