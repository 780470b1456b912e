// SPDX-License-Identifier: Apache-2.0
#include "evaluate/perturbed_starts.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/error.h"
#include "base/hash_random.h"
#include "evaluate/target_box.h"
#include "evaluate/tre.h"

namespace af::evaluation {
namespace {

// A pure rotation of magnitude m moves the target by m times its mean distance from the rotation's
// axis over its RMS distance from the centre: 0.7 to 0.8 for boxes of usual shape. So magnitudes up
// to 1.5 times the last interval's end reach that end in every direction.
constexpr double kMagnitudeOverTre = 1.5;

// Keys of the streams of random numbers, so that no two uses share one.
constexpr std::uint64_t kDrawStream = 0x73746172;  // "star"
constexpr std::uint64_t kPickStream = 0x7069636B;  // "pick"

std::uint64_t most_draws(const StartOptions& options) {
  const auto wanted = static_cast<std::uint64_t>(options.starts_per_interval) *
                      static_cast<std::uint64_t>(options.intervals);
  return std::max<std::uint64_t>(100000, 1000 * wanted);
}

std::vector<PerturbedStart> pick(std::vector<PerturbedStart> candidates,
                                 const StartOptions& options,
                                 std::uint64_t case_key) {
  const auto order = [&](const PerturbedStart& start) {
    return hash64(options.seed, kPickStream, case_key, start.draw_index);
  };
  std::sort(candidates.begin(), candidates.end(), [&](const auto& a, const auto& b) {
    return order(a) < order(b);
  });
  candidates.resize(static_cast<std::size_t>(options.starts_per_interval));
  for (std::size_t i = 0; i < candidates.size(); ++i)
    candidates[i].rank_in_interval = static_cast<int>(i);
  std::sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
    return a.draw_index < b.draw_index;
  });
  return candidates;
}

[[noreturn]] void throw_too_empty(const std::vector<std::vector<PerturbedStart>>& by_interval,
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
    const std::function<bool(const RigidTransform& room_from_ct)>& is_admissible) {
  throw_if_any(problems(options));
  const double largest_magnitude_mm =
      kMagnitudeOverTre * options.intervals * options.interval_width_mm;
  const auto wanted = static_cast<std::size_t>(options.starts_per_interval);
  const PoseFrame pose_frame = frame.pose_frame();
  std::vector<std::vector<PerturbedStart>> by_interval(static_cast<std::size_t>(options.intervals));
  StratifiedStarts result;
  std::size_t full_intervals = 0;
  while (full_intervals < by_interval.size()) {
    if (result.draws == most_draws(options)) throw_too_empty(by_interval, options, result);
    PerturbedStart start;
    start.draw_index = result.draws++;
    start.parameters =
        draw_perturbation(frame, largest_magnitude_mm, options.seed, start.draw_index);
    start.room_from_ct = pose_from_parameters(pose_frame, start.parameters);
    start.initial_tre_mm =
        mean_tre_mm(start.room_from_ct, frame.gold_room_from_ct, target_points_ct_mm);
    const double position = start.initial_tre_mm / options.interval_width_mm;
    if (!(position < options.intervals)) {
      ++result.draws_beyond;
    } else if (!is_admissible(start.room_from_ct)) {
      ++result.inadmissible_draws;
    } else {
      start.interval = static_cast<int>(position);
      std::vector<PerturbedStart>& candidates =
          by_interval[static_cast<std::size_t>(start.interval)];
      candidates.push_back(start);
      if (candidates.size() == wanted) ++full_intervals;
    }
  }
  const std::uint64_t case_key = hash_name(frame.case_name);
  for (std::vector<PerturbedStart>& candidates : by_interval)
    for (const PerturbedStart& start : pick(std::move(candidates), options, case_key))
      result.starts.push_back(start);
  return result;
}

}  // namespace af::evaluation
