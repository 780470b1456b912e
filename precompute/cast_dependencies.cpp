// SPDX-License-Identifier: Apache-2.0
#include "precompute/cast_dependencies.h"

#include <string>

#include "text/options_toml.h"

namespace af {

namespace {

std::string numbers_text(const double* values, Eigen::Index count) {
  std::string text = "[";
  for (Eigen::Index i = 0; i < count; ++i) text += (i > 0 ? ", " : "") + toml_float(values[i]);
  return text + "]";
}

template <typename Derived>
std::string numbers_text(const Eigen::PlainObjectBase<Derived>& matrix) {
  return numbers_text(matrix.data(), matrix.size());
}

}  // namespace

DecidingValues cast_dependencies(const PrecomputeOptions& options,
                                 const FieldSource& source,
                                 const std::vector<FieldPart>& parts) {
  DecidingValues decides = deciding_values(deciding_options(options, kCastingStage), {});
  const auto add_camera = [&](const CameraGeometry& camera, const std::string& what) {
    decides[what] = camera.name;
    decides[what + " source_point"] = numbers_text(camera.source_point);
    decides[what + " detector_origin_point"] = numbers_text(camera.detector_origin_point);
    decides[what + " column_direction"] = numbers_text(camera.column_direction);
    decides[what + " row_direction"] = numbers_text(camera.row_direction);
    decides[what + " pixel_spacing_mm"] = numbers_text(camera.pixel_spacing_mm);
    decides[what + " size_px"] =
        std::to_string(camera.size_px.x()) + " x " + std::to_string(camera.size_px.y());
  };
  decides["ct_content_sha256"] = source.ct_content_sha256;
  if (source.projections != nullptr)
    decides["projections sha256"] = source.projections->content_sha256;
  add_camera(source.camera, "camera");
  for (std::size_t i = 0; i < source.more_cameras.size(); ++i)
    add_camera(source.more_cameras[i], "covered camera " + std::to_string(i + 1));
  for (std::size_t i = 0; options.is_atlas() && i < parts.size(); ++i) {
    const FieldSource& part = parts[i].source;
    const std::string of_member = " of member " + std::to_string(i);
    add_camera(part.camera, "camera" + of_member);
    decides["range" + of_member] = numbers_text(part.range.low.deg_and_mm().data(), 6) + " " +
                                   numbers_text(part.range.high.deg_and_mm().data(), 6);
    for (const HalfSpace& half_space : part.sources)
      decides["sources" + of_member] +=
          numbers_text(half_space.normal) + " " + numbers_text(&half_space.offset_mm, 1) + " ";
  }
  decides["nominal rotation"] = numbers_text(source.frame.rotation);
  decides["center_ct_mm"] = numbers_text(source.frame.center_ct_mm);
  decides["nominal center_room_mm"] = numbers_text(source.frame.center_room_mm);
  if (!options.cover.empty()) {
    decides["covered from"] = numbers_text(source.range.low.deg_and_mm().data(), 6);
    decides["covered to"] = numbers_text(source.range.high.deg_and_mm().data(), 6);
  }
  return decides;
}

}  // namespace af
