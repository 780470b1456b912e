// SPDX-License-Identifier: Apache-2.0
#include "register/ray_cast_renderers.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "drr/field_level.h"
#include "drr/ray_cast_drr.h"
#include "study/bone_per_node.h"
#include "volume/blurred_volume.h"

namespace af::registration {
namespace {

/// Spacing of nodes of the field whose levels ray casting imitates when there is none: about that
/// of the paper's field of a head or a spine.
constexpr double kAssumedNodeMm = 1.0;

/// Collective. The same CT, its attenuation blurred by sigma_mm, held once per node.
std::shared_ptr<const AttenuationVolume> blurred_per_node(const AttenuationVolume& volume,
                                                          double sigma_mm,
                                                          const Communicator& communicator) {
  const VolumeBlur blur(volume.grid(), sigma_mm);
  const std::size_t count = blur.grid().voxel_count();
  const auto owner = communicator.allocate_on_node(
      count * sizeof(std::uint16_t), [&](std::span<std::byte> memory) {
        blur.fill(volume, {reinterpret_cast<std::uint16_t*>(memory.data()), count});
      });
  const auto* const voxels = reinterpret_cast<const std::uint16_t*>(owner.get());
  return std::make_shared<const AttenuationVolume>(
      blur.grid(), volume.model(), SharedArray<std::uint16_t>(owner, {voxels, count}));
}

}  // namespace

CastVolumes cast_volumes(std::shared_ptr<const AttenuationVolume> all,
                         const CaseLoadOptions& options,
                         const Communicator& communicator) {
  auto bone = options.beam.needs_bone() ? bone_per_node(*all, communicator) : nullptr;
  const auto beam = all_or_none(
      communicator, [&] { return std::make_shared<const XrayBeam>(options.beam, all->model()); });
  return {std::move(all), std::move(bone), beam};
}

std::shared_ptr<const DrrRenderer> ray_cast_through(const CastVolumes& volumes,
                                                    const RayCasterOptions& caster,
                                                    const CaseLoadOptions& options) {
  const auto cast = [&](const std::shared_ptr<const AttenuationVolume>& volume) {
    return volume ? std::make_shared<const RayCastDrr>(volume, caster, options.pool) : nullptr;
  };
  return volumes.beam->renderer(cast(volumes.all), cast(volumes.bone));
}

std::shared_ptr<const DrrRenderer> coarse_ray_cast(const CastVolumes& volumes,
                                                   double sigma_mm,
                                                   const CaseLoadOptions& options,
                                                   const Communicator& communicator) {
  RayCasterOptions caster = options.ray_caster;
  caster.step_mm = std::max(caster.step_mm, 0.5 * sigma_mm);
  CastVolumes blurred = volumes;
  blurred.all = blurred_per_node(*volumes.all, sigma_mm, communicator);
  if (volumes.bone) blurred.bone = blurred_per_node(*volumes.bone, sigma_mm, communicator);
  return ray_cast_through(blurred, caster, options);
}

std::vector<RendererLevel> coarse_ray_casts(const CastVolumes& volumes,
                                            const CaseLoadOptions& options,
                                            const Communicator& communicator) {
  std::vector<RendererLevel> levels;
  const int coarsest_level = std::max(options.coarsest_level, options.judging_level);
  for (int level = 1; level <= coarsest_level; ++level) {
    const auto at = static_cast<std::size_t>(level - 1);
    const double sigma_mm = at < options.level_blur_sigma_mm.size()
                                ? options.level_blur_sigma_mm[at]
                                : kAssumedNodeMm * level_blur_sigma_in_nodes(level, true);
    levels.push_back({coarse_ray_cast(volumes, sigma_mm, options, communicator), sigma_mm});
  }
  return levels;
}

}  // namespace af::registration
