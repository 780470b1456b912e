// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ct/attenuation_volume.h"
#include "precompute/build/precompute_options.h"
#include "precompute/casting/measured_residual.h"
#include "ranks/communicator.h"

namespace af {

/// Measured X-rays of the CT's object at a known pose, minus what the CT casts, held once per node.
struct MeasuredViews {
  std::string path;
  std::string content_sha256;  ///< of cameras and line integrals
  std::vector<ResidualView> views;
  std::shared_ptr<const std::byte> memory;  ///< holds the residuals
  std::uint64_t bytes = 0;                  ///< its size
  double measured_rms = 0.0;  ///< of line integrals, over pixels whose rays the CT attenuates
  double residual_rms = 0.0;  ///< over the same pixels

  /// What was read, in one line for people.
  [[nodiscard]] std::string text() const;
};

/// Collective. Reads the X-rays of the case that `options.projections` names, which must state its
/// true pose, and subtracts what `volume` casts. For a field, reads only views that look along
/// `beam_ct` (from source to CT, ct frame), not against it. For an atlas, reads all. Throws as
/// read_study() and read_view_xray() do. Throws InputError when the case states no gold pose, a
/// value is not finite, the sources are not on a circle, or a common part is to be removed from
/// views of several sizes. Also when the CT leaves more than 0.7 of what was measured (an unrelated
/// object leaves about 1.4), because the X-rays then have another object, geometry or scale of
/// attenuation.
std::shared_ptr<const MeasuredViews> load_measured_views(const PrecomputeOptions& options,
                                                         const AttenuationVolume& volume,
                                                         const Eigen::Vector3d& beam_ct,
                                                         const Communicator& communicator,
                                                         std::vector<std::string>& warnings);

}  // namespace af
