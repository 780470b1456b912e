// SPDX-License-Identifier: Apache-2.0
#include "precompute/measured_views.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>

#include "base/error.h"
#include "drr/ray_cast_drr.h"
#include "files/sha256.h"
#include "study/shared_inputs.h"
#include "study/xray_reader.h"
#include "xray/gaussian_blur.h"

namespace af {

namespace {

/// Largest plausible residual as a share of the measurement.
constexpr double kMostLeft = 0.7;

/// The camera as the CT sees it.
CameraGeometry in_ct_frame(CameraGeometry camera, const RigidTransform& ct_from_room) {
  camera.source_point = ct_from_room * camera.source_point;
  camera.detector_origin_point = ct_from_room * camera.detector_origin_point;
  camera.column_direction = ct_from_room.linear() * camera.column_direction;
  camera.row_direction = ct_from_room.linear() * camera.row_direction;
  return camera;
}

const StudyCase& case_with_gold_pose(const Study& study, const PrecomputeOptions& options) {
  const StudyCase& study_case = study.find_case(options.projections_case);
  if (!study_case.gold_room_from_ct)
    throw InputError("gold_room_from_ct",
                     "none",
                     "case '" + study_case.name +
                         "' must state it: measured projections correct a field only where the "
                         "pose of the CT is known",
                     options.projections);
  return study_case;
}

std::vector<CameraGeometry> cameras_of(const Study& study,
                                       const std::vector<StudyView>& views,
                                       const RigidTransform& ct_from_room) {
  std::vector<CameraGeometry> cameras;
  cameras.reserve(views.size());
  for (const StudyView& view : views)
    cameras.push_back(in_ct_frame(study.rig.camera(view.camera), ct_from_room));
  return cameras;
}

/// Where each view's pixels begin, and how many there are in all.
std::vector<std::size_t> pixel_places(const std::vector<CameraGeometry>& cameras) {
  std::vector<std::size_t> places = {0};
  for (const CameraGeometry& camera : cameras)
    places.push_back(places.back() + static_cast<std::size_t>(camera.size_px.x()) *
                                         static_cast<std::size_t>(camera.size_px.y()));
  return places;
}

/// Line integrals of one view. NaN where a mask hides them.
void read_measured(const StudyView& view,
                   const CameraGeometry& camera,
                   std::span<float> values,
                   std::vector<std::string>& warnings) {
  const ViewXray xray = read_view_xray(view, camera);
  warnings.insert(warnings.end(), xray.warnings.begin(), xray.warnings.end());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool is_hidden = !xray.mask.pixels.empty() && xray.mask.pixels[i] == 0.0F;
    if (!is_hidden && !std::isfinite(xray.attenuation.pixels[i]))
      throw InputError(
          "pixel " + std::to_string(i), "NaN or infinite", "must be finite", view.xray.string());
    values[i] = is_hidden ? std::nanf("") : xray.attenuation.pixels[i];
  }
}

std::string content_hash(const std::vector<CameraGeometry>& cameras,
                         std::span<const float> measured,
                         const PrecomputeOptions& options) {
  std::ostringstream text;
  text.precision(17);
  text << sha256_hex(std::as_bytes(measured)) << ' ' << options.projections_smoothing_px << ' '
       << options.projections_common;
  for (const CameraGeometry& camera : cameras)
    text << '\n'
         << camera.source_point.transpose() << ' ' << camera.detector_origin_point.transpose()
         << ' ' << camera.column_direction.transpose() << ' ' << camera.row_direction.transpose()
         << ' ' << camera.pixel_spacing_mm.transpose() << ' ' << camera.size_px.transpose();
  const std::string all = text.str();
  return sha256_hex(std::as_bytes(std::span(all)));
}

/// Turns one view's line integrals into what they hold beyond the CT's.
void subtract_cast(const RayCaster& caster,
                   const CameraGeometry& camera,
                   std::span<const float> measured,
                   std::span<float> residual) {
  const RegionOfInterest all = {0, 0, camera.size_px.x(), camera.size_px.y()};
  Image2d image(all.width, all.height);
  caster.cast(ray_fan(RigidTransform::Identity(), {camera, all}), image.pixels);
  for (std::size_t i = 0; i < residual.size(); ++i)
    residual[i] = std::isnan(measured[i]) ? 0.0F : measured[i] - image.pixels[i];
}

void smooth(const CameraGeometry& camera,
            double smoothing_px,
            std::span<const float> residual,
            std::span<float> smoothed) {
  Image2d image(camera.size_px.x(), camera.size_px.y());
  std::copy(residual.begin(), residual.end(), image.pixels.begin());
  image = gaussian_blur(image, smoothing_px);
  std::copy(image.pixels.begin(), image.pixels.end(), smoothed.begin());
}

/// The mean over the views of what each pixel holds beyond the CT. 0 where no view was measured.
/// Throws InputError when the views differ in size.
std::vector<float> common_part(const std::vector<CameraGeometry>& cameras,
                               std::span<const float> measured,
                               std::span<const float> residual,
                               const std::string& path) {
  for (const CameraGeometry& camera : cameras)
    if (camera.size_px != cameras.front().size_px)
      throw InputError("projections_common",
                       "remove",
                       "needs views of one size; that of camera '" + camera.name + "' is another",
                       path);
  const std::size_t pixels = residual.size() / cameras.size();
  std::vector<float> common(pixels);
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    double sum = 0.0;
    int count = 0;
    for (std::size_t i = pixel; i < residual.size(); i += pixels) {
      if (std::isnan(measured[i])) continue;
      sum += static_cast<double>(residual[i]);
      ++count;
    }
    common[pixel] = count > 0 ? static_cast<float>(sum / count) : 0.0F;
  }
  return common;
}

/// Collective. The residuals without common_part(), once per node.
std::shared_ptr<const std::byte> without_common_part(const std::vector<CameraGeometry>& cameras,
                                                     std::span<const float> measured,
                                                     std::span<const float> residual,
                                                     const std::string& path,
                                                     const Communicator& communicator) {
  return communicator.allocate_on_node(residual.size_bytes(), [&](std::span<std::byte> memory) {
    const std::vector<float> common = common_part(cameras, measured, residual, path);
    auto* const values = reinterpret_cast<float*>(memory.data());
    for (std::size_t i = 0; i < residual.size(); ++i)
      values[i] = std::isnan(measured[i]) ? 0.0F : residual[i] - common[i % common.size()];
  });
}

/// Root mean squares of measured and residual, not smoothed yet, where the CT attenuates. Elsewhere
/// they are the same, and nothing is corrected.
void note_rms(std::span<const float> measured,
              std::span<const float> residual,
              MeasuredViews& found) {
  double measured_sum = 0.0;
  double residual_sum = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    const auto value = static_cast<double>(measured[i]);
    const auto left = static_cast<double>(residual[i]);
    if (std::isnan(value) || left == value) continue;
    measured_sum += value * value;
    residual_sum += left * left;
    ++count;
  }
  if (count == 0) return;
  found.measured_rms = std::sqrt(measured_sum / static_cast<double>(count));
  found.residual_rms = std::sqrt(residual_sum / static_cast<double>(count));
}

void require_same_object(const MeasuredViews& found) {
  if (found.residual_rms <= kMostLeft * found.measured_rms) return;
  throw InputError(
      "projections",
      "the CT leaves " + std::to_string(found.residual_rms) + " of their " +
          std::to_string(found.measured_rms) + " (root mean square of line integrals)",
      "must be X-rays of this CT, by their own cameras: is the CT reconstructed from them, is "
      "--water-mu-per-mm that of its HU, is the pose right?",
      found.path);
}

/// The views that look at the CT from the camera's side. For an atlas, whose cameras go round, all
/// views.
std::vector<StudyView> views_from_side(const Study& study,
                                       const StudyCase& study_case,
                                       const PrecomputeOptions& options,
                                       const Eigen::Vector3d& beam_ct) {
  std::vector<StudyView> chosen;
  for (const StudyView& view : study_case.views) {
    const Eigen::Vector3d beam = study_case.gold_room_from_ct->linear().transpose() *
                                 study.rig.camera(view.camera).beam_direction();
    if (options.is_atlas() || beam.dot(beam_ct) > 0.0) chosen.push_back(view);
  }
  return chosen;
}

/// Collective. The line integrals of the views, one after the other, once per node.
std::shared_ptr<const std::byte> read_on_root(const std::vector<StudyView>& views,
                                              const std::vector<CameraGeometry>& cameras,
                                              const std::vector<std::size_t>& places,
                                              const Communicator& communicator,
                                              std::vector<std::string>& warnings) {
  return communicator.allocate_on_nodes_from_root(
      places.back() * sizeof(float), [&](std::span<std::byte> memory) {
        auto* const values = reinterpret_cast<float*>(memory.data());
        for (std::size_t i = 0; i < views.size(); ++i)
          read_measured(
              views[i], cameras[i], {values + places[i], places[i + 1] - places[i]}, warnings);
      });
}

}  // namespace

std::string MeasuredViews::text() const {
  std::ostringstream text;
  text.precision(3);
  text << "measured projections: " << views.size() << " views of " << path << "; the CT leaves "
       << residual_rms << " of their " << measured_rms << " (root mean square of line integrals), "
       << 100.0 * residual_rms / measured_rms << " %";
  return text.str();
}

std::shared_ptr<const MeasuredViews> load_measured_views(const PrecomputeOptions& options,
                                                         const AttenuationVolume& volume,
                                                         const Eigen::Vector3d& beam_ct,
                                                         const Communicator& communicator,
                                                         std::vector<std::string>& warnings) {
  const Study study = shared_study(options.projections, communicator);
  auto found = std::make_shared<MeasuredViews>();
  found->path = options.projections;
  std::vector<StudyView> views;
  std::vector<CameraGeometry> cameras;
  all_or_none(communicator, [&] {
    const StudyCase& study_case = case_with_gold_pose(study, options);
    views = views_from_side(study, study_case, options, beam_ct);
    cameras = cameras_of(study, views, study_case.gold_room_from_ct->inverse());
    for (const CameraGeometry& camera : cameras) found->views.push_back({camera, {}});
    throw_if_any(orbit_problems(found->views), options.projections);
  });
  const std::vector<std::size_t> places = pixel_places(cameras);
  const auto measured_memory = read_on_root(views, cameras, places, communicator, warnings);
  const std::span measured(reinterpret_cast<const float*>(measured_memory.get()), places.back());
  const auto of_view = [&](auto values, std::size_t view) {
    return values.subspan(places[view], places[view + 1] - places[view]);
  };
  found->bytes = places.back() * sizeof(float);
  const RayCaster caster(volume, options.ray_caster);
  const auto per_view = [&](const auto& fill_view) {
    return communicator.allocate_on_node_together(
        found->bytes, [&](std::span<std::byte> memory, int part, int parts) {
          const std::span values(reinterpret_cast<float*>(memory.data()), places.back());
          for (auto i = static_cast<std::size_t>(part); i < cameras.size();
               i += static_cast<std::size_t>(parts))
            fill_view(i, of_view(values, i));
        });
  };
  found->memory = per_view([&](std::size_t i, std::span<float> residual) {
    subtract_cast(caster, cameras[i], of_view(measured, i), residual);
  });
  const auto held = [&] {
    return std::span(reinterpret_cast<const float*>(found->memory.get()), places.back());
  };
  note_rms(measured, held(), *found);
  all_or_none(communicator, [&] { require_same_object(*found); });
  if (options.projections_smoothing_px > 0.0)
    found->memory = per_view([&](std::size_t i, std::span<float> smoothed) {
      smooth(cameras[i], options.projections_smoothing_px, of_view(held(), i), smoothed);
    });
  if (options.projections_common == "remove")
    found->memory =
        without_common_part(cameras, measured, held(), options.projections, communicator);
  for (std::size_t i = 0; i < cameras.size(); ++i) found->views[i].residual = of_view(held(), i);
  found->content_sha256 = content_hash(cameras, measured, options);
  return found;
}

}  // namespace af
