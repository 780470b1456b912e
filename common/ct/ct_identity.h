// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <tuple>

#include "geometry/ct_grid.h"

namespace af {

/// Which CT it is: its voxels, and where they lie. The order of axes in its file does not matter.
struct CtIdentity {
  std::string content_sha256;  ///< of size and int16 HU voxels, axes in ascending LPS
  CtGrid grid;                 ///< its axes in ascending LPS

  auto members() {
    return std::tie(content_sha256, grid.size, grid.origin_mm, grid.spacing_mm, grid.direction);
  }
};

/// The hash, and the places of the first and the last voxel.
std::string text(const CtIdentity& ct);

/// What makes `found` another CT than `expected`: other voxels, or the corner that lies farthest
/// off. Empty when they are the same CT.
std::string ct_difference(const CtIdentity& expected, const CtIdentity& found);

/// Throws FileError unless the file at `path` holds `expected`, which messages call `expected_is`.
void require_same_ct(const std::string& path,
                     const CtIdentity& expected,
                     const std::string& expected_is,
                     const CtIdentity& found);

}  // namespace af
