// SPDX-License-Identifier: Apache-2.0
// A whole registration: what af-register, af-evaluate and the library do from a start to the
// judgement of its end.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "base/thread_pool.h"
#include "register/method/prepared_stage.h"
#include "register/method/registration_result.h"
#include "register/search/pose_search.h"
#include "register/verdict/pose_examiner.h"
#include "register/verdict/target_examiner.h"
#include "register/verdict/uncertainty_estimator.h"
#include "register/verdict/view_diagnosis.h"

namespace af::registration {

/// Distances of a registration's start and end from the gold pose.
struct TargetErrors {
  std::string gold_source;  ///< "fiducials" or "study" (its gold_room_from_ct)
  double initial_tre_mm = 0.0;
  double tre_mm = 0.0;
};

/// Of the ends of other starts that lie elsewhere, the one that explains the X-rays best.
struct RivalEnd {
  double apart_mm = 0.0;  ///< from the end: seen_distance_mm()
  double share = 0.0;     ///< of what the end explains, ViewValue::coarse
};

/// One registration, and what is said about its end.
struct RegistrationRecord {
  std::int64_t start_index = 0;
  RegistrationResult result;
  std::vector<ViewValue> view_values;  ///< from PoseExaminer, at the end
  UncertaintyReport uncertainty;       ///< from UncertaintyEstimator, likewise
  ViewDiagnosis diagnosis;             ///< if X-rays were looked into: Registration::diagnose()
  std::optional<TargetErrors> errors;  ///< when the gold pose is known
  std::optional<RivalEnd> rival;       ///< where starts were searched: see set_rival()

  /// What the registration itself found. The rest is derived from it.
  auto members() { return std::tie(start_index, result, view_values, uncertainty); }
};

/// Registers one case from any number of starts. Construction does what all starts share (smoothed
/// and decimated references, histograms' ranges, X-ray bins), and runs reuse the buffers. One run
/// at a time spreads over the threads of a pool: views, and independent poses. Concurrent runs need
/// a registration each. A result depends only on problem, method and start (except its seconds),
/// not on the number of threads. The DRR range of a case is that of the DRR at the nominal pose
/// over the study's region grown by half its size to every side. \test
/// Registration.TwoViewsRecoverAKnownPose
class Registration {
 public:
  /// Throws InputError when method or problem have problems, or when the nominal pose is outside a
  /// field. Without `threads` only the calling thread works.
  Registration(std::shared_ptr<const RegistrationProblem> of_problem,
               const RegistrationOptions& by_method,
               const std::shared_ptr<ThreadPool>& threads = nullptr);

  /// Makes run() examine ends. Otherwise records have neither view_values nor uncertainty.
  void examine_ends(const UncertaintyOptions& options,
                    const std::shared_ptr<ThreadPool>& threads = nullptr);

  /// Makes run_everywhere() possible. Throws InputError as PoseSearch does.
  void look_for_starts(const PoseSearchOptions& options,
                       const std::shared_ptr<ThreadPool>& threads = nullptr);

  // The parts, in the order in which a start meets them. They are made for each other, so read them
  // but do not assign to them.

  std::shared_ptr<const RegistrationProblem> problem;  ///< X-rays, cameras, renderers
  RegistrationOptions method;                          ///< chains of stages, finish, judge
  /// Stages of all chains and then of the finish. Each is an objective (renderers and measures of
  /// its views) and the optimiser that searches it.
  std::vector<PreparedStage> stages;
  std::optional<PreparedStage> judge;               ///< chooses among the ends of a portfolio
  std::optional<PoseExaminer> examiner;             ///< values the end view by view
  std::optional<TargetExaminer> target_examiner;    ///< asks the target about an end that is found
  std::optional<UncertaintyEstimator> uncertainty;  ///< how far the end may be from the truth
  std::optional<PoseSearch> pose_search;            ///< finds starts where none is known

  /// From a start to its end: chain by chain, stage by stage, the choice among their ends, the
  /// finish, the correction. `start_index` is a key of random numbers.
  [[nodiscard]] RegistrationResult search(const RigidTransform& start_room_from_ct,
                                          std::int64_t start_index = 0);
  /// search(), and what examiner and uncertainty say about its end.
  [[nodiscard]] RegistrationRecord run(const RigidTransform& start_room_from_ct,
                                       std::int64_t start_index = 0);
  /// run() from every pose that the search finds. Returns the best record, with its rival, the
  /// seconds of everything and the poses and DRRs of all registrations.
  [[nodiscard]] RegistrationRecord run_everywhere(std::int64_t start_index = 0);
  /// Looks into X-rays that do not fit the end of a record from run() (ViewDiagnoser).
  void diagnose(RegistrationRecord& record);

  /// The value of RegistrationResult::similarity at a pose.
  [[nodiscard]] ObjectiveValue similarity_at(const RigidTransform& room_from_ct);

 private:
  void ask_target(RegistrationRecord& record);

  std::vector<Eigen::Vector3d> step_points_ct_;
  OptimizerResult found_;  ///< reused
  ViewDiagnoser diagnoser_;
};

/// The verdict on a record by its confidence (judged_confidence()). It is not found where the
/// search found nothing, and at least doubtful where something else leaves a doubt. The reason
/// names all of it, and mentions a clipped start and a target that could not be asked.
Judgement judgement_of(const RegistrationRecord& record);

/// Order of records by similarity, highest first. Those that are not found come after the others,
/// those without a similarity last. Ties go by start index.
bool is_better(const RegistrationRecord& a, const RegistrationRecord& b);

/// Index of the best record; `records` is not empty.
std::size_t best_record(const std::vector<RegistrationRecord>& records);

/// Sets the rival of a record among those of one problem, which were examined: none where all
/// others ended at the same place or are not found. \test
/// Judgement.AnEndElsewhereThatIsAsAlikeLeavesADoubt
void set_rival(const RegistrationProblem& problem,
               const std::vector<RegistrationRecord>& records,
               RegistrationRecord& record);

}  // namespace af::registration
