// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>

#include "base/thread_pool.h"
#include "geometry/rigid_transform.h"
#include "register/problem/registration_problem.h"
#include "register/verdict/target_evidence.h"

namespace af::registration {

/// Where the target alone fits.
struct TargetAnswer {
  double share;  ///< TargetEvidence::share
  RigidTransform room_from_ct;
};

/// Asks the target of a case about poses. DRRs in which only it moves (PartMotionDrr) are compared
/// with the X-rays around its shadow, by the measure of portfolios' judge. This recognises a pose
/// that fits everything except a bone that has moved. For one thread at a time.
///
/// Ends of many starts lie within micrometres of each other. The rest is therefore held at the
/// nearest pose of a lattice (0.1 mm, 0.001 rad), and the target is registered once for each of
/// these. The evidence on a pose depends on that pose alone. \test
/// TargetExaminer.TellsHowFarTheTargetMovedAgainstTheRest
class TargetExaminer {
 public:
  /// Without `threads` only the calling thread works.
  explicit TargetExaminer(std::shared_ptr<const RegistrationProblem> problem,
                          std::shared_ptr<ThreadPool> threads = nullptr);

  /// No answer where a view has no target_casts or does not see the target, where its X-ray shows
  /// no gradients there, and where a field does not hold the pose.
  [[nodiscard]] TargetEvidence evidence(const RigidTransform& room_from_ct);

 private:
  using LatticePose = std::array<std::int64_t, 6>;

  std::shared_ptr<const RegistrationProblem> problem_;
  std::shared_ptr<ThreadPool> threads_;
  /// None where the target could not be asked.
  std::map<LatticePose, std::optional<TargetAnswer>> answers_;
};

}  // namespace af::registration
