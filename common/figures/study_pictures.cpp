// SPDX-License-Identifier: Apache-2.0
#include "figures/study_pictures.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <string_view>

#include "base/error.h"
#include "drr/field_coverage.h"
#include "drr/ray_cast_drr.h"
#include "figures/patient_directions.h"
#include "figures/picture.h"
#include "figures/picture_match.h"
#include "figures/room_sketch.h"
#include "files/csv_table.h"
#include "files/output_file.h"
#include "study/landmark_start.h"
#include "study/xray_reader.h"

namespace af {
namespace {

/// A pose to show, and what it is called.
struct ShownPose {
  std::string name;
  RigidTransform room_from_ct;
};

/// A view's pictures, shrunk by `factor`.
struct ShrunkView {
  View view;  ///< of coarse pixels, showing the whole detector
  int factor = 1;

  /// Place of a detector point in the shrunk picture.
  [[nodiscard]] std::array<double, 2> place(const Eigen::Vector2d& px) const {
    return {(px.x() + 0.5) / factor - 0.5, (px.y() + 0.5) / factor - 0.5};
  }
};

ShrunkView shrunk_view(const CameraGeometry& camera, int most_pixels) {
  const int longest = camera.size_px.maxCoeff();
  const int factor = std::max(1, (longest + most_pixels - 1) / most_pixels);
  const View whole = View::whole_detector(camera);
  return {factor == 1 ? whole : whole.coarser(factor), factor};
}

void add_region(const StudyView& view, const ShrunkView& shrunk, PicturePanel& panel) {
  const RegionOfInterest& roi = view.roi;
  const auto corner = [&](int column, int row) { return shrunk.place({column - 0.5, row - 0.5}); };
  panel.lines.push_back({{corner(roi.column, roi.row),
                          corner(roi.column + roi.width, roi.row),
                          corner(roi.column + roi.width, roi.row + roi.height),
                          corner(roi.column, roi.row + roi.height),
                          corner(roi.column, roi.row)},
                         PictureColor::Yellow,
                         1.8});
}

/// Circles where landmarks were seen, crosses where a pose puts them.
void add_landmarks(const StudyCase& study_case,
                   const StudyView& view,
                   const ShrunkView& shrunk,
                   const CameraGeometry& camera,
                   const RigidTransform* pose,
                   PicturePanel& panel) {
  for (std::size_t i = 0; i < view.landmarks_px.size(); ++i)
    if (const auto& seen = view.landmarks_px[i]; seen.has_value())
      panel.marks.push_back({shrunk.place(*seen),
                             PictureMark::Shape::Circle,
                             std::to_string(i + 1),
                             PictureColor::Cyan});
  if (pose == nullptr) return;
  for (const Eigen::Vector3d& point : study_case.landmarks_ct_mm)
    if (const Eigen::Vector3d room_point = *pose * point; camera.depth_mm(room_point) > 1.0)
      panel.marks.push_back({shrunk.place(camera.project(room_point)),
                             PictureMark::Shape::Cross,
                             "",
                             PictureColor::Red});
}

/// The sides of pixels that are 0 on one side only, joined to lines.
std::vector<PictureLine> outline_of(const std::vector<float>& held, int width, int height) {
  std::vector<PictureLine> lines;
  const auto at = [&](int column, int row) {
    return held[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                static_cast<std::size_t>(column)] != 0.0f;
  };
  // Along one axis these are lines of `length` pixels, across it they lie between neighbours.
  const auto add_lines = [&](int across, int length, const auto& differ, const auto& place) {
    for (int i = 0; i + 1 < across; ++i)
      for (int from = 0; from < length;) {
        int to = from;
        while (to < length && differ(i, to)) ++to;
        if (to > from)
          lines.push_back(
              {{place(i + 0.5, from - 0.5), place(i + 0.5, to - 0.5)}, PictureColor::Green, 1.8});
        from = std::max(to, from + 1);
      }
  };
  using Place = std::array<double, 2>;
  add_lines(
      width,
      height,
      [&](int column, int row) { return at(column, row) != at(column + 1, row); },
      [](double across, double along) {
        return Place{across, along};
      });
  add_lines(
      height,
      width,
      [&](int row, int column) { return at(column, row) != at(column, row + 1); },
      [](double across, double along) {
        return Place{along, across};
      });
  return lines;
}

/// Draws where the field of a view ends at a pose. Returns what the caption says of it.
std::string add_coverage(const std::optional<HeldRays>& field,
                         const ShrunkView& shrunk,
                         const RigidTransform& room_from_ct,
                         PicturePanel& panel) {
  if (!field) return "";
  const std::vector<float> held = field->coverage.held_rays(room_from_ct, shrunk.view);
  const auto count = std::ranges::count(held, 1.0f);
  if (count == 0) return "; the field holds no ray at this pose";
  if (static_cast<std::size_t>(count) == held.size())
    return "; the field holds all rays at this pose";
  const auto lines = outline_of(held, panel.image.width, panel.image.height);
  panel.lines.insert(panel.lines.end(), lines.begin(), lines.end());
  return "; green: limit of the rays that the field holds at this pose";
}

/// The field of a view, if it exists already. Reports which rays it holds.
std::optional<HeldRays> field_of(const StudyCase& study_case,
                                 const StudyView& view,
                                 const CameraGeometry& camera,
                                 StudyPictures& pictures) {
  std::error_code ignored;
  if (!view.field || !std::filesystem::exists(*view.field, ignored)) return std::nullopt;
  HeldRays field = read_held_rays(*view.field);
  const View needed = View{camera, view.roi}.scaled(kWidestRegionScale);
  const ViewReach reach = field.coverage.reach(needed, study_case.frame(), field.identity.range);
  pictures.facts.push_back("camera " + camera.name + ": of twice the region, " +
                           reach.text(camera.name));
  if (reach.held < reach.rays)
    pictures.telltales.push_back(
        "camera " + camera.name + ": the field misses " + std::to_string(reach.rays - reach.held) +
        " of " + std::to_string(reach.rays) +
        " rays of twice the region at the nominal pose, which registrations need");
  return field;
}

/// The window is that of the region, because the borders of an X-ray may hold anything.
PicturePanel panel_with(const Image2d& image,
                        const StudyView& view,
                        const ShrunkView& shrunk,
                        const std::string& title,
                        const std::string& caption) {
  const RegionOfInterest region = {
      std::min(view.roi.column / shrunk.factor, image.width - 1),
      std::min(view.roi.row / shrunk.factor, image.height - 1),
      std::max(1, std::min(view.roi.width / shrunk.factor, image.width)),
      std::max(1, std::min(view.roi.height / shrunk.factor, image.height))};
  const RegionOfInterest within = {region.column,
                                   region.row,
                                   std::min(region.width, image.width - region.column),
                                   std::min(region.height, image.height - region.row)};
  const auto window = percentile_window(crop(image, within), 0.5, 99.5);
  return {image, window[0], window[1], title, caption, {}, {}};
}

/// The shrunk X-ray. Where the mask hides half of a block or more it has no value, which pictures
/// show in orange.
Image2d with_mask(Image2d xray, Image2d mask, int factor) {
  if (mask.pixels.empty()) return xray;
  for (float& value : mask.pixels) value = value != 0.0f ? 1.0f : 0.0f;
  const Image2d used = block_means(mask, factor);
  for (std::size_t i = 0; i < xray.pixels.size(); ++i)
    if (used.pixels[i] <= 0.5f) xray.pixels[i] = std::numeric_limits<float>::quiet_NaN();
  return xray;
}

/// The pictures of one view; their names begin with `stem`.
void draw_view(const Study& study,
               const StudyCase& study_case,
               const StudyView& view,
               const ViewRenderer& renderer_of,
               const std::vector<ShownPose>& poses,
               int most_pixels,
               const std::string& stem,
               StudyPictures& pictures) {
  const CameraGeometry& camera = study.rig.camera(view.camera);
  const ShrunkView shrunk = shrunk_view(camera, most_pixels);
  const ViewXray read = read_view_xray(view, camera);
  const Image2d xray = block_means(read.attenuation, shrunk.factor);
  const std::optional<HeldRays> field = field_of(study_case, view, camera, pictures);
  const EdgeLetters letters = edge_letters(camera, poses.front().room_from_ct);
  const RegionOfInterest whole = {0, 0, xray.width, xray.height};
  const std::string beam = "beam from " + letters.beam_from + " to " + letters.beam_to;
  std::vector<PicturePanel> panels;
  panels.push_back(
      panel_with(with_mask(xray, read.mask, shrunk.factor),
                 view,
                 shrunk,
                 "X-ray",
                 "as the file has it, attenuation; letters of the " + poses.front().name + ", " +
                     beam + (read.mask.pixels.empty() ? "" : "; orange: masked") +
                     (view.landmarks_px.empty() ? "" : "; circles: landmarks as marked")));
  add_letters(letters, whole, panels.back());
  add_region(view, shrunk, panels.back());
  panels.back().caption += add_coverage(field, shrunk, poses.front().room_from_ct, panels.back());
  add_landmarks(study_case, view, shrunk, camera, nullptr, panels.back());
  Image2d last_drr;
  for (const ShownPose& pose : poses) {
    const std::shared_ptr<const DrrRenderer> renderer = renderer_of(shrunk.view, pose.room_from_ct);
    last_drr = render_image(*renderer, pose.room_from_ct, shrunk.view);
    if (std::ranges::max(last_drr.pixels) <= 0.0f) {
      const std::string what = "the DRR at the " + pose.name + " is empty: no ray meets the CT";
      pictures.telltales.push_back("camera " + camera.name + ": " + what);
      pictures.problems.push_back("case '" + study_case.name + "', camera '" + camera.name +
                                  "': " + what);
    }
    const EdgeLetters at_pose = edge_letters(camera, pose.room_from_ct);
    panels.push_back(
        panel_with(last_drr,
                   view,
                   shrunk,
                   "DRR, " + pose.name,
                   (renderer->name() == std::string_view("field") ? "looked up in the field"
                                                                  : "cast through the CT") +
                       std::string("; beam from ") + at_pose.beam_from + " to " + at_pose.beam_to +
                       (study_case.landmarks_ct_mm.empty()
                            ? ""
                            : "; crosses: landmarks where this pose puts them")));
    add_letters(at_pose, whole, panels.back());
    add_region(view, shrunk, panels.back());
    panels.back().caption += add_coverage(field, shrunk, pose.room_from_ct, panels.back());
    add_landmarks(study_case, view, shrunk, camera, &pose.room_from_ct, panels.back());
  }
  pictures.facts.push_back("camera " + camera.name + ": left edge " + letters.left + ", right " +
                           letters.right + ", top " + letters.top + ", bottom " + letters.bottom +
                           "; " + beam);
  if (camera.is_mirrored())
    pictures.telltales.push_back("camera " + camera.name +
                                 ": column x row points against the beam: its pictures are "
                                 "mirrored, as if seen from behind the detector");
  for (const std::string& telltale : {laying_telltale(laying_matches(xray, last_drr)),
                                      scale_telltale(scale_matches(xray, last_drr))})
    if (!telltale.empty()) pictures.telltales.push_back("camera " + camera.name + ": " + telltale);
  std::string heading = study_case.name + ", camera " + camera.name;
  for (const std::string& telltale : pictures.telltales)
    if (telltale.starts_with("camera " + camera.name + ":")) heading += "\n" + telltale;
  const std::filesystem::path path = stem + "-" + file_name_part(camera.name) + ".png";
  write_picture(panels, static_cast<int>(panels.size()), heading, path);
  pictures.files.push_back(path);
}

/// Whether a pose moves the target from its nominal place by too little to be seen.
bool looks_nominal(const RigidTransform& room_from_ct, const StudyCase& study_case) {
  constexpr double kUnseenMm = 0.01;
  return std::ranges::all_of(
      study_case.target_box_ct.corner_points(), [&](const Eigen::Vector3d& corner) {
        return (room_from_ct * corner - study_case.nominal_room_from_ct * corner).norm() <
               kUnseenMm;
      });
}

}  // namespace

ViewRenderer cast_views(const CtVolume& ct) {
  return [caster = std::make_shared<const RayCastDrr>(std::make_shared<const AttenuationVolume>(
              ct, AttenuationModel()))](const View&, const RigidTransform&) { return caster; };
}

StudyPictures draw_study_pictures(const Study& study,
                                  const StudyCase& study_case,
                                  const CtGrid& ct,
                                  const ViewRenderer& renderer_of,
                                  int most_pixels,
                                  const std::filesystem::path& folder,
                                  const std::string& stem) {
  StudyPictures pictures;
  std::vector<ShownPose> poses = {{"nominal pose", study_case.nominal_room_from_ct}};
  if (has_landmarks(study_case)) {
    const LandmarkPose pose = landmark_pose(study, study_case);
    if (looks_nominal(pose.room_from_ct, study_case)) poses.clear();
    poses.push_back({"pose of the landmarks", pose.room_from_ct});
    pictures.facts.push_back(residuals_text(pose, study_case));
  }
  std::vector<CameraGeometry> cameras;
  for (const StudyView& view : study_case.views) {
    draw_view(study,
              study_case,
              view,
              renderer_of,
              poses,
              most_pixels,
              (folder / stem).string(),
              pictures);
    cameras.push_back(study.rig.camera(view.camera));
  }
  const std::filesystem::path path = folder / (stem + "-room.png");
  write_picture(room_sketch(cameras, ct, poses.back().room_from_ct),
                3,
                study_case.name + ": the room at the " + poses.back().name,
                path);
  pictures.files.push_back(path);
  return pictures;
}

}  // namespace af
