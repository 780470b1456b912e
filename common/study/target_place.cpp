// SPDX-License-Identifier: Apache-2.0
#include "study/target_place.h"

#include <limits>

#include "base/error.h"
#include "files/csv_table.h"
#include "files/toml_reader.h"

namespace af {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// The smallest axis-aligned box around the images of a box's corners.
template <typename Image>
CtBox box_about(const CtBox& box, const Image& image_of) {
  CtBox result{Vector3d::Constant(std::numeric_limits<double>::infinity()),
               Vector3d::Constant(-std::numeric_limits<double>::infinity())};
  for (const Vector3d& corner : box.corner_points()) {
    const Vector3d image = image_of(corner);
    result.low_mm = result.low_mm.cwiseMin(image);
    result.high_mm = result.high_mm.cwiseMax(image);
  }
  return result;
}

bool are_apart(const CtBox& a, const CtBox& b) {
  return (a.low_mm.array() > b.high_mm.array()).any() ||
         (b.low_mm.array() > a.high_mm.array()).any();
}

/// All voxels of a grid including their outer halves, in indices.
CtBox index_box(const CtGrid& grid) {
  const Vector3d size(grid.size[0], grid.size[1], grid.size[2]);
  return {Vector3d::Constant(-0.5), size - Vector3d::Constant(0.5)};
}

std::string range_text(double low, double high) {
  return fixed_text(low, 1) + " to " + fixed_text(high, 1);
}

}  // namespace

CtBox bounding_box(const CtGrid& grid) {
  return box_about(index_box(grid), [&](const Vector3d& index) { return grid.point_mm(index); });
}

std::string beam_problem(const StudyCase& study_case, const CameraGeometry& camera) {
  const RigidTransform& pose = study_case.nominal_room_from_ct;
  constexpr double kLeastDepthMm = 1.0;
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::infinity());
  Vector2d high = -low;
  for (const Vector3d& corner : study_case.target_box_ct.corner_points())
    if (const Vector3d point = pose * corner; camera.depth_mm(point) > kLeastDepthMm) {
      const Vector2d px = camera.project(point);
      low = low.cwiseMin(px);
      high = high.cwiseMax(px);
    }
  const std::string what = "at the nominal pose the target box must lie in the beam of camera '" +
                           camera.name + "', but it is ";
  if (!low.allFinite()) return what + "behind the source";
  const Vector2d last = camera.size_px.cast<double>() - Vector2d::Constant(0.5);
  if ((high.array() >= -0.5).all() && (low.array() <= last.array()).all()) return "";
  return what + "projected to columns " + range_text(low.x(), high.x()) + ", rows " +
         range_text(low.y(), high.y()) + " of " + std::to_string(camera.size_px.x()) + " x " +
         std::to_string(camera.size_px.y()) + " pixels";
}

void require_target_in_ct(const StudyCase& study_case, const CtGrid& ct) {
  const CtBox& target = study_case.target_box_ct;
  const CtBox held = bounding_box(ct);
  const CtBox target_in_voxels =
      box_about(target, [&](const Vector3d& point) { return ct.index_of(point); });
  if (!are_apart(target, held) && !are_apart(target_in_voxels, index_box(ct))) return;
  naming_study_line(study_case.places, "target_box_ct_mm", [&] {
    throw InputError("[" + toml_numbers(target.low_mm) + ", " + toml_numbers(target.high_mm) +
                     "] must reach into the CT, which spans x " +
                     range_text(held.low_mm.x(), held.high_mm.x()) + ", y " +
                     range_text(held.low_mm.y(), held.high_mm.y()) + ", z " +
                     range_text(held.low_mm.z(), held.high_mm.z()) + " mm (LPS)");
  });
}

}  // namespace af
