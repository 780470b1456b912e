// SPDX-License-Identifier: Apache-2.0
#include "drr/drr_renderer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"

namespace af {

View View::whole_detector(const CameraGeometry& camera) {
  return {camera, {0, 0, camera.size_px.x(), camera.size_px.y()}};
}

View View::scaled(double scale) const {
  const auto extent = [&](int first, int count, int limit) {
    const double middle = first + count / 2.0;
    const double half = count * scale / 2.0;
    const int begin = std::max(0, static_cast<int>(std::lround(middle - half)));
    const int end = std::min(limit, static_cast<int>(std::lround(middle + half)));
    return std::pair(std::min(begin, limit - 1), std::max(1, end - begin));
  };
  const auto [column, width] = extent(roi.column, roi.width, camera.size_px.x());
  const auto [row, height] = extent(roi.row, roi.height, camera.size_px.y());
  return {camera, {column, row, width, height}};
}

View View::coarser(int factor) const {
  check(factor >= 1 && roi.width >= factor && roi.height >= factor,
        "a coarse pixel must fit into the region");
  const double center = 0.5 * (factor - 1);
  View coarse = *this;
  coarse.camera.detector_origin_point =
      camera.detector_point(roi.column + center, roi.row + center);
  coarse.camera.pixel_spacing_mm = factor * camera.pixel_spacing_mm;
  coarse.camera.size_px = {roi.width / factor, roi.height / factor};
  coarse.roi = {0, 0, roi.width / factor, roi.height / factor};
  return coarse;
}

std::string RenderStatus::text(const View& view) const {
  return std::to_string(rays_outside) + " of " + std::to_string(view.pixel_count()) +
         " rays miss its planes, or attenuation lies behind or around their source";
}

Image2d render_image(const DrrRenderer& renderer,
                     const RigidTransform& room_from_ct,
                     const View& view,
                     std::int64_t* rays_outside) {
  Image2d image(view.roi.width, view.roi.height);
  const auto workspace = renderer.make_workspace();
  const RenderStatus status = renderer.render(room_from_ct, view, *workspace, image.pixels);
  if (rays_outside != nullptr) *rays_outside = status.rays_outside;
  return image;
}

}  // namespace af
