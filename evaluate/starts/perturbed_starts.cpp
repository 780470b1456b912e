// SPDX-License-Identifier: Apache-2.0
#include "evaluate/starts/perturbed_starts.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/joined.h"
#include "geometry/target_box.h"

namespace af::evaluation {
namespace {

// A pure rotation of magnitude m moves the target by m times its mean distance from the rotation's
// axis, divided by its RMS distance from the centre: 0.7 to 0.8 for boxes of usual shape.
// Magnitudes up to 1.5 times the last interval's end therefore reach that end in every direction.
constexpr double kMagnitudeOverTre = 1.5;

// Keys of the streams of random numbers, so that no two uses share one.
constexpr std::uint64_t kDrawStream = 0x73746172;  // "star"
constexpr std::uint64_t kPickStream = 0x7069636B;  // "pick"
constexpr std::uint64_t kTreStream = 0x74726521;   // "tre!"
constexpr std::uint64_t kBoxStream = 0x626F7821;   // "box!"

std::uint64_t most_draws(const StartOptions& options) {
  const auto wanted = static_cast<std::uint64_t>(options.starts_per_interval) *
                      static_cast<std::uint64_t>(options.intervals);
  return std::max<std::uint64_t>(100000, 1000 * wanted);
}

/// A draw that may become a start.
struct Candidate {
  std::uint64_t order = 0;  ///< random; those of low order are taken
  std::uint64_t draw_index = 0;
};

/// Calls `function` with parts of [0, count), in order.
template <typename Function>
void in_parts(std::uint64_t count, const Function& function) {
  constexpr std::uint64_t kAtOnce = 65536;
  for (std::uint64_t first = 0; first < count; first += kAtOnce)
    function(IndexRange{first, std::min(kAtOnce, count - first)});
}

/// Sets TREs and intervals of starts whose poses are set.
void measure(StartMeasures& measures, std::span<PerturbedStart> starts) {
  std::vector<RigidTransform> poses;
  in_parts(starts.size(), [&](const IndexRange& part) {
    const std::span<PerturbedStart> some = starts.subspan(part.first, part.count);
    poses.clear();
    for (const PerturbedStart& start : some) poses.push_back(start.room_from_ct);
    const std::vector<double> tres_mm = measures.tres_mm(poses);
    check(tres_mm.size() == some.size(), "there must be a TRE of every pose");
    for (std::size_t i = 0; i < some.size(); ++i) {
      some[i].initial_tre_mm = tres_mm[i];
      some[i].interval = measures.interval_of(tres_mm[i]);
    }
  });
}

/// Picks the wanted number at random, and appends them by draw index.
void pick(StartMeasures& measures,
          std::vector<Candidate> candidates,
          std::vector<PerturbedStart>& starts) {
  std::sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
    return a.order < b.order;
  });
  candidates.resize(static_cast<std::size_t>(measures.options().starts_per_interval));
  const PoseFrame pose_frame = measures.frame().pose_frame();
  const std::size_t first = starts.size();
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    PerturbedStart& start = starts.emplace_back();
    start.draw_index = candidates[i].draw_index;
    start.rank_in_interval = static_cast<int>(i);
    start.parameters = measures.stratified_draw(start.draw_index);
    start.room_from_ct = pose_from_parameters(pose_frame, start.parameters);
  }
  const std::span<PerturbedStart> picked = std::span(starts).subspan(first);
  measure(measures, picked);
  std::sort(picked.begin(), picked.end(), [](const auto& a, const auto& b) {
    return a.draw_index < b.draw_index;
  });
}

/// Sets the mean share of rotation of the starts of every interval.
void add_rotation_shares(const StartMeasures& measures, StratifiedStarts& result) {
  const StartFrame& frame = measures.frame();
  const double radius_mm = rms_radius_mm(frame.target_box_ct, frame.center_ct_mm);
  const auto intervals = static_cast<std::size_t>(measures.options().intervals);
  std::vector<double> sums(intervals);
  std::vector<double> counts(intervals);
  for (const PerturbedStart& start : result.starts) {
    const double share = rotation_share(start.parameters, radius_mm);
    const auto interval = static_cast<std::size_t>(start.interval);
    if (interval >= intervals || std::isnan(share)) continue;
    sums[interval] += share;
    counts[interval] += 1.0;
  }
  result.rotation_share_per_interval.clear();
  for (std::size_t k = 0; k < intervals; ++k)
    result.rotation_share_per_interval.push_back(sums[k] / counts[k]);
}

[[noreturn]] void throw_too_empty(const std::vector<std::vector<Candidate>>& by_interval,
                                  const StartOptions& options,
                                  const StratifiedStarts& counts) {
  const std::string found = joined(
      by_interval, ", ", [](const auto& candidates) { return std::to_string(candidates.size()); });
  throw InputError("starts_per_interval",
                   std::to_string(options.starts_per_interval),
                   "not reached in every interval after " + std::to_string(counts.draws) +
                       " draws (found " + found + "; " + std::to_string(counts.inadmissible_draws) +
                       " draws outside the motion range): use fewer intervals or fields of a "
                       "larger range");
}

}  // namespace

std::vector<std::string> problems(const StartOptions& options) {
  std::vector<std::string> found;
  if (options.intervals < 1 || options.intervals > 1000)
    found.push_back("intervals = " + std::to_string(options.intervals) +
                    ": must be from 1 to 1000");
  if (!(options.interval_width_mm > 0.0) || !std::isfinite(options.interval_width_mm))
    found.push_back("interval_width_mm = " + std::to_string(options.interval_width_mm) +
                    ": must be positive");
  if (options.starts_per_interval < 1 || options.starts_per_interval > 1000000)
    found.push_back("starts_per_interval = " + std::to_string(options.starts_per_interval) +
                    ": must be from 1 to 1000000");
  return found;
}

double rotation_share(const PoseParameters& parameters, double rms_radius_mm) {
  const double rotation_mm2 = parameters.rotation_rad.squaredNorm() * rms_radius_mm * rms_radius_mm;
  return rotation_mm2 / (rotation_mm2 + parameters.translation_mm.squaredNorm());
}

PoseParameters draw_perturbation(const StartFrame& frame,
                                 double largest_magnitude_mm,
                                 std::uint64_t seed,
                                 std::uint64_t index) {
  HashRandom random(seed, hash64(kDrawStream, hash_name(frame.case_name)), index);
  Eigen::Matrix<double, 6, 1> direction;
  for (int i = 0; i < 6; ++i) direction[i] = random.normal();
  direction.normalize();
  const double magnitude_mm = random.uniform(0.0, largest_magnitude_mm);
  const double radius_mm = rms_radius_mm(frame.target_box_ct, frame.center_ct_mm);
  PoseParameters parameters;
  parameters.rotation_rad = direction.head<3>() * (magnitude_mm / radius_mm);
  parameters.translation_mm = direction.tail<3>() * magnitude_mm;
  return parameters;
}

StartMeasures::StartMeasures(StartFrame frame,
                             const StartOptions& options,
                             std::span<const Eigen::Vector3d> target_points_ct_mm,
                             IsAdmissible is_admissible,
                             std::optional<StartLimit> limit)
    : frame_(std::move(frame)),
      options_(options),
      points_ct_mm_(target_points_ct_mm),
      is_admissible_(std::move(is_admissible)),
      limit_(std::move(limit)) {
  throw_if_any(problems(options));
}

int StartMeasures::interval_of(double initial_tre_mm) const {
  constexpr double kFarthestInterval = 1e9;
  return static_cast<int>(std::min(initial_tre_mm / options_.interval_width_mm, kFarthestInterval));
}

PoseParameters StartMeasures::stratified_draw(std::uint64_t draw_index) const {
  return draw_perturbation(frame_,
                           kMagnitudeOverTre * options_.intervals * options_.interval_width_mm,
                           options_.seed,
                           draw_index);
}

/// Most draws need no mean over all points, because bounds of their TRE suffice.
int StartMeasures::interval_of_draw(const RigidTransform& room_from_ct) const {
  for (const TreBounder& bounder : bounders_) {
    const TreBounds bounds = bounder.bounds(room_from_ct, frame_.gold_room_from_ct);
    const int lowest = interval_of(bounds.low_mm);
    if (lowest >= options_.intervals || lowest == interval_of(bounds.high_mm)) return lowest;
  }
  return interval_of(mean_tre_mm(room_from_ct, frame_.gold_room_from_ct, points_ct_mm_));
}

std::vector<DrawVerdict> StartMeasures::judge_draws(IndexRange draws) {
  constexpr int kCoarseCells = 4;
  constexpr int kFineCells = 12;
  if (bounders_.empty())
    for (const int cells : {kCoarseCells, kFineCells}) bounders_.emplace_back(points_ct_mm_, cells);
  const PoseFrame pose_frame = frame_.pose_frame();
  std::vector<DrawVerdict> verdicts(draws.count);
  for (std::uint64_t i = 0; i < draws.count; ++i) {
    const RigidTransform pose = pose_from_parameters(pose_frame, stratified_draw(draws.first + i));
    DrawVerdict& verdict = verdicts[i];
    verdict.interval = interval_of_draw(pose);
    verdict.is_admissible = verdict.interval >= options_.intervals || is_admissible_(pose);
  }
  return verdicts;
}

std::vector<double> StartMeasures::tres_mm(std::span<const RigidTransform> room_from_ct) {
  std::vector<double> tres_mm;
  tres_mm.reserve(room_from_ct.size());
  for (const RigidTransform& pose : room_from_ct)
    tres_mm.push_back(mean_tre_mm(pose, frame_.gold_room_from_ct, points_ct_mm_));
  return tres_mm;
}

/// Scales the parameters until the initial TRE is `tre_mm`, and returns what it is then. TRE is a
/// mean of distances that grow with the scale almost in proportion, so each step gains some digits.
double StartMeasures::scale_to_tre(double tre_mm, PoseParameters& parameters) const {
  constexpr double kToleranceMm = 1e-9;
  constexpr int kMostSteps = 50;
  const PoseFrame pose_frame = frame_.pose_frame();
  double found_mm = 0.0;
  for (int step = 0; step < kMostSteps; ++step) {
    found_mm = mean_tre_mm(
        pose_from_parameters(pose_frame, parameters), frame_.gold_room_from_ct, points_ct_mm_);
    if (std::abs(found_mm - tre_mm) < kToleranceMm) break;
    const double factor = tre_mm / found_mm;
    parameters.rotation_rad *= factor;
    parameters.translation_mm *= factor;
  }
  return found_mm;
}

UniformStart StartMeasures::draw_uniform(std::uint64_t index) const {
  HashRandom random(options_.seed, hash64(kTreStream, hash_name(frame_.case_name)), index);
  const double tre_mm = random.uniform(0.0, largest_tre_mm());
  const PoseFrame pose_frame = frame_.pose_frame();
  UniformStart start;
  for (; start.refused < UniformStart::kMostDraws; ++start.refused) {
    start.parameters = draw_perturbation(
        frame_, largest_tre_mm(), options_.seed, index * UniformStart::kMostDraws + start.refused);
    start.initial_tre_mm = scale_to_tre(tre_mm, start.parameters);
    if (is_admissible_(pose_from_parameters(pose_frame, start.parameters))) break;
  }
  return start;
}

std::vector<UniformStart> StartMeasures::draw_uniform(IndexRange starts) {
  std::vector<UniformStart> drawn(starts.count);
  for (std::uint64_t i = 0; i < starts.count; ++i) {
    drawn[i] = draw_uniform(starts.first + i);
    if (drawn[i].is_exhausted()) break;
  }
  return drawn;
}

double StartMeasures::tre_mm(const RigidTransform& room_from_ct) const {
  return mean_tre_mm(room_from_ct, frame_.gold_room_from_ct, points_ct_mm_);
}

/// The pose with the wanted TRE along a direction, brought back into the motion range.
RigidTransform StartMeasures::pose_within_range(const PoseParameters& direction,
                                                double size_mm) const {
  // A search that starts at the wall could not try poses on both sides of its start.
  constexpr double kShareOfRange = 0.98;
  // Beyond this, a rotation no longer has the intended angles about the axes.
  constexpr double kFarthestTurnRad = 1.4;
  const double radius_mm = rms_radius_mm(frame_.target_box_ct, frame_.center_ct_mm);
  PoseParameters wanted;
  wanted.rotation_rad = direction.rotation_rad * std::min(size_mm / radius_mm, kFarthestTurnRad);
  wanted.translation_mm = direction.translation_mm * size_mm;
  const PoseParameters parameters =
      parameters_from_pose(limit_->frame, pose_from_parameters(frame_.pose_frame(), wanted));
  return pose_from_parameters(limit_->frame, limit_->range.clamped(parameters, kShareOfRange));
}

UniformStart StartMeasures::draw_within_range(std::uint64_t index) const {
  HashRandom random(options_.seed, hash64(kBoxStream, hash_name(frame_.case_name)), index);
  const auto interval = index / static_cast<std::uint64_t>(options_.starts_per_interval);
  const double wanted_mm =
      (static_cast<double>(interval) + random.uniform()) * options_.interval_width_mm;
  // Where the range restricts even the rotations, translations of this size reach every TRE.
  const double largest_mm = 4.0 * wanted_mm;
  UniformStart start;
  start.initial_tre_mm = wanted_mm;
  for (; start.refused < UniformStart::kMostDraws; ++start.refused) {
    Eigen::Matrix<double, 6, 1> normals;
    for (int i = 0; i < 6; ++i) normals[i] = random.normal();
    normals.normalize();
    const PoseParameters direction{normals.head<3>(), normals.tail<3>()};
    if (tre_mm(pose_within_range(direction, largest_mm)) < wanted_mm) continue;
    // TRE is continuous along the way, which begins at or near gold. Halving therefore finds a
    // place of the wanted TRE, to 60 bits.
    double below = 0.0;
    double above = largest_mm;
    constexpr int kHalvings = 60;
    for (int step = 0; step < kHalvings; ++step) {
      const double middle = 0.5 * (below + above);
      (tre_mm(pose_within_range(direction, middle)) < wanted_mm ? below : above) = middle;
    }
    const RigidTransform pose = pose_within_range(direction, below);
    const double found_mm = tre_mm(pose);
    // Near a gold pose beside the wall, no way is continuous.
    constexpr double kToleranceMm = 1e-6;
    if (std::abs(found_mm - wanted_mm) > kToleranceMm || !is_admissible_(pose)) continue;
    start.parameters = parameters_from_pose(frame_.pose_frame(), pose);
    start.initial_tre_mm = found_mm;
    break;
  }
  return start;
}

std::vector<UniformStart> StartMeasures::draw_within_range(IndexRange starts) {
  check(limit_.has_value(), "starts within a range need one");
  std::vector<UniformStart> drawn(starts.count);
  for (std::uint64_t i = 0; i < starts.count; ++i) {
    drawn[i] = draw_within_range(starts.first + i);
    if (drawn[i].is_exhausted()) break;
  }
  return drawn;
}

StratifiedStarts stratified_starts(StartMeasures& measures) {
  const StartOptions& options = measures.options();
  const std::uint64_t case_key = hash_name(measures.frame().case_name);
  const auto wanted = static_cast<std::size_t>(options.starts_per_interval);
  std::vector<std::vector<Candidate>> by_interval(static_cast<std::size_t>(options.intervals));
  StratifiedStarts result;
  result.inadmissible_per_interval.resize(by_interval.size());
  result.draws_per_interval.resize(by_interval.size());
  std::size_t full_intervals = 0;
  std::vector<DrawVerdict> verdicts;
  std::size_t judged = 0;
  while (full_intervals < by_interval.size()) {
    if (result.draws == most_draws(options)) throw_too_empty(by_interval, options, result);
    if (judged == verdicts.size()) {
      // Only a few more than needed are drawn. The last of them may be judged in vain.
      const std::uint64_t needed =
          std::max<std::uint64_t>(by_interval.size() * wanted, result.draws);
      verdicts =
          measures.judge_draws({result.draws, std::clamp<std::uint64_t>(needed / 8, 8, 65536)});
      judged = 0;
    }
    const DrawVerdict& verdict = verdicts[judged++];
    const std::uint64_t draw_index = result.draws++;
    const auto interval = static_cast<std::size_t>(verdict.interval);
    if (interval < by_interval.size()) ++result.draws_per_interval[interval];
    if (interval >= by_interval.size()) {
      ++result.draws_beyond;
    } else if (!verdict.is_admissible) {
      ++result.inadmissible_draws;
      ++result.inadmissible_per_interval[interval];
    } else {
      by_interval[interval].push_back(
          {hash64(options.seed, kPickStream, case_key, draw_index), draw_index});
      if (by_interval[interval].size() == wanted) ++full_intervals;
    }
  }
  std::vector<PerturbedStart> starts;
  starts.reserve(by_interval.size() * wanted);
  for (std::vector<Candidate>& candidates : by_interval)
    pick(measures, std::move(candidates), starts);
  result.starts = SharedArray<PerturbedStart>(std::move(starts));
  add_rotation_shares(measures, result);
  return result;
}

namespace {

/// Draws starts one by one, each until it is admissible.
StratifiedStarts starts_one_by_one(
    StartMeasures& measures,
    const std::string& refusal,
    const std::function<std::vector<UniformStart>(const IndexRange&)>& draw) {
  const StartOptions& options = measures.options();
  const PoseFrame pose_frame = measures.frame().pose_frame();
  const auto count = static_cast<std::uint64_t>(options.intervals) *
                     static_cast<std::uint64_t>(options.starts_per_interval);
  StratifiedStarts result;
  result.inadmissible_per_interval.resize(static_cast<std::size_t>(options.intervals));
  result.draws_per_interval = result.inadmissible_per_interval;
  std::vector<int> found(static_cast<std::size_t>(options.intervals));
  std::vector<PerturbedStart> starts;
  starts.reserve(count);
  const auto add = [&](const UniformStart& drawn, std::uint64_t index) {
    if (drawn.is_exhausted())
      throw InputError("starts", std::to_string(drawn.initial_tre_mm) + " mm", refusal);
    PerturbedStart& start = starts.emplace_back();
    start.draw_index = index * UniformStart::kMostDraws + drawn.refused;
    start.parameters = drawn.parameters;
    start.room_from_ct = pose_from_parameters(pose_frame, drawn.parameters);
    start.initial_tre_mm = drawn.initial_tre_mm;
    start.interval = std::min(measures.interval_of(drawn.initial_tre_mm), options.intervals - 1);
    const auto interval = static_cast<std::size_t>(start.interval);
    start.rank_in_interval = found[interval]++;
    result.draws += drawn.refused + 1;
    result.draws_per_interval[interval] += drawn.refused + 1;
    result.inadmissible_draws += drawn.refused;
    result.inadmissible_per_interval[interval] += drawn.refused;
  };
  in_parts(count, [&](const IndexRange& part) {
    const std::vector<UniformStart> drawn = draw(part);
    for (std::uint64_t i = 0; i < part.count; ++i) add(drawn[i], part.first + i);
  });
  result.starts = SharedArray<PerturbedStart>(std::move(starts));
  add_rotation_shares(measures, result);
  return result;
}

}  // namespace

StratifiedStarts uniform_starts(StartMeasures& measures) {
  return starts_one_by_one(
      measures,
      "every one of 1000 draws of this initial TRE lies outside the motion range: use fewer "
      "intervals or fields of a larger range",
      [&](const IndexRange& part) { return measures.draw_uniform(part); });
}

StratifiedStarts starts_within_range(StartMeasures& measures, const std::string& field) {
  if (!measures.limit().has_value())
    throw InputError(field, "within-range", "needs fields: ray casting alone has no motion range");
  const StartLimit& limit = *measures.limit();
  if (!limit.range.contains(parameters_from_pose(limit.frame, measures.frame().gold_room_from_ct)))
    throw InputError(field,
                     "within-range",
                     "the gold pose itself lies outside the fields' motion range",
                     measures.frame().case_name);
  return starts_one_by_one(
      measures,
      "in none of 1000 directions does the fields' motion range reach so far: use fewer intervals "
      "or "
      "fields of a larger range",
      [&](const IndexRange& part) { return measures.draw_within_range(part); });
}

StratifiedStarts starts_at(StartMeasures& measures, std::span<const RigidTransform> poses) {
  const PoseFrame pose_frame = measures.frame().pose_frame();
  StratifiedStarts result;
  std::vector<PerturbedStart> starts;
  starts.reserve(poses.size());
  for (const RigidTransform& pose : poses) {
    PerturbedStart& start = starts.emplace_back();
    start.draw_index = result.draws++;
    start.parameters = parameters_from_pose(pose_frame, pose);
    start.room_from_ct = pose;
  }
  measure(measures, starts);
  std::map<int, int> found;
  for (PerturbedStart& start : starts) {
    start.rank_in_interval = found[start.interval]++;
    if (start.interval >= measures.options().intervals) ++result.draws_beyond;
  }
  result.starts = SharedArray<PerturbedStart>(std::move(starts));
  add_rotation_shares(measures, result);
  return result;
}

}  // namespace af::evaluation
