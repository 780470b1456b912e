// SPDX-License-Identifier: Apache-2.0
#include "precompute/cast_dependencies.h"

#include <string>
#include <utility>

#include "files/options_toml.h"

namespace af {

namespace {

template <typename Derived>
std::string numbers_text(const Eigen::PlainObjectBase<Derived>& matrix) {
  std::string text = "[";
  for (Eigen::Index i = 0; i < matrix.size(); ++i)
    text += (i > 0 ? ", " : "") + toml_float(matrix.data()[i]);
  return text + "]";
}

}  // namespace

DecidingValues cast_dependencies(const PrecomputeOptions& options,
                                 const FieldSource& source,
                                 const std::vector<FieldPart>& parts) {
  DecidingValues decides =
      deciding_values(deciding_options(options, kCastingStage), {{"ct", source.ct}});
  const auto add_camera = [&](const CameraGeometry& camera, const std::string& what) {
    decides[what] = camera.name;
    decides[what + " source_point"] = camera.source_point;
    decides[what + " detector_origin_point"] = camera.detector_origin_point;
    decides[what + " column_direction"] = numbers_text(camera.column_direction);
    decides[what + " row_direction"] = numbers_text(camera.row_direction);
    decides[what + " pixel_spacing_mm"] = numbers_text(camera.pixel_spacing_mm);
    decides[what + " size_px"] =
        std::to_string(camera.size_px.x()) + " x " + std::to_string(camera.size_px.y());
  };
  const auto add_range = [&](const MotionRange& range, const std::string& what) {
    for (const auto& [end, pose] : {std::pair(" from", range.low), std::pair(" to", range.high)}) {
      decides[what + end + ", deg"] = Eigen::Vector3d(pose.rotation_rad * kDegPerRad);
      decides[what + end + ", mm"] = pose.translation_mm;
    }
  };
  if (source.projections != nullptr)
    decides["projections sha256"] = source.projections->content_sha256;
  add_camera(source.camera, "camera");
  for (std::size_t i = 0; i < source.more_cameras.size(); ++i)
    add_camera(source.more_cameras[i], "covered camera " + std::to_string(i + 1));
  for (std::size_t i = 0; options.is_atlas() && i < parts.size(); ++i) {
    const FieldSource& part = parts[i].source;
    const std::string of_member = " of member " + std::to_string(i);
    add_camera(part.camera, "camera" + of_member);
    add_range(part.range, "range" + of_member);
    for (std::size_t k = 0; k < part.sources.size(); ++k) {
      const std::string bound = "sources" + of_member + ", bound " + std::to_string(k);
      decides[bound] = numbers_text(part.sources[k].normal);
      decides[bound + ", mm"] = Eigen::Vector3d(part.sources[k].offset_mm * part.sources[k].normal);
    }
  }
  decides["nominal rotation"] = numbers_text(source.frame.rotation);
  decides["center_ct_mm"] = source.frame.center_ct_mm;
  decides["nominal center_room_mm"] = source.frame.center_room_mm;
  if (!options.cover.empty()) add_range(source.range, "covered");
  return decides;
}

}  // namespace af
