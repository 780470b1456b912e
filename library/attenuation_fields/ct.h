// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "attenuation_fields/export.h"
#include "attenuation_fields/geometry.h"

namespace attenuation_fields {

/// Where a CT's voxels lie in the ct frame (DICOM LPS, mm).
struct ATTENUATION_FIELDS_API CtGrid {
  std::array<int, 3> size = {0, 0, 0};  ///< voxels along i, j, k
  Vector3 origin_mm = {0.0, 0.0, 0.0};  ///< centre of voxel (0, 0, 0)
  Vector3 spacing_mm = {1.0, 1.0, 1.0};
  /// Columns: directions of i, j, k; row by row.
  std::array<double, 9> direction = {1, 0, 0, 0, 1, 0, 0, 0, 1};

  [[nodiscard]] Vector3 center_mm() const;
};

/// A CT in Hounsfield units. Copies share the voxels, which do not change.
class ATTENUATION_FIELDS_API Ct {
 public:
  /// Reads a DICOM folder, or a NIfTI, MetaImage or NRRD file. `series_uid` chooses one of several
  /// DICOM series. Throws InputError and FileError as the programs do.
  static Ct read(const std::filesystem::path& path, const std::string& series_uid = "");
  /// Uses voxels that exist already, i fastest. `owner` keeps them, and nobody may change them.
  /// Throws InputError when their number does not fit the grid, or the grid is invalid.
  static Ct from_voxels(const CtGrid& grid,
                        std::shared_ptr<const void> owner,
                        std::span<const std::int16_t> hu);

  [[nodiscard]] const CtGrid& grid() const;
  /// HU, i fastest.
  [[nodiscard]] std::span<const std::int16_t> hu() const;
  /// What read() found odd.
  [[nodiscard]] const std::vector<std::string>& warnings() const;
  /// Hash over size and voxels in ascending LPS, so that one CT has the same hash in every format.
  /// It does not say where the voxels lie; Field::is_of() compares that too.
  [[nodiscard]] std::string content_sha256() const;

 private:
  friend class Field;
  friend class RayCaster;
  struct Impl;
  explicit Ct(std::shared_ptr<const Impl> impl);
  std::shared_ptr<const Impl> impl_;
};

}  // namespace attenuation_fields
