// SPDX-License-Identifier: Apache-2.0
// Joins files and numerics for the programs that register, af-register and af-evaluate.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/thread_pool.h"
#include "ct/ray_caster.h"
#include "drr/opened_field.h"
#include "drr/xray_beam.h"
#include "ranks/communicator.h"
#include "ranks/input_identity.h"
#include "register/problem/registration_problem.h"
#include "study/study_file.h"
#include "study/xray_reader.h"

namespace af::registration {

class KeptFields;

enum class RendererKind { Field, RayCast };

/// "field" or "raycast".
const char* to_string(RendererKind kind);

/// The message for a correction where rays are cast anyway.
inline constexpr const char* kCorrectsRayCasting =
    "--correct = set: must not be given with --renderer raycast, whose DRRs are ray-cast already";

struct CaseLoadOptions {
  RendererKind renderer = RendererKind::Field;
  std::map<std::string, std::filesystem::path>
      field_paths;               ///< camera -> field; replaces the study's
  AttenuationModel attenuation;  ///< for ray casting
  RayCasterOptions ray_caster;
  /// The beam whose X-rays DRRs imitate. Where it has a spectrum, bone_field_path() of each field
  /// is also read.
  XrayBeamOptions beam;
  bool skip_ct_check = false;  ///< with fields: do not read the CT (it may be absent)
  /// Radius, mm on the isocentre plane, of the discs about the study's fiducials that registration
  /// does not see. 0: it sees them.
  double fiducial_mask_mm = 0.0;
  bool region_follows_target = true;  ///< RegistrationOptions::region_follows_target
  int coarsest_level = 0;  ///< of the image pyramids: RegistrationOptions::coarsest_level()
  /// Level that the verdict needs: PoseExaminer::coarsest_level(). Fields of few nodes have fewer.
  /// 0: no verdict is wanted, and the target box of the CT is not read.
  int judging_level = 0;
  /// For ray casting: blurs of levels 1, 2, ..., in mm on the isocentre plane. Missing ones are
  /// those of a field with 1 mm between its nodes.
  std::vector<double> level_blur_sigma_mm;
  /// With fields: levels at which a correction casts rays: RegistrationOptions::last_levels().
  std::vector<int> correction_levels;
  /// Threads that make the levels together. None: only the calling thread.
  std::shared_ptr<ThreadPool> pool = nullptr;
  /// camera -> field that is open already, the one at field_paths.
  std::map<std::string, std::shared_ptr<const OpenedField>> opened_fields;
  /// Fields that the previous case left open. None: every case opens its own.
  std::shared_ptr<KeptFields> kept_fields = nullptr;
};

struct LoadedCase {
  std::shared_ptr<const RegistrationProblem> problem;
  InputIdentities inputs;                          ///< "ct", "field A", "xray A", ...
  std::map<std::string, std::string> input_notes;  ///< how each was read: "xray A", ...; rank 0
  std::vector<std::string> warnings;
  std::vector<ViewXrayReader> xray_readers;  ///< one per view, in order; rank 0
};

/// Collective. Everything that a registration of one case needs, with the same content on every
/// rank: X-rays and masks (on every rank), and fields or the CT's attenuation, with their coarser
/// levels, held once per node. The levels of ray casting are the CT, blurred as the levels of
/// fields blur DRRs.
/// With fields, only rank 0 looks at the CT, for its hash and grid (read_ct_facts()). With
/// skip_ct_check nobody does, and steps are scaled as if it filled 200 mm about the ROI centre. If
/// a correction casts rays through the CT, its attenuation must equal the fields' (InputError).
/// A field for another camera is accepted: at every pose its rays decide, and a note says how far
/// the camera is from the field's and what is covered. Throws FileError (exit 4) when a field was
/// made from another CT than the case's, or than the first field, or misses rays of a view's widest
/// region at the nominal pose. Throws InputError when a view has no field.
LoadedCase load_case(const Study& study,
                     const StudyCase& study_case,
                     const CaseLoadOptions& options,
                     const Communicator& communicator);

/// The problem with other X-rays, by camera, each prepared as the study's (`readers`: of the loaded
/// case; `fiducial_mask_mm`: of its options). All else is shared. What is odd about them goes to
/// `warnings`. Throws InputError for a camera of no view, and as load_case() does for X-rays.
std::shared_ptr<const RegistrationProblem> with_xrays(const RegistrationProblem& problem,
                                                      std::span<ViewXrayReader> readers,
                                                      double fiducial_mask_mm,
                                                      std::map<std::string, Image2d> xrays,
                                                      std::vector<std::string>& warnings);

}  // namespace af::registration
