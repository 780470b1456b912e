// SPDX-License-Identifier: Apache-2.0
#include "figures/room_sketch.h"

#include <algorithm>
#include <limits>

#include "figures/patient_directions.h"

namespace af {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Things of the room as lines and marks, before they are projected.
struct RoomLine {
  std::vector<Vector3d> points;
  PictureColor color;
  double width_px;
  bool is_far = false;  ///< may lead off the paper: a ray from a source
};
struct RoomMark {
  Vector3d place;
  PictureMark::Shape shape;
  std::string text;
  PictureColor color;
};
struct RoomScene {
  std::vector<RoomLine> lines;
  std::vector<RoomMark> marks;
  std::vector<RoomMark> sources;
};

/// How a drawing's axes lie in the room: to the right, and up.
struct Projection {
  const char* title;
  const char* caption;
  Vector3d right;
  Vector3d up;
};

std::vector<Vector3d> closed(std::vector<Vector3d> corners) {
  corners.push_back(corners.front());
  return corners;
}

void add_camera(const CameraGeometry& camera, RoomScene& scene) {
  const auto corners = camera.detector_corner_points();
  // detector_corner_points() may return them in any order. Here they go around the rectangle.
  const double columns = camera.size_px.x() - 0.5;
  const double rows = camera.size_px.y() - 0.5;
  const std::vector<Vector3d> around = {camera.detector_point(-0.5, -0.5),
                                        camera.detector_point(columns, -0.5),
                                        camera.detector_point(columns, rows),
                                        camera.detector_point(-0.5, rows)};
  for (const Vector3d& corner : corners)
    scene.lines.push_back({{camera.source_point, corner}, PictureColor::Yellow, 0.8, true});
  scene.lines.push_back({closed(around), PictureColor::Ink, 2.0});
  // The first row in red: it is the picture's top edge, and (0, 0) its left corner.
  scene.lines.push_back({{around[0], around[1]}, PictureColor::Red, 3.5});
  scene.marks.push_back({around[0], PictureMark::Shape::Dot, "(0,0)", PictureColor::Red});
  scene.sources.push_back(
      {camera.source_point, PictureMark::Shape::Dot, camera.name, PictureColor::Ink});
}

void add_ct(const CtGrid& ct, const RigidTransform& room_from_ct, RoomScene& scene) {
  const Vector3d size(ct.size[0], ct.size[1], ct.size[2]);
  const auto corner = [&](int bits) {
    const Vector3d share((bits & 1) != 0, (bits & 2) != 0, (bits & 4) != 0);
    return Vector3d(room_from_ct * ct.point_mm(share.cwiseProduct(size) - Vector3d::Constant(0.5)));
  };
  for (int bits = 0; bits < 8; ++bits)
    for (int axis = 0; axis < 3; ++axis)
      if (const int other = bits | 1 << axis; other != bits)
        scene.lines.push_back({{corner(bits), corner(other)}, PictureColor::Green, 1.6});
  for (int axis = 0; axis < 3; ++axis)
    for (const double end : {-0.5, 0.5}) {
      const Vector3d outward = (end > 0.0 ? 1.0 : -1.0) * ct.direction.col(axis);
      const Vector3d index =
          (size - Vector3d::Ones()) / 2.0 + end * 1.12 * size[axis] * Vector3d::Unit(axis);
      scene.marks.push_back({room_from_ct * ct.point_mm(index),
                             PictureMark::Shape::None,
                             patient_letters(outward),
                             PictureColor::Green});
    }
}

PicturePanel panel_of(const RoomScene& scene, const Projection& projection) {
  constexpr int kSide = 420;
  constexpr double kBorder = 46.0;
  const auto flat = [&](const Vector3d& point) {
    return Vector2d(point.dot(projection.right), -point.dot(projection.up));
  };
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::infinity());
  Vector2d high = -low;
  for (const RoomLine& line : scene.lines)
    for (const Vector3d& point : line.points) {
      if (line.is_far) continue;
      low = low.cwiseMin(flat(point));
      high = high.cwiseMax(flat(point));
    }
  const double scale = (kSide - 2.0 * kBorder) / std::max((high - low).maxCoeff(), 1.0);
  const Vector2d middle = (low + high) / 2.0;
  const auto placed = [&](const Vector3d& point) {
    const Vector2d place = scale * (flat(point) - middle) + Vector2d::Constant(kSide / 2.0);
    return std::array<double, 2>{place.x(), place.y()};
  };
  Image2d paper(kSide, kSide);
  std::ranges::fill(paper.pixels, 1.0F);
  PicturePanel panel{paper, 0.0, 1.0, projection.title, projection.caption, {}, {}};
  panel.has_scale = false;
  for (const RoomLine& line : scene.lines) {
    PictureLine drawn{{}, line.color, line.width_px};
    for (const Vector3d& point : line.points) drawn.points.push_back(placed(point));
    panel.lines.push_back(drawn);
  }
  for (const RoomMark& mark : scene.marks)
    panel.marks.push_back({placed(mark.place), mark.shape, mark.text, mark.color});
  // A source off the paper is named at the edge, on the way to it from the middle.
  for (const RoomMark& source : scene.sources) {
    const auto [x, y] = placed(source.place);
    const Vector2d away = Vector2d(x, y) - Vector2d::Constant(kSide / 2.0);
    const double share =
        std::min(1.0, (kSide / 2.0 - 20.0) / std::max(away.cwiseAbs().maxCoeff(), 1e-6));
    const Vector2d place = Vector2d::Constant(kSide / 2.0) + share * away;
    panel.marks.push_back({{place.x(), std::clamp(place.y(), 20.0, kSide - 20.0)},
                           source.shape,
                           source.text,
                           source.color});
  }
  return panel;
}

}  // namespace

std::vector<PicturePanel> room_sketch(std::span<const CameraGeometry> cameras,
                                      const CtGrid& ct,
                                      const RigidTransform& room_from_ct) {
  RoomScene scene;
  for (const CameraGeometry& camera : cameras) add_camera(camera, scene);
  add_ct(ct, room_from_ct, scene);
  const Vector3d sight = Vector3d(-0.55, 0.75, -0.45).normalized();
  const Vector3d right = sight.cross(Vector3d::UnitZ()).normalized();
  const std::vector<Projection> projections = {
      {"Obliquely",
       "Seen from the room's +x, -y, +z. Green: the CT's box with the patient's directions. Black "
       "and red: detectors, red their first row and pixel (0,0). Black dots: where the sources "
       "are, "
       "or the way to them",
       right,
       right.cross(sight)},
      {"From above, against the room's z",
       "x to the right, y up",
       Vector3d::UnitX(),
       Vector3d::UnitY()},
      {"From the front, along the room's y",
       "x to the right, z up",
       Vector3d::UnitX(),
       Vector3d::UnitZ()},
  };
  std::vector<PicturePanel> panels;
  panels.reserve(projections.size());
  for (const Projection& projection : projections) panels.push_back(panel_of(scene, projection));
  return panels;
}

}  // namespace af
