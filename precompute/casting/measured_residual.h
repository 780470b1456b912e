// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "geometry/camera_geometry.h"
#include "volume/attenuation_volume.h"

namespace af {

/// A measured X-ray and what it holds beyond the CT.
struct ResidualView {
  CameraGeometry camera;            ///< in the ct frame, mm
  std::span<const float> residual;  ///< per pixel, row-major: measured less cast line integrals; 0
                                    ///< where nothing was measured
};

/// Why views cannot be those of one orbit of a source about the CT; empty when they can.
std::vector<std::string> orbit_problems(std::span<const ResidualView> views);

/// What measured X-rays, taken along a circle about the CT, say of any ray beyond the CT's own line
/// integral.
///
/// In the plane of a ray and the circle's axis lies one point of the circle between two
/// neighbouring sources: both views are asked, with weights linear in the distance along their
/// chord. A view tells of a ray what it would if its residual were spread along its own rays as the
/// CT's attenuation is: the mean of the residual at the projections of the ray's points, weighted
/// by the attenuation there. A ray that was measured projects to one pixel, whose residual is the
/// answer; the farther a ray leaves the circle, the longer the track of its points on the detector,
/// and the more of the residual's detail averages out. That is the whole fall-off: there is no
/// width to choose.
///
/// Rays that no two views stand to both sides of, and points that a view does not see, have
/// residual 0. No function of the mathematics library decides a value. \test MeasuredResidual.*
class MeasuredResidual {
 public:
  /// `toward_source`: from the CT to where the field's viewpoints are (ct frame); views on that
  /// side are used. The residuals must outlive this object. InputError by orbit_problems().
  MeasuredResidual(std::span<const ResidualView> views,
                   const AttenuationVolume& volume,
                   const Eigen::Vector3d& toward_source);

  /// The residual that belongs to the part [begin, end) of the ray from `viewpoint` through
  /// `through` (ct frame), as multiples of the way between the two. Parts of a ray sum to the
  /// whole.
  [[nodiscard]] double along(const Eigen::Vector3d& viewpoint,
                             const Eigen::Vector3d& through,
                             double begin,
                             double end) const;

  /// Views on the field's side.
  [[nodiscard]] std::size_t view_count() const { return views_.size(); }

 private:
  /// A view as a map of ct points (mm) to homogeneous pixels.
  struct Projection {
    Eigen::Vector3d source_point;
    Eigen::Matrix3d pixels_from_ct;
    Eigen::Vector3d pixels_of_origin;
    int width = 0;
    int height = 0;
    const float* residual = nullptr;
  };
  /// The two views beside a ray, and how far it is from the first to the second.
  struct Neighbours {
    const Projection* first;
    const Projection* second;
    double share;
  };
  /// A ray as linear functions of the multiple of the way from viewpoint to plane.
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
  /// The CT's attenuation in cubes of voxels, i fastest: how residuals are spread in depth.
  std::array<int, 3> cells_{};
  std::vector<float> attenuation_;
  Eigen::Matrix3d cells_from_ct_;
  Eigen::Vector3d cells_of_origin_;
};

}  // namespace af
