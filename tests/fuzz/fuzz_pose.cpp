// SPDX-License-Identifier: Apache-2.0
// Poses in every format; the first byte picks the file's name.
#include <array>
#include <optional>

#include "fuzz/fuzz_input.h"
#include "fuzz/sample_pose_context.h"
#include "pose_files/pose_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  constexpr std::array kNames = {"pose.txt", "pose.toml", "pose.tfm", "result.json", "pose.tra"};
  fuzz::InputBytes input(data, size);
  const char* const name = kNames[input.take<std::uint8_t>() % kNames.size()];
  const auto path = fuzz::written(name, fuzz::as_text(input.rest()));
  const PoseContext context = fuzz::sample_pose_context();
  PosesInFile found;
  if (!fuzz::is_accepted([&] { found = read_pose_file(path, context); })) return 0;
  for (const PosesInFile::Numbered& pose : found.poses)
    fuzz::require(rigidity_problems(pose.room_from_ct.matrix()).empty(), "a pose is rigid");
  if (found.poses.empty()) return 0;
  const RigidTransform pose = found.poses.front().room_from_ct;
  for (const std::string& format : written_pose_formats()) {
    const auto again = fuzz::written(format == "autoscoper" ? "again.tra" : "again",
                                     pose_file_bytes(format, {&pose, 1}, context));
    std::optional<RigidTransform> read_again;
    fuzz::require(fuzz::is_accepted([&] { read_again = read_pose(again, context); }),
                  "a pose can be written and read");
    // Written with 16 characters a number, of poses within 1 km.
    constexpr double kDecimalsMm = 1e-3;
    fuzz::require((read_again->matrix() - pose.matrix()).cwiseAbs().maxCoeff() < kDecimalsMm,
                  "a pose reads back as it was written");
  }
  return 0;
}
