// SPDX-License-Identifier: Apache-2.0
#include "precompute/field_parts.h"

#include <utility>

#include "base/error.h"
#include "base/stored_bytes.h"
#include "geometry/orbit.h"
#include "precompute/build/orbit_text.h"
#include "precompute/casting/casters.h"
#include "precompute/casting/corrected_caster.h"
#include "precompute/casting/joined_caster.h"
#include "precompute/casting/least_squares_caster.h"
#include "precompute/casting/unit_costs.h"
#include "ranks/root_only.h"
#include "study/rig_file.h"
#include "study/shared_inputs.h"

namespace af {

namespace {

/// What distinguishes a part from the others, as rank 0 derived it, because trigonometry may differ
/// in its last bit between processors.
struct PartKey {
  CameraGeometry camera;
  MotionRange range;
  MotionRange sized_for;
  std::vector<HalfSpace> sources;
  auto members() {
    return std::tie(camera, range.low, range.high, sized_for.low, sized_for.high, sources);
  }
};

std::vector<PartKey> keys_of_orbit(const FieldSource& source, const PrecomputeOptions& options) {
  Orbit orbit = orbit_of_text("--orbit", options.orbit);
  // If the rays of stationary cameras count too, sources are scattered widely.
  if (!source.more_cameras.empty()) orbit.members_by = Orbit::MembersBy::Pose;
  std::vector<PartKey> keys;
  for (OrbitMember& member :
       orbit_members(source.camera, source.isocenter_point, source.frame, source.range, orbit))
    keys.push_back(
        {std::move(member.camera), member.range, member.sized_for, std::move(member.sources)});
  return keys;
}

/// The camera, and those of the rig with other names.
std::vector<CameraGeometry> listed_cameras(const FieldSource& source,
                                           const std::string& path,
                                           const CameraRig& rig) {
  std::vector<CameraGeometry> cameras = {source.camera};
  for (const CameraGeometry& camera : rig.cameras)
    if (camera.name != source.camera.name) cameras.push_back(camera);
  if (cameras.size() > static_cast<std::size_t>(kMaxOrbitMembers))
    throw InputError("--orbit-cameras",
                     std::to_string(cameras.size()) + " cameras",
                     "at most " + std::to_string(kMaxOrbitMembers) + " fields stand in a file",
                     path);
  return cameras;
}

std::vector<FieldPart> parts_of_orbit(const FieldSource& source,
                                      const PrecomputeOptions& options,
                                      const Communicator& communicator) {
  std::vector<PartKey> keys =
      on_root(communicator, [&] { return keys_of_orbit(source, options); }).share().take();
  std::vector<FieldPart> parts;
  for (PartKey& key : keys) {
    FieldPart part{source, key.range, {}, {}};
    key.camera.pixel_spacing_mm = source.camera.pixel_spacing_mm;
    key.camera.size_px = source.camera.size_px;
    part.source.camera = key.camera;
    part.source.range = key.sized_for;
    part.source.sources = std::move(key.sources);
    parts.push_back(std::move(part));
  }
  return parts;
}

/// Collective.
std::shared_ptr<const SlabAlignedVolume> resampled_on_node(const AttenuationVolume& volume,
                                                           const RigidTransform& slab_from_ct,
                                                           const Communicator& communicator) {
  const SlabAlignedLayout layout =
      all_or_none(communicator, [&] { return slab_aligned_layout(volume, slab_from_ct); });
  return std::make_shared<const SlabAlignedVolume>(
      volume, slab_from_ct, layout, [&](std::size_t bytes, const SlabAlignedFill& fill) {
        return communicator.allocate_on_node_together(bytes, fill);
      });
}

/// A caster of line integrals of the part's CT, plus what measured X-rays show beyond it.
std::unique_ptr<const FieldCaster> line_integral_caster(const FieldPart& part,
                                                        const LightSlab& planes,
                                                        const PrecomputeOptions& options) {
  const AttenuationQuantizer quantizer = part.source.quantizer();
  std::unique_ptr<const FieldCaster> of_ct =
      caster_named(options.caster)
          .make({*part.source.volume, part.resampled.get(), planes, quantizer, options.ray_caster});
  if (part.source.projections == nullptr) return of_ct;
  const Eigen::Vector3d toward_source =
      planes.slab_from_ct.linear().transpose() * Eigen::Vector3d::UnitY();
  return std::make_unique<const CorrectedFieldCaster>(
      std::move(of_ct),
      MeasuredResidual(part.source.projections->views, *part.source.volume, toward_source),
      planes,
      quantizer);
}

std::unique_ptr<const FieldCaster> caster_of_part(const FieldPart& part,
                                                  const PrecomputeOptions& options) {
  const auto of_planes = [&](const LightSlab& planes) {
    return line_integral_caster(part, planes, options);
  };
  if (options.design().fits_uv)
    return std::make_unique<const LeastSquaresFieldCaster>(part.light_slab, of_planes);
  return of_planes(part.light_slab);
}

std::vector<std::size_t> slab_counts(const std::vector<FieldPart>& parts) {
  std::vector<std::size_t> counts;
  counts.reserve(parts.size());
  for (const FieldPart& part : parts) counts.push_back(part.light_slab.slabs.size());
  return counts;
}

}  // namespace

std::vector<FieldPart> field_parts(const FieldSource& source,
                                   const PrecomputeOptions& options,
                                   const Communicator& communicator) {
  if (!options.orbit.empty()) return parts_of_orbit(source, options, communicator);
  if (options.orbit_cameras.empty()) return {FieldPart{source, source.range, {}, {}}};
  const CameraRig rig = shared_rig(options.orbit_cameras, communicator);
  std::vector<FieldPart> parts;
  for (const CameraGeometry& camera : all_or_none(
           communicator, [&] { return listed_cameras(source, options.orbit_cameras, rig); })) {
    parts.push_back({source, source.range, {}, {}});
    parts.back().source.camera = camera;
  }
  return parts;
}

std::vector<FieldPart> with_resampled_ct(std::vector<FieldPart> parts,
                                         WorkNote& note,
                                         const Communicator& communicator) {
  for (std::size_t i = 0; i < parts.size(); ++i) {
    note.change(parts.size() == 1 ? "resampling the CT"
                                  : "resampling the CT for " + std::to_string(i + 1) + " of " +
                                        std::to_string(parts.size()) + " fields");
    parts[i].resampled =
        resampled_on_node(*parts[i].source.volume, parts[i].light_slab.slab_from_ct, communicator);
  }
  return parts;
}

FieldLattice lattice_of(const std::vector<FieldPart>& parts) {
  FieldLattice all;
  for (const FieldPart& part : parts)
    for (const SlabLattice& slab : part.light_slab.lattice().slabs) all.slabs.push_back(slab);
  return all;
}

std::unique_ptr<const FieldCaster> make_caster(const std::vector<FieldPart>& parts,
                                               const PrecomputeOptions& options) {
  std::vector<std::unique_ptr<const FieldCaster>> casters;
  casters.reserve(parts.size());
  for (const FieldPart& part : parts) casters.push_back(caster_of_part(part, options));
  if (casters.size() == 1) return std::move(casters.front());
  return std::make_unique<const JoinedCaster>(std::move(casters), slab_counts(parts));
}

std::vector<double> costs_over_parts(const std::vector<WorkUnit>& units,
                                     const std::vector<FieldPart>& parts) {
  const std::vector<SlabPlace> places = slab_places(slab_counts(parts));
  std::vector<double> costs;
  costs.reserve(units.size());
  // The units of a part are consecutive, as its slabs are.
  for (std::size_t first = 0; first < units.size();) {
    const std::size_t field = places.at(units[first].slab).field;
    std::vector<WorkUnit> of_part;
    for (; first < units.size() && places.at(units[first].slab).field == field; ++first) {
      of_part.push_back(units[first]);
      of_part.back().slab = places[units[first].slab].slab;
    }
    const FieldPart& part = parts[field];
    const std::vector<double> its_costs =
        unit_costs(of_part, part.light_slab, part.source.volume->corner_points());
    costs.insert(costs.end(), its_costs.begin(), its_costs.end());
  }
  return costs;
}

}  // namespace af
