// SPDX-License-Identifier: Apache-2.0
#include "evaluate/image_quality/drr_comparison.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <string>

#include "base/error.h"
#include "base/hash_random.h"
#include "geometry/motion_range.h"

namespace af::evaluation {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint64_t kPoseStream = 0x706F7365;  // "pose"
constexpr std::uint64_t kMostDraws = 1000;

void add_differences(const Image2d& tested, const Image2d& reference, DrrComparison& comparison) {
  double sum = 0.0;
  double largest = 0.0;
  std::size_t foreground = 0;
  for (std::size_t i = 0; i < tested.pixels.size(); ++i) {
    if (reference.pixels[i] == 0.0f) continue;
    const double difference =
        static_cast<double>(tested.pixels[i]) - static_cast<double>(reference.pixels[i]);
    sum += difference;
    largest = std::max(largest, std::abs(difference));
    ++foreground;
  }
  comparison.mean_difference = sum / static_cast<double>(foreground);
  comparison.largest_difference = largest;
}

}  // namespace

PoseParameters random_pose_in_range(const MotionRange& range,
                                    std::uint64_t seed,
                                    std::uint64_t index,
                                    std::uint64_t attempt) {
  HashRandom random(seed, hash64(kPoseStream, index), attempt);
  return random_pose(range, random);
}

DrrComparer::DrrComparer(const DrrRenderer& tested, const DrrRenderer& reference, const View& view)
    : tested_(tested),
      reference_(reference),
      view_(view),
      tested_workspace_(tested.make_workspace()),
      reference_workspace_(reference.make_workspace()),
      tested_image_(view.roi.width, view.roi.height),
      reference_image_(view.roi.width, view.roi.height) {}

DrrComparison DrrComparer::at_pose(const PoseFrame& frame, const PoseParameters& parameters) {
  DrrComparison comparison;
  comparison.parameters = parameters;
  const RigidTransform room_from_ct = pose_from_parameters(frame, parameters);
  const Clock::time_point start = Clock::now();
  reference_.render(room_from_ct, view_, *reference_workspace_, reference_image_.pixels);
  const Clock::time_point between = Clock::now();
  comparison.rays_outside =
      tested_.render(room_from_ct, view_, *tested_workspace_, tested_image_.pixels).rays_outside;
  comparison.reference_seconds = std::chrono::duration<double>(between - start).count();
  comparison.tested_seconds = std::chrono::duration<double>(Clock::now() - between).count();
  const auto foreground = std::count_if(reference_image_.pixels.begin(),
                                        reference_image_.pixels.end(),
                                        [](float value) { return value != 0.0f; });
  comparison.foreground_fraction =
      static_cast<double>(foreground) / static_cast<double>(view_.pixel_count());
  if (comparison.rays_outside > 0) return comparison;
  const std::optional<Psnr> quality = psnr(tested_image_.pixels, reference_image_.pixels);
  if (!quality.has_value()) return comparison;
  comparison.psnr_db = quality->psnr_db;
  comparison.rms_difference = quality->rms_difference;
  comparison.reference_maximum = quality->reference_maximum;
  add_differences(tested_image_, reference_image_, comparison);
  return comparison;
}

DrrComparison DrrComparer::at_random_pose(const PoseFrame& frame,
                                          const MotionRange& range,
                                          std::uint64_t seed,
                                          std::uint64_t index) {
  for (std::uint64_t attempt = 0; attempt < kMostDraws; ++attempt) {
    const PoseParameters parameters = random_pose_in_range(range, seed, index, attempt);
    DrrComparison comparison = at_pose(frame, parameters);
    if (comparison.foreground_fraction < kLeastForegroundFraction) continue;
    if (comparison.rays_outside > 0)
      throw NumericError("random pose " + std::to_string(index) + " lies in the motion box, but " +
                         std::to_string(comparison.rays_outside) + " rays miss the field");
    comparison.redrawn = static_cast<int>(attempt);
    return comparison;
  }
  throw NumericError("random pose " + std::to_string(index) + ": in " + std::to_string(kMostDraws) +
                     " draws none had 1 % foreground; does the CT lie in the camera's view?");
}

}  // namespace af::evaluation
