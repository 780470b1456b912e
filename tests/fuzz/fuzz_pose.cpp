// SPDX-License-Identifier: Apache-2.0
// Poses in every format; the first byte picks the file's name.
#include <array>
#include <optional>

#include "fuzz/fuzz_input.h"
#include "study/pose_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  constexpr std::array kNames = {"pose.csv", "pose.toml", "pose.tfm", "result.json"};
  fuzz::InputBytes input(data, size);
  const char* const name = kNames[input.take<std::uint8_t>() % kNames.size()];
  const auto path = fuzz::written(name, fuzz::as_text(input.rest()));
  PosesInFile found;
  if (!fuzz::is_accepted([&] { found = read_pose_file(path, {PoseFrame(), {}}); })) return 0;
  for (const PosesInFile::Numbered& pose : found.poses)
    fuzz::require(rigidity_problems(pose.room_from_ct.matrix()).empty(), "a pose is rigid");
  if (found.poses.empty()) return 0;
  const RigidTransform pose = found.poses.front().room_from_ct;
  for (const std::string& text : {pose_to_toml(pose), pose_to_itk_transform(pose)}) {
    std::optional<RigidTransform> again;
    fuzz::require(fuzz::is_accepted([&] { again = read_pose(fuzz::written("again", text)); }),
                  "a pose can be written and read");
    // The rounding of poses within 1 km that are inverted twice.
    constexpr double kRoundingMm = 1e-3;
    fuzz::require((again->matrix() - pose.matrix()).cwiseAbs().maxCoeff() < kRoundingMm,
                  "a pose reads back as it was written");
  }
  return 0;
}
