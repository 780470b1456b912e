// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "ct/ct_identity.h"
#include "ct/ct_read_options.h"
#include "ct/ct_volume.h"

namespace af {

/// Reads a CT (DICOM folder, NIfTI, MetaImage, NRRD) as HU in int16, in DICOM LPS. The rescale is
/// applied, values are rounded and clamped to int16, and `options` may ask for more. Warnings (for
/// example values that do not look like HU) go to `warnings` when given.
/// InputError (exit 3): several series (lists UID, description, slice count of each); missing or
/// uneven slices (names the position) and gantry tilt, unless they are to be resampled; a modality
/// other than CT; not 3-D; NaN or infinite values; HU beyond 1e6; all air (no voxel >= -900 HU); no
/// spacing, or one that is not 0.01 to 100 mm; an origin beyond 10 m; a direction that is not
/// orthonormal; fewer than 2 voxels on an axis.
/// FileError (exit 4): missing, not an image, truncated, corrupt.
CtVolume read_ct(const std::filesystem::path& path,
                 const CtReadOptions& options = {},
                 std::vector<std::string>* warnings = nullptr);

/// DICOM's Frame of Reference UID of the series that read_ct() reads, from headers alone. Empty for
/// other formats and where the series states none. `path` may also be a single DICOM file. Throws
/// InputError when the folder holds several series and `options` choose none, FileError when a file
/// is damaged.
std::string ct_frame_of_reference(const std::filesystem::path& path, const CtReadOptions& options);

/// The grid that read_ct() takes for a stated one. Axes within kMaxDirectionError of orthonormal
/// become so, with a warning when that moves a corner by more than kSamePlaceMm. Throws InputError
/// naming `file` for a grid that it would refuse: too few voxels, an implausible spacing or origin,
/// other axes.
CtGrid sound_grid(const CtGrid& grid,
                  const std::string& file,
                  std::vector<std::string>* warnings = nullptr);

/// Writes a CT (int16) atomically, in the format of the extension (.mha .nii.gz .nrrd).
void write_ct(const CtVolume& ct, const std::filesystem::path& path);

/// Identifies a CT. The hash covers size (three little-endian int32) and voxels (little-endian
/// int16, i fastest), with axes in ascending LPS: files may store the same CT along other axes, or
/// along reversed ones.
CtIdentity identity_of(const CtVolume& ct);

}  // namespace af
