// SPDX-License-Identifier: Apache-2.0
#include "evaluate/perturbed_starts.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>

#include "base/error.h"
#include "base/hash_random.h"
#include "gold/target_box.h"
#include "gold/tre.h"

namespace af::evaluation {
namespace {

// A pure rotation of magnitude m moves the target by m times its mean distance from the rotation's
// axis over its RMS distance from the centre: 0.7 to 0.8 for boxes of usual shape. So magnitudes up
// to 1.5 times the last interval's end reach that end in every direction.
constexpr double kMagnitudeOverTre = 1.5;

// Keys of the streams of random numbers, so that no two uses share one.
constexpr std::uint64_t kDrawStream = 0x73746172;  // "star"
constexpr std::uint64_t kPickStream = 0x7069636B;  // "pick"
constexpr std::uint64_t kTreStream = 0x74726521;   // "tre!"

std::uint64_t most_draws(const StartOptions& options) {
  const auto wanted = static_cast<std::uint64_t>(options.starts_per_interval) *
                      static_cast<std::uint64_t>(options.intervals);
  return std::max<std::uint64_t>(100000, 1000 * wanted);
}

/// A draw that may become a start.
struct Candidate {
  std::uint64_t order = 0;  ///< random: those of low order are taken
  std::uint64_t draw_index = 0;
};

int interval_of(double initial_tre_mm, const StartOptions& options) {
  constexpr double kFarthestInterval = 1e9;
  return static_cast<int>(std::min(initial_tre_mm / options.interval_width_mm, kFarthestInterval));
}

/// TRE and interval of a start whose pose is set.
void measure(const StartFrame& frame,
             const StartOptions& options,
             std::span<const Eigen::Vector3d> target_points_ct_mm,
             PerturbedStart& start) {
  start.initial_tre_mm =
      mean_tre_mm(start.room_from_ct, frame.gold_room_from_ct, target_points_ct_mm);
  start.interval = interval_of(start.initial_tre_mm, options);
}

/// The same of many, by `measure_tres` when that is given.
void measure(const StartFrame& frame,
             const StartOptions& options,
             std::span<const Eigen::Vector3d> target_points_ct_mm,
             const MeasureTres& measure_tres,
             std::span<PerturbedStart> starts) {
  constexpr std::size_t kAtOnce = 65536;
  std::vector<RigidTransform> poses;
  for (; !starts.empty(); starts = starts.subspan(std::min(kAtOnce, starts.size()))) {
    const std::span<PerturbedStart> some = starts.first(std::min(kAtOnce, starts.size()));
    if (!measure_tres) {
      for (PerturbedStart& start : some) measure(frame, options, target_points_ct_mm, start);
      continue;
    }
    poses.clear();
    for (const PerturbedStart& start : some) poses.push_back(start.room_from_ct);
    const std::vector<double> tres_mm = measure_tres(poses);
    check(tres_mm.size() == some.size(), "there must be a TRE of every pose");
    for (std::size_t i = 0; i < some.size(); ++i) {
      some[i].initial_tre_mm = tres_mm[i];
      some[i].interval = interval_of(tres_mm[i], options);
    }
  }
}

/// The same of one whose parameters are set.
void locate(const StartFrame& frame,
            const StartOptions& options,
            std::span<const Eigen::Vector3d> target_points_ct_mm,
            PerturbedStart& start) {
  start.room_from_ct = pose_from_parameters(frame.pose_frame(), start.parameters);
  measure(frame, options, target_points_ct_mm, start);
}

/// Scales the parameters until the initial TRE is `tre_mm`. TRE is a mean of distances that grow
/// with the scale almost in proportion, so each step gains some digits.
void scale_to_tre(const StartFrame& frame,
                  const StartOptions& options,
                  std::span<const Eigen::Vector3d> target_points_ct_mm,
                  double tre_mm,
                  PerturbedStart& start) {
  constexpr double kToleranceMm = 1e-9;
  constexpr int kMostSteps = 50;
  for (int step = 0; step < kMostSteps; ++step) {
    locate(frame, options, target_points_ct_mm, start);
    if (std::abs(start.initial_tre_mm - tre_mm) < kToleranceMm) return;
    const double factor = tre_mm / start.initial_tre_mm;
    start.parameters.rotation_rad *= factor;
    start.parameters.translation_mm *= factor;
  }
}

/// Draws of one case by stratified_starts().
class Stratification {
 public:
  Stratification(const StartFrame& frame,
                 const StartOptions& options,
                 std::span<const Eigen::Vector3d> target_points_ct_mm,
                 const MeasureTres& measure_tres)
      : frame_(frame),
        options_(options),
        points_(target_points_ct_mm),
        measure_tres_(measure_tres),
        coarse_(target_points_ct_mm),
        fine_(target_points_ct_mm, kFineCells),
        largest_magnitude_mm_(kMagnitudeOverTre * options.intervals * options.interval_width_mm) {}

  /// The interval of a draw. Most need no mean over all points: bounds of the TRE suffice.
  [[nodiscard]] int interval_of_draw(PerturbedStart& start) const {
    place(start);
    for (const TreBounder* bounder : {&coarse_, &fine_}) {
      const TreBounds bounds = bounder->bounds(start.room_from_ct, frame_.gold_room_from_ct);
      const int lowest = interval_of(bounds.low_mm, options_);
      if (lowest >= options_.intervals || lowest == interval_of(bounds.high_mm, options_))
        return lowest;
    }
    measure(frame_, options_, points_, start);
    return start.interval;
  }

  /// Picks as many as wanted at random and appends them by draw index.
  void pick(std::vector<Candidate> candidates, std::vector<PerturbedStart>& starts) const {
    std::sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
      return a.order < b.order;
    });
    candidates.resize(static_cast<std::size_t>(options_.starts_per_interval));
    const std::size_t first = starts.size();
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      PerturbedStart& start = starts.emplace_back();
      start.draw_index = candidates[i].draw_index;
      start.rank_in_interval = static_cast<int>(i);
      place(start);
    }
    const std::span<PerturbedStart> picked = std::span(starts).subspan(first);
    measure(frame_, options_, points_, measure_tres_, picked);
    std::sort(picked.begin(), picked.end(), [](const auto& a, const auto& b) {
      return a.draw_index < b.draw_index;
    });
  }

 private:
  /// Parameters and pose of a start whose draw index is set.
  void place(PerturbedStart& start) const {
    start.parameters =
        draw_perturbation(frame_, largest_magnitude_mm_, options_.seed, start.draw_index);
    start.room_from_ct = pose_from_parameters(frame_.pose_frame(), start.parameters);
  }

  const StartFrame& frame_;
  const StartOptions& options_;
  std::span<const Eigen::Vector3d> points_;
  const MeasureTres& measure_tres_;
  static constexpr int kFineCells = 12;
  TreBounder coarse_;
  TreBounder fine_;
  double largest_magnitude_mm_;
};

[[noreturn]] void throw_too_empty(const std::vector<std::vector<Candidate>>& by_interval,
                                  const StartOptions& options,
                                  const StratifiedStarts& counts) {
  std::string found;
  for (const auto& candidates : by_interval)
    found += (found.empty() ? "" : ", ") + std::to_string(candidates.size());
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

StratifiedStarts stratified_starts(
    const StartFrame& frame,
    const StartOptions& options,
    std::span<const Eigen::Vector3d> target_points_ct_mm,
    const std::function<bool(const RigidTransform& room_from_ct)>& is_admissible,
    const MeasureTres& measure_tres) {
  throw_if_any(problems(options));
  const Stratification stratification(frame, options, target_points_ct_mm, measure_tres);
  const std::uint64_t case_key = hash_name(frame.case_name);
  const auto wanted = static_cast<std::size_t>(options.starts_per_interval);
  std::vector<std::vector<Candidate>> by_interval(static_cast<std::size_t>(options.intervals));
  StratifiedStarts result;
  result.inadmissible_per_interval.resize(by_interval.size());
  std::size_t full_intervals = 0;
  while (full_intervals < by_interval.size()) {
    if (result.draws == most_draws(options)) throw_too_empty(by_interval, options, result);
    PerturbedStart start;
    start.draw_index = result.draws++;
    const auto interval = static_cast<std::size_t>(stratification.interval_of_draw(start));
    if (interval >= by_interval.size()) {
      ++result.draws_beyond;
    } else if (!is_admissible(start.room_from_ct)) {
      ++result.inadmissible_draws;
      ++result.inadmissible_per_interval[interval];
    } else {
      by_interval[interval].push_back(
          {hash64(options.seed, kPickStream, case_key, start.draw_index), start.draw_index});
      if (by_interval[interval].size() == wanted) ++full_intervals;
    }
  }
  std::vector<PerturbedStart> starts;
  starts.reserve(by_interval.size() * wanted);
  for (std::vector<Candidate>& candidates : by_interval)
    stratification.pick(std::move(candidates), starts);
  result.starts = SharedArray<PerturbedStart>(std::move(starts));
  return result;
}

StratifiedStarts uniform_starts(
    const StartFrame& frame,
    const StartOptions& options,
    std::span<const Eigen::Vector3d> target_points_ct_mm,
    const std::function<bool(const RigidTransform& room_from_ct)>& is_admissible) {
  throw_if_any(problems(options));
  constexpr std::uint64_t kMostAttempts = 1000;
  const auto count = static_cast<std::uint64_t>(options.intervals) *
                     static_cast<std::uint64_t>(options.starts_per_interval);
  const double largest_tre_mm = options.intervals * options.interval_width_mm;
  StratifiedStarts result;
  result.inadmissible_per_interval.resize(static_cast<std::size_t>(options.intervals));
  std::vector<int> found(static_cast<std::size_t>(options.intervals));
  std::vector<PerturbedStart> starts;
  starts.reserve(count);
  for (std::uint64_t index = 0; index < count; ++index) {
    HashRandom random(options.seed, hash64(kTreStream, hash_name(frame.case_name)), index);
    const double tre_mm = random.uniform(0.0, largest_tre_mm);
    PerturbedStart start;
    for (std::uint64_t attempt = 0;; ++attempt) {
      if (attempt == kMostAttempts)
        throw InputError("starts",
                         std::to_string(tre_mm) + " mm",
                         "every one of 1000 draws of this initial TRE lies outside the motion "
                         "range: use fewer intervals or fields of a larger range");
      start.draw_index = index * kMostAttempts + attempt;
      start.parameters = draw_perturbation(frame, largest_tre_mm, options.seed, start.draw_index);
      scale_to_tre(frame, options, target_points_ct_mm, tre_mm, start);
      start.interval = std::min(start.interval, options.intervals - 1);
      ++result.draws;
      if (is_admissible(start.room_from_ct)) break;
      ++result.inadmissible_draws;
      ++result.inadmissible_per_interval[static_cast<std::size_t>(start.interval)];
    }
    start.rank_in_interval = found[static_cast<std::size_t>(start.interval)]++;
    starts.push_back(start);
  }
  result.starts = SharedArray<PerturbedStart>(std::move(starts));
  return result;
}

StratifiedStarts starts_at(const StartFrame& frame,
                           const StartOptions& options,
                           std::span<const Eigen::Vector3d> target_points_ct_mm,
                           std::span<const RigidTransform> poses,
                           const MeasureTres& measure_tres) {
  StratifiedStarts result;
  std::vector<PerturbedStart> starts;
  starts.reserve(poses.size());
  for (const RigidTransform& pose : poses) {
    PerturbedStart& start = starts.emplace_back();
    start.draw_index = result.draws++;
    start.parameters = parameters_from_pose(frame.pose_frame(), pose);
    start.room_from_ct = pose;
  }
  measure(frame, options, target_points_ct_mm, measure_tres, starts);
  std::map<int, int> found;
  for (PerturbedStart& start : starts) {
    start.rank_in_interval = found[start.interval]++;
    if (start.interval >= options.intervals) ++result.draws_beyond;
  }
  result.starts = SharedArray<PerturbedStart>(std::move(starts));
  return result;
}

}  // namespace af::evaluation
