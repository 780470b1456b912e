// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "base/progress.h"
#include "drr/drr_renderer.h"
#include "drr/xray_spectrum.h"
#include "evaluate/simulate/detector_model.h"
#include "evaluate/simulate/occluders.h"
#include "evaluate/simulate/phantom_parts.h"
#include "evaluate/simulate/siddon_projector.h"
#include "evaluate/simulate/smooth_motion.h"

namespace af {

/// The imaging chain from tube to grey values.
struct XraySimulationOptions {
  SpectrumOptions spectrum;
  DetectorOptions detector;
  int threads = 0;  ///< 0: as many as the hardware has; results do not depend on it

  /// One energy, no scatter, noise, blur or quantisation: Beer and Lambert's law.
  static XraySimulationOptions ideal();

  void describe(Fields& field);
};

std::vector<std::string> problems(const XraySimulationOptions& options);

/// Makes X-rays of a CT, or of a phantom, with steel bodies. Steel adds to the tissue along a ray.
/// The tissue that it would displace (at most 0.04 of the steel's own attenuation) is not
/// subtracted.
class XraySimulator {
 public:
  /// `volume` must outlive the simulator.
  XraySimulator(const AttenuationVolume& volume,
                SteelBodies steel,
                const XraySimulationOptions& options);

  /// X-rays of a phantom's bodies themselves, at rest or moved, without voxels. Tissue follows
  /// `model`.
  XraySimulator(const Phantom& phantom,
                std::optional<SmoothMotion> motion,
                const AttenuationModel& model,
                SteelBodies steel,
                const XraySimulationOptions& options);

  /// Share of the open beam that reaches every pixel of the camera unscattered.
  [[nodiscard]] Image2d primary_image(const CameraGeometry& camera,
                                      const RigidTransform& room_from_ct,
                                      const ProgressCallback& progress = {}) const;

  /// The X-ray as grey values, bright where nothing attenuates. The scatter-to-primary ratio holds
  /// within `view.roi`. Noise is keyed by (seed, key, pixel).
  [[nodiscard]] Image2d xray(const View& view,
                             const RigidTransform& room_from_ct,
                             std::uint64_t seed,
                             std::uint64_t key,
                             const ProgressCallback& progress = {}) const;

  [[nodiscard]] const TissueModel& tissue() const { return tissue_; }
  [[nodiscard]] const BeamTransmission& beam() const { return beam_; }

 private:
  TissueModel tissue_;
  std::unique_ptr<const RayIntegrator> projector_;
  BeamTransmission beam_;
  SteelBodies steel_;
  XraySimulationOptions options_;
};

}  // namespace af
