// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "ct/ct_volume.h"
#include "unit/ct/dicom_test_file.h"

namespace af::test {

/// A small CT without any symmetry: air, a soft-tissue block, a bone corner, every voxel different
/// by position.
CtVolume asymmetric_ct(const CtGrid& grid);

/// 7 x 6 x 5 voxels of 0.8 x 0.9 x 1.5 mm, away from the origin, axes L, P, S.
CtGrid small_grid();

/// Called with each slice (counted from the foot) before it is written; may change or spoil it.
using SliceEdit = std::function<void(int slice, DicomTestFile& file)>;

/// Writes a CT as a DICOM series, with file names whose order says nothing about positions. The
/// grid's third axis must be the cross product of the others.
void write_dicom_series(const CtVolume& ct,
                        const std::filesystem::path& folder,
                        const SliceEdit& edit = {},
                        const std::string& series_uid = "1.2.826.0.1.3680043.2.1",
                        const std::string& name_prefix = "IM");

/// An X-ray of 12 bits in 16, 0.4 mm pixels, LIN, with a window; frame f (from 0) holds `levels` +
/// f.
DicomTestFile xa_file(int columns, int rows, int frames, const std::vector<int>& levels);

}  // namespace af::test
