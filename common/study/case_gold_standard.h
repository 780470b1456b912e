// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "geometry/fiducial_registration.h"
#include "geometry/gold_uncertainty.h"
#include "study/study_file.h"

namespace af {

/// What a case's registrations are measured against.
struct GoldStandard {
  RigidTransform room_from_ct = RigidTransform::Identity();
  std::string source;                          ///< "fiducials" or "study"
  std::optional<FiducialGold> fiducials;       ///< when two views show at least three
  std::optional<GoldUncertainty> uncertainty;  ///< uncertainty of the fiducials' pose at the target
  std::optional<RigidTransform> stated_pose;   ///< the study's gold_room_from_ct
  std::optional<double> stated_to_fiducials_mm;  ///< mean TRE between the two, when both exist
};

/// Whether two views show at least three of the case's fiducials.
bool has_fiducial_gold(const Study& study, const StudyCase& study_case);

/// Throws InputError where gold_standard() has nothing to choose. It costs nothing, so it comes
/// before work that takes long.
void require_gold(const Study& study, const StudyCase& study_case, const std::string& choice);

/// Where "auto" takes the gold pose of a case from: "fiducials", "study" or "none".
std::string gold_source(const Study& study, const StudyCase& study_case);

/// The gold standard of a case. `choice`: "fiducials", "study" (gold_room_from_ct) or "auto", which
/// is fiducials when the case has them, else the stated pose. Throws InputError when the chosen one
/// does not exist.
GoldStandard gold_standard(const Study& study,
                           const StudyCase& study_case,
                           const std::string& choice);

/// The case's gold pose as af-evaluate takes it: from its fiducials if two views show them, else
/// the one that the study states. nullopt when the study knows none.
std::optional<GoldStandard> known_gold(const Study& study, const StudyCase& study_case);

/// The mean TRE (mm) of the gold standard itself, stated beside every TRE that is measured against
/// this pose. NaN for a stated pose, whose uncertainty is unknown.
double own_tre_mm(const GoldStandard& gold);

/// Source, fiducial registration error, ray gaps, residuals, leave-one-out errors, uncertainty at
/// the target, distance between both golds.
nlohmann::json to_json(const GoldStandard& gold);

}  // namespace af
