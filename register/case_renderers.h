// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ct/attenuation_volume.h"
#include "drr/opened_field.h"
#include "drr/xray_beam.h"
#include "ranks/communicator.h"
#include "register/case_loading.h"
#include "register/problem/registration_problem.h"

namespace af::registration {

/// The volumes through which rays are cast.
struct CastVolumes {
  std::shared_ptr<const AttenuationVolume> all;
  std::shared_ptr<const AttenuationVolume> bone;  ///< none for DRRs of one energy
  std::shared_ptr<const XrayBeam> beam;
};

/// Collective. The volumes that the beam needs, each held once per node.
CastVolumes cast_volumes(std::shared_ptr<const AttenuationVolume> all,
                         const CaseLoadOptions& options,
                         const Communicator& communicator);

/// DRRs by ray casting through the volumes.
std::shared_ptr<const DrrRenderer> ray_cast_through(const CastVolumes& volumes,
                                                    const RayCasterOptions& caster,
                                                    const CaseLoadOptions& options);

/// Collective. A level of ray casting: the CT blurred as the fields' level blurs DRRs, sampled
/// twice per sigma.
std::shared_ptr<const DrrRenderer> coarse_ray_cast(const CastVolumes& volumes,
                                                   double sigma_mm,
                                                   const CaseLoadOptions& options,
                                                   const Communicator& communicator);

/// Collective. Levels 1 ... of ray casting, as many as the method and its judge look at.
std::vector<RendererLevel> coarse_ray_casts(const CastVolumes& volumes,
                                            const CaseLoadOptions& options,
                                            const Communicator& communicator);

/// Renderers of a field or an atlas, and the blurs of its levels 1, 2, ...
struct FieldRenderers {
  std::vector<std::shared_ptr<const DrrRenderer>> levels;  ///< its own renderer first
  std::vector<double> blur_sigma_mm;
  std::string look_up;  ///< of the first level
};

/// Collective. Renderers for a view and its coarser levels, looked up in a field or an atlas and
/// held once per node. With `bone` they render the tube's spectrum, at the levels that both fields
/// have, with the blurs of the ordinary field. Atlas members that poses near the nominal one need
/// are held once per node, and each rank opens others itself when a search goes farther. A field's
/// samples stay with it (OpenedField::samples()).
FieldRenderers field_renderers(const OpenedField& opened,
                               const std::optional<OpenedField>& bone,
                               const PoseFrame& nominal,
                               const View& view,
                               const CaseLoadOptions& options,
                               const Communicator& communicator);

}  // namespace af::registration
