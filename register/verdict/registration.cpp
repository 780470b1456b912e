// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/registration.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/joined.h"
#include "geometry/tre.h"
#include "register/optimizer/newton_search.h"
#include "register/problem/pose_target.h"
#include "register/problem/target_region.h"

namespace af::registration {
namespace {

using Clock = std::chrono::steady_clock;

/// About 512 of the points, which is enough to scale steps.
std::vector<Eigen::Vector3d> some_points(const std::vector<Eigen::Vector3d>& points) {
  constexpr std::size_t kPoints = 512;
  // An odd stride walks through all rows and layers of an even lattice.
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kPoints) | 1;
  std::vector<Eigen::Vector3d> some;
  for (std::size_t i = 0; i < points.size(); i += stride) some.push_back(points[i]);
  return some;
}

/// Where a chain ended.
struct ChainEnd {
  RigidTransform room_from_ct;
  double similarity = std::numeric_limits<double>::quiet_NaN();
  StopReason stop_reason = StopReason::StepBelowFinal;
  std::string pinned_along = {};  ///< RegistrationResult::pinned_along
  std::size_t stage = 0;          ///< the last one searched
};

/// An end that the judge has valued.
struct PortfolioEnd : ChainEnd {
  const ChainOptions* chain = nullptr;
};

/// An end is also finished if it is worth at least this share of the best one to the judge, and
/// lies farther than this from every better one. The judge looks coarsely: it preferred wrong ends
/// by up to 5 % where the finish gave right ones values that were a third higher. The finish errs
/// too: at 0.8 it chose ends of a real skull that were worth 0.82 (docs/robust-tuning.md).
/// \test Registration.TheFinishChoosesAmongEndsThatTheJudgeHardlyTellsApart
constexpr double kRivalShare = 0.9;
constexpr double kRivalDistanceMm = 1.0;

bool is_converged(StopReason reason) {
  return reason == StopReason::StepBelowFinal || reason == StopReason::PinnedAtLimit;
}

bool is_cast(const RegistrationProblem& problem, int level) {
  return std::all_of(problem.views.begin(), problem.views.end(), [&](const RegistrationView& view) {
    return ray_cast_of(view, level) != nullptr;
  });
}

/// Lets a search reuse node images until this object is destroyed.
class ReusedImages {
 public:
  ReusedImages(MultiViewObjective& objective, bool is_allowed) : objective_(objective) {
    objective_.reuse_images(is_allowed);
  }
  ~ReusedImages() { objective_.reuse_images(false); }
  ReusedImages(const ReusedImages&) = delete;
  ReusedImages& operator=(const ReusedImages&) = delete;

 private:
  MultiViewObjective& objective_;
};

/// The value that a portfolio's judge gives a pose, averaged over the views.
ObjectiveValue value_of_judge(PreparedStage& judge,
                              const RegistrationProblem& problem,
                              const RigidTransform& room_from_ct) {
  ObjectiveValue value = judge.value_at(problem, room_from_ct);
  value.similarity /= static_cast<double>(problem.views.size());
  return value;
}

std::optional<ParameterScaling> scaling_at(const RegistrationProblem& problem,
                                           const RigidTransform& room_from_ct,
                                           std::span<const Eigen::Vector3d> points_ct) {
  return projected_motion_scaling(room_from_ct,
                                  problem.center_ct_mm,
                                  points_ct,
                                  views_at(problem, room_from_ct),
                                  problem.isocenter_point);
}

/// Differences over this many mm to both sides average over a field's nodes, but are small compared
/// with the way over which curvatures change.
constexpr double kCurvatureStepMm = 0.2;

/// What a correction needs and the problem lacks.
std::vector<std::string> correction_problems(const RegistrationProblem& problem,
                                             const RegistrationOptions& options) {
  std::vector<std::string> found;
  if (!options.correction.is_wanted) return found;
  if (problem.target_points_ct.empty())
    found.emplace_back("target_points_ct = none: a correction needs at least one");
  for (const RegistrationView& view : problem.views)
    for (const int level : options.last_levels())
      if (!ray_cast_of(view, level))
        found.push_back(view_name(view) + "ray_casts = none for level " + std::to_string(level) +
                        ": a correction needs it");
  return found;
}

/// One start on its way through the parts of a registration.
struct Run {
  const RegistrationProblem& problem;
  const RegistrationOptions& options;
  std::vector<PreparedStage>& stages;
  std::optional<PreparedStage>& judge;
  OptimizerResult& search;  ///< of the last stage that was searched
  std::int64_t start_index = 0;
  RigidTransform start;                      ///< within the motion range
  std::optional<ParameterScaling> at_start;  ///< from some of the points, at the start
  RegistrationResult result;

  /// The scaling with which a stage searches from a pose.
  [[nodiscard]] std::optional<ParameterScaling> scaling_of(
      const PreparedStage& stage, const RigidTransform& room_from_ct) const;
  [[nodiscard]] std::uint64_t random_key(std::size_t index) const;
  /// Runs the stages of a chain, the first of which is `first`, from `end`. False when one of them
  /// did not converge.
  bool run_chain(const ChainOptions& chain, std::size_t first, ChainEnd& end);
  /// Searches one stage from `end`. False when it did not converge. `index` is its place in the
  /// trace, and a key of random numbers.
  bool run_stage(PreparedStage& stage, std::size_t index, ChainEnd& end);
  /// Where the search that ended last is pinned, "" when it is not.
  [[nodiscard]] std::string pinned_along(const PoseTarget& target,
                                         const PreparedStage& stage) const;
  /// Places a stage at its start. False when it cannot, and `end` says why.
  [[nodiscard]] bool place_at_start(PreparedStage& stage, ChainEnd& end);
  /// Evaluates an end within its own regions and silhouettes and without reused images, so that
  /// similarities of ends of several starts can be compared.
  void take_own_similarity(ChainEnd& end);
  /// Runs the chains and judges their ends. Returns those that have a value, the best one first.
  std::vector<PortfolioEnd> portfolio_ends();
  /// Whether the best of these ends, which comes first, ends the portfolio.
  [[nodiscard]] bool is_convincing(std::span<const PortfolioEnd> ends) const {
    return ends.front().similarity >= options.judge.enough_value;
  }
  /// Distance from an end to the nearest one of another chain that `counts`, averaged over the
  /// target box. NaN without any.
  template <typename Counts>
  [[nodiscard]] double nearest_mm(const PortfolioEnd& end,
                                  std::span<const PortfolioEnd> others,
                                  const Counts& counts) const;
  /// Whether end `i`, behind the better ones, should be finished too.
  [[nodiscard]] bool is_rival(std::span<const PortfolioEnd> ends, std::size_t i) const;
  /// Finishes an end. The similarity is NaN when nothing was searched.
  PortfolioEnd finished(PortfolioEnd end);
  /// Finishes the best end and, unless that is convincing, its rivals. The finish's own value
  /// chooses among those that converged.
  PortfolioEnd finished_best(std::span<const PortfolioEnd> ends);
  /// Runs one chain, and its finish.
  void run_alone();
  /// Runs several chains, the choice among their ends, and its finish.
  void run_portfolio();
  /// Runs the finish from `end`.
  void run_finish(ChainEnd& end) {
    run_chain(options.finish, stages.size() - options.finish.stages.size(), end);
  }
  /// Runs the correction from an end that converged.
  void correct(ChainEnd& end);
  /// Searches the end's last stage with ray-cast DRRs, into `search`. Returns the pose that it
  /// found.
  ChainEnd search_by_casting(const ParameterScaling& scaling,
                             const SearchBudget& budget,
                             const ChainEnd& end);
  /// The judge's value at a pose; NaN when inadmissible.
  double judged(const RigidTransform& room_from_ct);
  void append_trace(std::size_t index, const PoseTarget& target);
};

std::optional<ParameterScaling> Run::scaling_of(const PreparedStage& stage,
                                                const RigidTransform& room_from_ct) const {
  return stage.optimizer->needs() == Derivatives::None
             ? scaling_at(problem, room_from_ct, problem.scaling_points_ct)
             : at_start;
}

std::uint64_t Run::random_key(std::size_t index) const {
  return hash64(
      options.seed, hash_name(problem.case_name), static_cast<std::uint64_t>(start_index), index);
}

void Run::append_trace(std::size_t index, const PoseTarget& target) {
  const PoseFrame frame = problem.frame();
  for (const OptimizerIteration& iteration : search.trace)
    result.trace.push_back({static_cast<int>(index),
                            iteration.step_mm,
                            result.evaluations + iteration.evaluations,
                            iteration.value,
                            parameters_from_pose(frame, target.pose(iteration.point))});
}

std::string Run::pinned_along(const PoseTarget& target, const PreparedStage& stage) const {
  if (search.stop_reason != StopReason::PinnedAtLimit) return "";
  return parameter_names(target.limits_at(search.point, stage.options.search.final_step_mm));
}

bool Run::run_stage(PreparedStage& stage, std::size_t index, ChainEnd& end) {
  const std::optional<ParameterScaling> scaling = scaling_of(stage, end.room_from_ct);
  if (!scaling.has_value()) {
    end.stop_reason = StopReason::CtOutsideRoi;
    return false;
  }
  if (!place_at_start(stage, end)) return false;
  PoseTarget target(
      stage.objective, PoseFrame::about(end.room_from_ct, problem.center_ct_mm), *scaling);
  const SearchBudget budget{options.max_evaluations - result.evaluations, random_key(index)};
  {
    // Searches along derivatives take short steps, while others try poses all around.
    const ReusedImages reused(stage.objective, stage.optimizer->needs() != Derivatives::None);
    stage.optimizer->maximize(target, stage.options.search, budget, search);
  }
  append_trace(index, target);
  result.evaluations += search.evaluations;
  result.inadmissible += search.inadmissible;
  result.drr_count += target.drr_count();
  end.stop_reason = search.stop_reason;
  end.similarity = search.value;
  if (search.stop_reason == StopReason::StartInadmissible) {
    result.rays_outside = target.rays_outside();
    return false;
  }
  end.room_from_ct = target.pose(search.point);
  end.pinned_along = pinned_along(target, stage);
  return is_converged(search.stop_reason);
}

bool Run::run_chain(const ChainOptions& chain, std::size_t first, ChainEnd& end) {
  for (std::size_t i = 0; i < chain.stages.size(); ++i) {
    end.stage = first + i;
    if (run_stage(stages[end.stage], end.stage, end)) continue;
    // The previous stage ended at the limit, and rounding put its end beyond it.
    if (i > 0 && end.stop_reason == StopReason::StartInadmissible)
      end.stop_reason = StopReason::PinnedAtLimit;
    return false;
  }
  return true;
}

bool Run::place_at_start(PreparedStage& stage, ChainEnd& end) {
  if (!stage.silhouettes.empty())
    result.drr_count += static_cast<std::int64_t>(problem.views.size());
  if (stage.place_at(problem, end.room_from_ct)) return true;
  end.stop_reason = StopReason::CtOutsideRoi;
  return false;
}

void Run::take_own_similarity(ChainEnd& end) {
  PreparedStage& stage = stages[end.stage];
  const bool has_silhouettes = !stage.silhouettes.empty();
  const bool reused_images = stage.optimizer->needs() != Derivatives::None;
  if (!(reused_images || stage.would_move(problem, end.room_from_ct)) ||
      !std::isfinite(end.similarity))
    return;
  result.drr_count += (has_silhouettes ? 2 : 1) * static_cast<std::int64_t>(problem.views.size());
  if (!stage.place_at(problem, end.room_from_ct)) return;
  const ObjectiveValue value = stage.objective.evaluate(end.room_from_ct);
  if (value.is_admissible) end.similarity = value.similarity;
}

ChainEnd Run::search_by_casting(const ParameterScaling& scaling,
                                const SearchBudget& budget,
                                const ChainEnd& end) {
  PreparedStage& last = stages[end.stage];
  const Derivatives needs = last.optimizer->needs();
  MultiViewObjective casting = ray_cast_objective(problem, last);
  const PoseFrame frame = PoseFrame::about(end.room_from_ct, problem.center_ct_mm);
  PoseTarget cast(casting, frame, scaling);
  if (needs == Derivatives::None) {
    OptimizerOptions final_step = last.options.search;
    final_step.initial_step_mm = final_step.final_step_mm;
    last.optimizer->maximize(cast, final_step, budget, search);
  } else {
    PoseTarget looked_up(last.objective, frame, scaling);
    const ScaledMatrix curvature = measured_curvature(looked_up, needs, kCurvatureStepMm);
    const auto length_mm = [&](const ScaledParameters& from, const ScaledParameters& to) {
      return mean_tre_mm(cast.pose(from), cast.pose(to), problem.target_points_ct);
    };
    newton_search(
        cast,
        curvature,
        {needs, last.options.search.initial_step_mm, options.correction.tolerance_mm, length_mm},
        budget,
        search);
    result.drr_count += looked_up.drr_count();
  }
  append_trace(stages.size(), cast);
  result.evaluations += search.evaluations;
  result.inadmissible += search.inadmissible;
  result.drr_count += cast.drr_count();
  return {cast.pose(search.point),
          search.value,
          search.stop_reason,
          pinned_along(cast, last),
          end.stage};
}

void Run::correct(ChainEnd& end) {
  if (!options.correction.is_wanted) return;
  CorrectionReport& report = result.correction.emplace();
  // A chain that ended early, at the limit, may have ended at a level that is not cast.
  if (!is_converged(end.stop_reason) || !is_cast(problem, stages[end.stage].options.level)) return;
  const auto scaling = scaling_of(stages[end.stage], end.room_from_ct);
  if (!scaling.has_value()) return;
  const SearchBudget budget{
      std::min(options.correction.max_casts, options.max_evaluations - result.evaluations),
      random_key(stages.size())};
  if (budget.max_evaluations <= 0) return;
  const ChainEnd found = search_by_casting(*scaling, budget, end);
  report.casts = search.evaluations;
  // The value comes from look-up, as for ends that are not corrected. This also checks that the
  // fields hold the pose.
  const ObjectiveValue value = stages[end.stage].objective.evaluate(found.room_from_ct);
  result.drr_count += value.drr_count;
  if (!std::isfinite(found.similarity) || !value.is_admissible) return;
  const RigidTransform before_last =
      search.trace.size() > 1
          ? pose_from_parameters(problem.frame(), result.trace.end()[-2].parameters)
          : end.room_from_ct;
  report.moved_mm = mean_tre_mm(end.room_from_ct, found.room_from_ct, problem.target_points_ct);
  report.last_mm = mean_tre_mm(before_last, found.room_from_ct, problem.target_points_ct);
  report.stood_still = is_converged(found.stop_reason);
  if (found.stop_reason == StopReason::PinnedAtLimit) {
    end.stop_reason = found.stop_reason;
    end.pinned_along = found.pinned_along;
  }
  end.room_from_ct = found.room_from_ct;
  end.similarity = value.similarity;
}

double Run::judged(const RigidTransform& room_from_ct) {
  const ObjectiveValue value = value_of_judge(*judge, problem, room_from_ct);
  result.drr_count += value.drr_count;
  return value.similarity;
}

std::vector<PortfolioEnd> Run::portfolio_ends() {
  std::size_t first = 0;
  std::vector<PortfolioEnd> ends;
  for (const ChainOptions& chain : options.chains) {
    const std::size_t begin = std::exchange(first, first + chain.stages.size());
    if (ends.empty() ? chain.from_best_end : ends.front().similarity >= chain.only_below) continue;
    PortfolioEnd end;
    end.room_from_ct = chain.from_best_end ? ends.front().room_from_ct : start;
    end.chain = &chain;
    const int evaluations_before = result.evaluations;
    run_chain(chain, begin, end);
    // Where nothing was searched, the start is not an end.
    if (result.evaluations > evaluations_before) end.similarity = judged(end.room_from_ct);
    if (std::isfinite(end.similarity)) {
      const auto worse = std::find_if(ends.begin(), ends.end(), [&](const PortfolioEnd& other) {
        return other.similarity < end.similarity;
      });
      ends.insert(worse, end);
      if (is_convincing(ends)) break;
    } else if (ends.empty()) {
      result.stop_reason = end.stop_reason;
    }
  }
  return ends;
}

template <typename Counts>
double Run::nearest_mm(const PortfolioEnd& end,
                       std::span<const PortfolioEnd> others,
                       const Counts& counts) const {
  double nearest = std::numeric_limits<double>::quiet_NaN();
  if (problem.target_points_ct.empty()) return nearest;
  for (const PortfolioEnd& other : others)
    if (other.chain != end.chain && counts(other))
      nearest = std::fmin(
          nearest, mean_tre_mm(end.room_from_ct, other.room_from_ct, problem.target_points_ct));
  return nearest;
}

bool Run::is_rival(std::span<const PortfolioEnd> ends, std::size_t i) const {
  return ends[i].similarity >= kRivalShare * ends.front().similarity &&
         nearest_mm(ends[i], ends.first(i), [](const PortfolioEnd&) { return true; }) >
             kRivalDistanceMm;
}

PortfolioEnd Run::finished(PortfolioEnd end) {
  end.similarity = std::numeric_limits<double>::quiet_NaN();
  run_finish(end);
  return end;
}

PortfolioEnd Run::finished_best(std::span<const PortfolioEnd> ends) {
  const auto own_value = [&](PortfolioEnd& end) {
    if (!is_converged(end.stop_reason) || end.stage + 1 != stages.size())
      return -std::numeric_limits<double>::infinity();
    take_own_similarity(end);
    return end.similarity;
  };
  PortfolioEnd best = finished(ends.front());
  if (is_convincing(ends)) return best;
  std::optional<double> best_value;
  for (std::size_t i = 1; i < ends.size(); ++i) {
    if (!is_rival(ends, i)) continue;
    if (!best_value.has_value()) best_value = own_value(best);
    const std::size_t trace_size = result.trace.size();
    PortfolioEnd rival = finished(ends[i]);
    const double value = own_value(rival);
    if (std::isfinite(value) && !(*best_value >= value)) {
      best = rival;
      best_value = value;
    } else {
      result.trace.resize(trace_size);
    }
  }
  // A correction looks where the finish did.
  if (best_value.has_value()) (void)stages[best.stage].place_at(problem, best.room_from_ct);
  return best;
}

void Run::run_alone() {
  const ChainOptions& chain = options.chains.front();
  ChainEnd end{start};
  if (run_chain(chain, 0, end)) run_finish(end);
  correct(end);
  take_own_similarity(end);
  result.room_from_ct = end.room_from_ct;
  result.similarity = end.similarity;
  result.stop_reason = end.stop_reason;
  result.pinned_along = end.pinned_along;
  result.chain = chain.name;
}

void Run::run_portfolio() {
  const std::vector<PortfolioEnd> ends = portfolio_ends();
  if (ends.empty()) return;
  const bool has_finish = !options.finish.stages.empty();
  PortfolioEnd best = has_finish ? finished_best(ends) : ends.front();
  result.chain = best.chain->name;
  const auto chosen = std::find_if(
      ends.begin(), ends.end(), [&](const PortfolioEnd& end) { return end.chain == best.chain; });
  result.chain_distance_mm = nearest_mm(
      *chosen, ends, [](const PortfolioEnd& other) { return !other.chain->from_best_end; });
  correct(best);
  if (has_finish || options.correction.is_wanted) best.similarity = judged(best.room_from_ct);
  result.similarity = best.similarity;
  result.room_from_ct = best.room_from_ct;
  result.pinned_along = best.pinned_along;
  result.stop_reason = best.similarity <= options.judge.least_value ? StopReason::NoBetterThanNoDrr
                                                                    : best.stop_reason;
}

/// Ends nearer to each other than this are one place: searches end a few millimetres apart under
/// stress, and wrong orientations or neighbouring vertebrae lie farther away.
constexpr double kElsewhereMm = 10.0;

/// An end with a rival of this share or more is doubtful. The judge prefers wrong ends by up to a
/// tenth (kRivalShare).
constexpr double kAmbiguousShare = 0.9;

std::string ambiguity_text(const RivalEnd& rival) {
  return "ambiguous: an end " + std::to_string(std::lround(rival.apart_mm)) +
         " mm from here reaches " + std::to_string(std::lround(100.0 * rival.share)) +
         " % of what this one explains";
}

}  // namespace

Registration::Registration(std::shared_ptr<const RegistrationProblem> of_problem,
                           const RegistrationOptions& by_method,
                           const std::shared_ptr<ThreadPool>& threads)
    : problem(std::move(of_problem)), method(by_method), diagnoser_(problem, threads) {
  check(problem != nullptr, "a registration needs a problem");
  throw_if_any(problems(method));
  throw_if_any(problems(*problem));
  throw_if_any(correction_problems(*problem, method));
  std::vector<StageOptions> all;
  for (const ChainOptions& chain : method.chains)
    all.insert(all.end(), chain.stages.begin(), chain.stages.end());
  all.insert(all.end(), method.finish.stages.begin(), method.finish.stages.end());
  const bool is_portfolio = method.chains.size() > 1;
  if (is_portfolio) all.push_back(method.judge.stage);
  stages = prepared_stages(*problem, problem->views, all, threads);
  if (is_portfolio) {
    judge = std::move(stages.back());
    stages.pop_back();
  }
  step_points_ct_ = some_points(problem->scaling_points_ct);
}

void Registration::examine_ends(const UncertaintyOptions& options,
                                const std::shared_ptr<ThreadPool>& threads) {
  uncertainty.emplace(problem, method, options, threads);
  // Within silhouettes the CT itself is the target.
  if (method.silhouette_mm() == 0.0) target_examiner.emplace(problem, threads);
  examiner.emplace(problem, method.silhouette_mm());
}

RegistrationResult Registration::search(const RigidTransform& start_room_from_ct,
                                        std::int64_t start_index) {
  const Clock::time_point begin = Clock::now();
  const MultiViewObjective& limits = stages.front().objective;
  const RigidTransform start = limits.nearest_within_limits(start_room_from_ct);
  Run run{*problem,
          method,
          stages,
          judge,
          found_,
          start_index,
          start,
          scaling_at(*problem, start, step_points_ct_),
          {}};
  RegistrationResult& result = run.result;
  result.start_room_from_ct = start_room_from_ct;
  result.room_from_ct = start_room_from_ct;
  result.similarity = std::numeric_limits<double>::quiet_NaN();
  result.clipped_along = parameter_names(limits.beyond_limits(start_room_from_ct));
  if (judge.has_value())
    run.run_portfolio();
  else
    run.run_alone();
  result.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  return std::move(run.result);
}

/// Only for an end that an agreeing target makes found, because it takes as long as a registration.
void Registration::ask_target(RegistrationRecord& record) {
  const double without_target = record.uncertainty.confidence;
  record.uncertainty.confidence = confidence_if_target_agrees(without_target);
  if (judgement_of(record).verdict == Verdict::Found)
    record.uncertainty.target = target_examiner->evidence(record.result.room_from_ct);
  if (!agrees_with_surroundings(record.uncertainty.target, record.view_values))
    record.uncertainty.confidence = without_target;
}

RegistrationRecord Registration::run(const RigidTransform& start_room_from_ct,
                                     std::int64_t start_index) {
  RegistrationRecord record;
  record.start_index = start_index;
  record.result = search(start_room_from_ct, start_index);
  if (!examiner) return record;
  record.view_values = examiner->view_values(record.result.room_from_ct, true);
  record.uncertainty = uncertainty->report(record.result, record.view_values);
  if (target_examiner) ask_target(record);
  return record;
}

void Registration::look_for_starts(const PoseSearchOptions& options,
                                   const std::shared_ptr<ThreadPool>& threads) {
  pose_search.emplace(*problem, options, method.silhouette_mm(), threads);
}

RegistrationRecord Registration::run_everywhere(std::int64_t start_index) {
  check(pose_search.has_value(), "look_for_starts() comes first");
  const Clock::time_point begin = Clock::now();
  std::vector<RegistrationRecord> records;
  for (const PoseMode& mode : pose_search->modes())
    records.push_back(run(mode.room_from_ct, start_index));
  RegistrationRecord best = records[best_record(records)];
  set_rival(*problem, records, best);
  RegistrationResult& result = best.result;
  result.evaluations = result.inadmissible = 0;
  result.drr_count = 0;
  for (const RegistrationRecord& record : records) {
    result.evaluations += record.result.evaluations;
    result.inadmissible += record.result.inadmissible;
    result.drr_count += record.result.drr_count;
  }
  best.result.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  return best;
}

ObjectiveValue Registration::similarity_at(const RigidTransform& room_from_ct) {
  return judge.has_value() ? value_of_judge(*judge, *problem, room_from_ct)
                           : stages.back().value_at(*problem, room_from_ct);
}

void Registration::diagnose(RegistrationRecord& record) {
  if (!record.view_values.empty() && record.result.evaluations > 0)
    record.diagnosis = diagnoser_.diagnosis(record.view_values);
}

Judgement judgement_of(const RegistrationRecord& record) {
  const RegistrationResult& result = record.result;
  const auto failure = failure_of(result.stop_reason);
  Judgement judgement = failure.has_value()
                            ? Judgement{Verdict::NotFound, *failure}
                            : judged_confidence(record.uncertainty, record.view_values);
  // These include whatever leaves a doubt, however high the confidence is.
  std::vector<std::string> reasons = record.diagnosis.messages;
  if (!failure.has_value())
    for (const std::string& doubt :
         doubts_of(result, record.view_values, record.uncertainty.target))
      reasons.push_back(doubt);
  if (record.rival.has_value() && record.rival->share >= kAmbiguousShare)
    reasons.push_back(ambiguity_text(*record.rival));
  if (!reasons.empty() && judgement.verdict == Verdict::Found) {
    judgement.verdict = Verdict::Doubtful;
    reasons.push_back("but for that " + judgement.reason);
  } else {
    reasons.insert(reasons.begin(), judgement.reason);
  }
  if (record.view_values.size() == 1 && judgement.verdict != Verdict::NotFound)
    reasons.push_back(depth_text(record.uncertainty.depth_95_mm));
  if (record.uncertainty.target.has_no_answer)
    reasons.emplace_back("not checked: whether the target has moved against the rest");
  if (!result.clipped_along.empty())
    reasons.push_back("the start lay outside the field's range along " + result.clipped_along +
                      " and was clipped into it");
  judgement.reason = joined(reasons, "; ");
  return judgement;
}

bool is_better(const RegistrationRecord& a, const RegistrationRecord& b) {
  const bool a_has = std::isfinite(a.result.similarity);
  const bool b_has = std::isfinite(b.result.similarity);
  if (a_has != b_has) return a_has;
  const bool a_is_found = judgement_of(a).verdict != Verdict::NotFound;
  const bool b_is_found = judgement_of(b).verdict != Verdict::NotFound;
  if (a_is_found != b_is_found) return a_is_found;
  if (a_has && a.result.similarity != b.result.similarity)
    return a.result.similarity > b.result.similarity;
  return a.start_index < b.start_index;
}

std::size_t best_record(const std::vector<RegistrationRecord>& records) {
  check(!records.empty(), "a run has at least one record");
  const auto best = std::min_element(records.begin(), records.end(), is_better);
  return static_cast<std::size_t>(best - records.begin());
}

void set_rival(const RegistrationProblem& problem,
               const std::vector<RegistrationRecord>& records,
               RegistrationRecord& record) {
  record.rival.reset();
  // What the judge's level explains is 0 where nothing fits, whatever the method's own measure is.
  const double explained = judge_summary(record.view_values).coarse.mean;
  if (!(explained > 0.0)) return;
  const RigidTransform& end = record.result.room_from_ct;
  for (const RegistrationRecord& other : records) {
    const RigidTransform& elsewhere = other.result.room_from_ct;
    const double share = judge_summary(other.view_values).coarse.mean / explained;
    if (!other.result.has_pose() || !std::isfinite(share) ||
        judgement_of(other).verdict == Verdict::NotFound ||
        !are_apart(problem, end, elsewhere, kElsewhereMm))
      continue;
    if (!record.rival.has_value() || share > record.rival->share)
      record.rival = RivalEnd{seen_distance_mm(problem, end, elsewhere), share};
  }
}

}  // namespace af::registration
