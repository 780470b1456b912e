// SPDX-License-Identifier: Apache-2.0
#include "register/case_renderers.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "ct/blurred_volume.h"
#include "drr/field_level.h"
#include "drr/field_renderer.h"
#include "drr/field_set_drr.h"
#include "drr/ray_cast_drr.h"
#include "drr/two_pass_af_drr.h"
#include "geometry/motion_range.h"
#include "ranks/root_only.h"
#include "study/node_ct.h"

namespace af::registration {
namespace {

/// Node spacing of the field whose levels ray casting imitates when there is none: about that of
/// the paper's field of a head or a spine.
constexpr double kAssumedNodeMm = 1.0;

/// Collective. The attenuation of a CT that is blurred by already_mm, blurred by sigma_mm. It is
/// held once per node.
std::shared_ptr<const AttenuationVolume> blurred_per_node(const AttenuationVolume& volume,
                                                          double sigma_mm,
                                                          double already_mm,
                                                          const Communicator& communicator) {
  const VolumeBlur blur(volume.grid(), sigma_mm, already_mm);
  return volume_per_node(
      blur.grid(),
      volume.model(),
      VoxelSource::Node,
      [&](std::span<std::uint16_t> voxels) { blur.fill(volume, voxels); },
      communicator);
}

/// Collective where it provides memory, because the ranks of a node share it.
FieldLevelMemory node_memory(const Communicator& communicator) {
  return [communicator](std::size_t bytes) {
    return SampleMemory{communicator.allocate_on_node(bytes), communicator.node().size() > 1};
  };
}

/// How many levels of a field to make: those of the stages and, for judging, as many as its nodes
/// allow.
int level_count(const LightSlab& light_slab, const CaseLoadOptions& options) {
  int nodes = std::numeric_limits<int>::max();
  for (const SlabLattice& slab : light_slab.lattice().slabs)
    nodes = std::min({nodes, slab.s.nodes, slab.t.nodes});
  nodes >>= halvings_to_usual_nodes(light_slab);
  int possible = 0;
  for (; possible < options.judging_level && nodes > 2; ++possible) nodes = (nodes + 1) / 2;
  return std::max(options.coarsest_level, possible);
}

/// The samples of several slabs are decoded when they take no more than this. They have few
/// viewpoints, so they are small, and many nodes, which are blended faster from samples than from
/// codewords. Fields with a tile filter are always decoded, because look-up by codewords knows no
/// filter.
constexpr std::size_t kMostDecodedBytes = std::size_t{512} << 20;

bool pays_to_decode(const CompressedAttenuationField& field) {
  return field.codebook.filter.has_value() ||
         (field.slabs.size() > 1 && decoded_bytes(field) <= kMostDecodedBytes);
}

/// Collective where the memory is. Adds what a field's samples lack: level 0, where decoding it
/// pays, and levels 1 ... halvings of its pyramid (stepping_stones: make_field_pyramid()).
void complete(const std::shared_ptr<const CompressedAttenuationField>& field,
              int halvings,
              int stepping_stones,
              const FieldLevelMemory& memory,
              FieldSamples& samples) {
  if (!samples.level_0 && pays_to_decode(*field))
    samples.level_0 = std::make_shared<const FieldLevel>(decode_field(field, memory));
  FieldLevels& pyramid = samples.pyramid;
  if (pyramid.empty() && halvings > 0)
    pyramid = samples.level_0
                  ? make_field_pyramid(samples.level_0, halvings, memory, stepping_stones)
                  : make_field_pyramid(field, halvings, memory, stepping_stones);
  while (static_cast<int>(pyramid.size()) < halvings)
    pyramid.push_back(std::make_shared<const FieldLevel>(next_field_level(pyramid.back(), memory)));
}

/// Collective where the memory is. A field's renderers for a view: its own, and those of so many
/// levels of its pyramid. A method's levels are those of a field of about 256 nodes. A finer field
/// begins with more halvings, so that a level has about the same blur. The field itself is looked
/// up as searches do (look_up_of_searches()). Levels above are looked up linearly, because blur
/// hides what cubic look-up gains there.
FieldRenderers renderers_of(const std::shared_ptr<const CompressedAttenuationField>& field,
                            const std::string& look_up,
                            int levels,
                            const std::shared_ptr<ThreadPool>& pool,
                            const std::shared_ptr<ThreadPool>& coarse_pool,
                            const FieldLevelMemory& memory,
                            FieldSamples& samples) {
  const int more_halvings = halvings_to_usual_nodes(field->light_slab);
  const int halvings = levels > 0 ? levels + more_halvings : 0;
  FieldRenderers made;
  made.look_up = look_up_of_searches(look_up, field->slabs.size());
  complete(field, halvings, more_halvings, memory, samples);
  made.levels.push_back(samples.level_0 ? make_field_renderer(samples.level_0, made.look_up, pool)
                                        : make_field_renderer(field, made.look_up, pool));
  for (int i = more_halvings; i < halvings; ++i) {
    const auto& level = samples.pyramid[static_cast<std::size_t>(i)];
    made.levels.push_back(
        std::make_shared<const TwoPassAfDrr>(level, TwoPassOptions{}, coarse_pool));
    made.blur_sigma_mm.push_back(level->blur_sigma_mm(true));
  }
  return made;
}

/// Members of an atlas that serve poses in the inner half of its range about the nominal pose, the
/// nominal pose's member first. Most registrations need no others.
std::vector<std::uint64_t> members_in_reach(const OpenedField& opened,
                                            const PoseFrame& nominal,
                                            const View& view) {
  std::vector<FieldSetMember> planes;
  for (const auto& of_member : opened.coverage().planes) planes.push_back({of_member, nullptr});
  const FieldSetDrr set(std::move(planes));
  constexpr double kMiddle = 0.5;
  const MotionRange range = opened.identity().range.scaled(kMiddle);
  std::vector<std::uint64_t> members;
  const auto add_at = [&](const PoseParameters& parameters) {
    const std::vector<double> weights =
        set.weights(pose_from_parameters(nominal, parameters), view);
    std::vector<std::uint64_t> order(weights.size());
    std::iota(order.begin(), order.end(), std::uint64_t{0});
    std::stable_sort(
        order.begin(), order.end(), [&](auto a, auto b) { return weights[a] > weights[b]; });
    for (const std::uint64_t i : order)
      if (weights[i] > 0.0 && std::find(members.begin(), members.end(), i) == members.end())
        members.push_back(i);
  };
  add_at({});
  for (unsigned corner = 0; corner < 64; ++corner) add_at(corner_pose(range, corner));
  return members;
}

/// Collective.
XrayBeam beam_of(const FieldIdentity& identity,
                 const CaseLoadOptions& options,
                 const Communicator& communicator) {
  return all_or_none(communicator, [&] {
    return XrayBeam(options.beam, {identity.mu_water_per_mm, identity.air_below_hu});
  });
}

/// How many levels every field of a file has.
int level_count(const OpenedField& opened, const CaseLoadOptions& options) {
  int levels = std::numeric_limits<int>::max();
  for (const auto& planes : opened.coverage().planes)
    levels = std::min(levels, level_count(*planes, options));
  return levels;
}

/// Threads for a view's levels: the run's (options.pool), or their own where the run has none.
struct LevelThreads {
  std::shared_ptr<ThreadPool> own;  ///< for the level that is looked up most; may be null
  std::shared_ptr<ThreadPool> coarse;
};

/// Collective. An atlas's renderers for a view. Members that poses near the nominal one need are
/// held once per node. Each rank opens others itself when a search goes farther. All members'
/// levels have about the same blur, so the nominal pose's member states it.
FieldRenderers renderers_of_atlas(const OpenedField& opened,
                                  int levels,
                                  const PoseFrame& nominal,
                                  const View& view,
                                  const LevelThreads& threads,
                                  const Communicator& communicator) {
  const std::vector<std::uint64_t> near =
      on_root(communicator, [&] { return members_in_reach(opened, nominal, view); }).share();
  const auto open = [opened, levels, threads](std::size_t member) {
    FieldSamples samples;
    return std::make_shared<const MemberLevels>(
        renderers_of(opened.member(member, Communicator::alone()),
                     opened.info().look_up,
                     levels,
                     threads.own,
                     threads.coarse,
                     process_memory(),
                     samples)
            .levels);
  };
  const auto members =
      std::make_shared<MembersInUse>(open, near.size() + OpenedField::kMembersKept);
  FieldRenderers set;
  for (const std::uint64_t i : near) {
    FieldSamples samples;
    const FieldRenderers made = renderers_of(opened.member(i, communicator),
                                             opened.info().look_up,
                                             levels,
                                             threads.own,
                                             threads.coarse,
                                             node_memory(communicator),
                                             samples);
    members->keep(i, std::make_shared<const MemberLevels>(made.levels));
    if (set.blur_sigma_mm.empty()) set.blur_sigma_mm = made.blur_sigma_mm;
    set.look_up = made.look_up;
  }
  for (std::size_t level = 0; level <= set.blur_sigma_mm.size(); ++level)
    set.levels.push_back(
        std::make_shared<const FieldSetDrr>(atlas_level(opened.coverage().planes, members, level)));
  return set;
}

/// Collective. Volumes that are blurred by already_mm, blurred by sigma_mm.
CastVolumes blurred_volumes(const CastVolumes& volumes,
                            double sigma_mm,
                            double already_mm,
                            const Communicator& communicator) {
  CastVolumes blurred = volumes;
  for (auto* volume : {&blurred.all, &blurred.bone})
    if (*volume) *volume = blurred_per_node(**volume, sigma_mm, already_mm, communicator);
  return blurred;
}

std::shared_ptr<const DrrRenderer> sampled_twice_per_sigma(const CastVolumes& blurred,
                                                           double sigma_mm,
                                                           const CaseLoadOptions& options) {
  RayCasterOptions caster = options.ray_caster;
  caster.step_mm = std::max(caster.step_mm, 0.5 * sigma_mm);
  return ray_cast_through(blurred, caster, options);
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
  return sampled_twice_per_sigma(
      blurred_volumes(volumes, sigma_mm, 0.0, communicator), sigma_mm, options);
}

std::vector<RendererLevel> coarse_ray_casts(const CastVolumes& volumes,
                                            const CaseLoadOptions& options,
                                            const Communicator& communicator) {
  std::vector<RendererLevel> levels;
  const int coarsest_level = std::max(options.coarsest_level, options.judging_level);
  CastVolumes below = volumes;
  double below_mm = 0.0;
  for (int level = 1; level <= coarsest_level; ++level) {
    const auto at = static_cast<std::size_t>(level - 1);
    const double sigma_mm = at < options.level_blur_sigma_mm.size()
                                ? options.level_blur_sigma_mm[at]
                                : kAssumedNodeMm * level_blur_sigma_in_nodes(level, true);
    const bool goes_on = sigma_mm > below_mm;
    below = blurred_volumes(
        goes_on ? below : volumes, sigma_mm, goes_on ? below_mm : 0.0, communicator);
    below_mm = sigma_mm;
    levels.push_back({sampled_twice_per_sigma(below, sigma_mm, options), sigma_mm});
  }
  return levels;
}

FieldRenderers field_renderers(const OpenedField& opened,
                               const std::optional<OpenedField>& bone,
                               const PoseFrame& nominal,
                               const View& view,
                               const CaseLoadOptions& options,
                               const Communicator& communicator) {
  const LevelThreads threads{options.pool,
                             options.pool ? options.pool : std::make_shared<ThreadPool>()};
  int levels = level_count(opened, options);
  if (bone) levels = std::min(levels, level_count(*bone, options));
  const auto renderers = [&](const OpenedField& file) {
    if (file.atlas()) return renderers_of_atlas(file, levels, nominal, view, threads, communicator);
    return renderers_of(file.field(),
                        file.info().look_up,
                        levels,
                        threads.own,
                        threads.coarse,
                        node_memory(communicator),
                        file.samples());
  };
  FieldRenderers all = renderers(opened);
  FieldRenderers of_bone;
  if (bone) {
    of_bone = renderers(*bone);
    all.levels.resize(std::min(all.levels.size(), of_bone.levels.size()));
    all.blur_sigma_mm.resize(all.levels.size() - 1);
  }
  of_bone.levels.resize(all.levels.size());
  if (!options.beam.is_ordinary()) {
    const XrayBeam beam = beam_of(opened.identity(), options, communicator);
    for (std::size_t i = 0; i < all.levels.size(); ++i)
      all.levels[i] = beam.renderer(all.levels[i], of_bone.levels[i]);
  }
  return all;
}

}  // namespace af::registration
