// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "ct/attenuation_volume.h"
#include "geometry/camera_geometry.h"

namespace af {

/// A measured X-ray, and what it holds beyond the CT.
struct ResidualView {
  CameraGeometry camera;            ///< in the ct frame, mm
  std::span<const float> residual;  ///< per pixel, row-major: measured minus cast line integrals; 0
};

/// Why the views cannot come from one orbit of a source about the CT. Empty when they can.
std::vector<std::string> orbit_problems(std::span<const ResidualView> views);

/// Predicts for any ray what X-rays measured along a circle about the CT show beyond the CT's own
/// line integral.
///
/// The plane through a ray and parallel to the circle's axis meets the circle between two
/// neighbouring sources. Both views contribute, with weights linear in the distance along their
/// chord. Each view assumes that its residual is spread along its own rays as the CT's attenuation
/// is. It contributes the mean of the residual at the projections of the ray's points, weighted by
/// the attenuation there. A measured ray projects to one pixel and gets that pixel's residual. The
/// farther a ray is from the circle, the longer the track of its points on the detector, and the
/// more of the residual's detail averages out. Nothing else limits the reach, so there is no width
/// to choose.
///
/// Rays without a view on each side, and points that a view does not see, have residual 0. No value
/// depends on a mathematics library function. \test MeasuredResidual.*
class MeasuredResidual {
 public:
  /// `toward_source`: from the CT to where the field's viewpoints are (ct frame). Views on that
  /// side are used. The residuals must outlive this object. Throws InputError by orbit_problems().
  MeasuredResidual(std::span<const ResidualView> views,
                   const AttenuationVolume& volume,
                   const Eigen::Vector3d& toward_source);

  /// The residual that belongs to the part [begin, end) of the ray from `viewpoint` through
  /// `through` (ct frame), as multiples of the distance between the two. Parts of a ray sum to the
  /// whole.
  [[nodiscard]] double along(const Eigen::Vector3d& viewpoint,
                             const Eigen::Vector3d& through,
                             double begin,
                             double end) const;

  /// Views on the field's side.
  [[nodiscard]] std::size_t view_count() const { return views_.size(); }

 private:
  /// Maps ct points (mm) to homogeneous pixels of a view.
  struct Projection {
    Eigen::Vector3d source_point;
    Eigen::Matrix3d pixels_from_ct;
    Eigen::Vector3d pixels_of_origin;
    int width = 0;
    int height = 0;
    const float* residual = nullptr;
  };
  /// The two views beside a ray, and the ray's position between them, from the first to the second.
  struct Neighbours {
    const Projection* first;
    const Projection* second;
    double share;
  };
  /// A ray as linear functions of the multiple of the distance from viewpoint to plane.
  struct Line {
    Eigen::Vector3d start;
    Eigen::Vector3d change;
  };

  void select_views(std::span<const ResidualView> views, const Eigen::Vector3d& toward_source);
  void make_profile(const AttenuationVolume& volume);
  [[nodiscard]] bool find_neighbours(const Eigen::Vector3d& viewpoint,
                                     const Eigen::Vector3d& direction,
                                     Neighbours& neighbours) const;
  [[nodiscard]] float attenuation_at(const Eigen::Vector3d& cell) const;

  std::vector<Projection> views_;  ///< in order around the axis
  Eigen::Vector3d axis_;           ///< of the circle, unit
  /// The CT's attenuation in cubes of voxels, i fastest. Residuals are spread in depth like it.
  std::array<int, 3> cells_{};
  std::vector<float> attenuation_;
  Eigen::Matrix3d cells_from_ct_;
  Eigen::Vector3d cells_of_origin_;
};

}  // namespace af
