// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"
#include "xray/image2d.h"

namespace af {

/// Side length of the widest region that registrations look at, relative to the study's region. A
/// field must hold the rays of that widest region.
inline constexpr double kWidestRegionScale = 2.0;

/// What is rendered: a region of one camera's detector.
struct View {
  CameraGeometry camera;
  RegionOfInterest roi;  ///< pixels of the detector, not scaled

  /// The whole detector of a camera.
  static View whole_detector(const CameraGeometry& camera);
  [[nodiscard]] std::size_t pixel_count() const { return roi.pixel_count(); }
  /// The region with its sides multiplied by `scale` about its centre and cut at the detector's
  /// edges. At least one pixel.
  [[nodiscard]] View scaled(double scale) const;
  /// The same region seen by pixels `factor` times as wide and high. Each lies at the centre of
  /// gravity of factor x factor pixels, counted from the region's corner. The coarse detector is
  /// the region alone (roi.column = roi.row = 0). Columns and rows that fill no coarse pixel are
  /// left out.
  [[nodiscard]] View coarser(int factor) const;
};

/// Request for pose derivatives: six planes of pixel_count() values, dU/d(rx, ry, rz) per rad, then
/// dU/d(tx, ty, tz) per mm. The derivatives are at zero, of x_room -> p + t + Rz Ry Rx (x_room - p)
/// applied after room_from_ct, where p is `pivot_room_point`.
struct PoseGradients {
  Eigen::Vector3d pivot_room_point = Eigen::Vector3d::Zero();
  std::span<float> planes;
};

struct RenderStatus {
  std::int64_t rays_outside = 0;  ///< rays that the field does not hold; their pixels are 0

  [[nodiscard]] bool is_inside() const { return rays_outside == 0; }
  /// "5 of 2304 rays miss its planes, or attenuation lies behind or around their source"
  [[nodiscard]] std::string text(const View& view) const;
};

/// Scratch memory of one thread, made by the renderer that uses it.
class RenderWorkspace {
 public:
  virtual ~RenderWorkspace() = default;

  /// Allows or forbids a DRR to reuse what an earlier one, with gradients and from a nearby source,
  /// left here (KeptImages). That gives nearly the same values in half the time, but they are no
  /// longer a function of the pose alone. Initially forbidden. Every call also discards what was
  /// left. Renderers that leave nothing ignore it.
  virtual void reuse_images(bool /*is_allowed*/) {}
};

/// Makes DRRs of one CT. Fields and ray casting are compared by swapping this object. render() is
/// const, and re-entrant with one workspace per thread. Results do not depend on threads or vector
/// width.
class DrrRenderer {
 public:
  virtual ~DrrRenderer() = default;

  /// Writes the total attenuation of every ray of the view into `total_attenuation`
  /// (view.pixel_count() values): dimensionless, row-major over view.roi. Never extrapolates: rays
  /// outside are counted, and their pixels are 0.
  virtual RenderStatus render(
      const RigidTransform& room_from_ct,
      const View& view,
      RenderWorkspace& workspace,
      std::span<float> total_attenuation,
      const std::optional<PoseGradients>& gradients = std::nullopt) const = 0;

  /// The rays_outside that render() would report, without making a DRR. It is 0 where nothing
  /// limits the rays. \test TwoPassAfDrr.CountsTheRaysThatRenderingCounts
  [[nodiscard]] virtual std::int64_t rays_outside(const RigidTransform& /*room_from_ct*/,
                                                  const View& /*view*/) const {
    return 0;
  }

  [[nodiscard]] virtual std::unique_ptr<RenderWorkspace> make_workspace() const = 0;

  /// "field" or "raycast", as in result tables.
  [[nodiscard]] virtual const char* name() const = 0;
};

/// Renders into a fresh image. `rays_outside`, when given, receives the count.
Image2d render_image(const DrrRenderer& renderer,
                     const RigidTransform& room_from_ct,
                     const View& view,
                     std::int64_t* rays_outside = nullptr);

}  // namespace af
