// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/xray_simulator.h"

#include <utility>
#include <vector>

#include "evaluate/simulate/parallel_rows.h"
#include "evaluate/simulate/solid_projector.h"

namespace af {

XraySimulationOptions XraySimulationOptions::ideal() {
  XraySimulationOptions options;
  options.spectrum = SpectrumOptions::one_energy();
  options.detector.scatter_to_primary_ratio = 0.0;
  options.detector.photons_per_pixel = 0.0;
  options.detector.blur_sigma_px = 0.0;
  options.detector.bits = 0;
  return options;
}

void XraySimulationOptions::describe(Fields& field) {
  field.start_group("Imaging (0 switches an effect off)");
  field.part(spectrum);
  field.part(detector);
  field.start_group("");
  field("threads", threads, "Threads (0: all of the machine); results do not depend on them")
      .within(0, 1024);
}

std::vector<std::string> problems(const XraySimulationOptions& options) {
  return field_problems(options);
}

XraySimulator::XraySimulator(const AttenuationVolume& volume,
                             SteelBodies steel,
                             const XraySimulationOptions& options)
    : tissue_(volume.model()),
      projector_(std::make_unique<SiddonProjector>(volume, tissue_)),
      beam_(options.spectrum, tissue_),
      steel_(std::move(steel)),
      options_(options) {}

XraySimulator::XraySimulator(const Phantom& phantom,
                             std::optional<SmoothMotion> motion,
                             const AttenuationModel& model,
                             SteelBodies steel,
                             const XraySimulationOptions& options)
    : tissue_(model),
      projector_(std::make_unique<SolidProjector>(phantom, tissue_, std::move(motion))),
      beam_(options.spectrum, tissue_),
      steel_(std::move(steel)),
      options_(options) {}

Image2d XraySimulator::primary_image(const CameraGeometry& camera,
                                     const RigidTransform& room_from_ct,
                                     const ProgressCallback& progress) const {
  const RigidTransform ct_from_room = room_from_ct.inverse();
  const Eigen::Vector3d source_ct_mm = ct_from_room * camera.source_point;
  Image2d primary(camera.size_px.x(), camera.size_px.y());
  for_each_row(
      primary.height,
      options_.threads,
      [&](int row) {
        std::vector<Eigen::Vector3d> pixels_ct_mm;
        for (int column = 0; column < primary.width; ++column)
          pixels_ct_mm.push_back(ct_from_room * camera.detector_point(column, row));
        std::vector<PathIntegrals> paths(pixels_ct_mm.size());
        projector_->integrate_row(source_ct_mm, pixels_ct_mm, paths);
        for (int column = 0; column < primary.width; ++column) {
          const auto i = static_cast<std::size_t>(column);
          primary.at(column, row) = static_cast<float>(
              beam_.transmission({paths[i].water_mm,
                                  paths[i].bone_mm,
                                  steel_.chord_length_mm(source_ct_mm, pixels_ct_mm[i])}));
        }
      },
      progress);
  return primary;
}

Image2d XraySimulator::xray(const View& view,
                            const RigidTransform& room_from_ct,
                            std::uint64_t seed,
                            std::uint64_t key,
                            const ProgressCallback& progress) const {
  const Image2d primary = primary_image(view.camera, room_from_ct, progress);
  return detect(primary,
                view.roi,
                view.camera.pixel_spacing_mm.x(),
                options_.detector,
                seed,
                key,
                options_.threads);
}

}  // namespace af
