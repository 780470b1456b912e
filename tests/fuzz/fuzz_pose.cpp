// SPDX-License-Identifier: Apache-2.0
// A pose as JSON, TOML, ITK transform or plain numbers; the first byte picks the file's name.
#include <array>
#include <optional>

#include "fuzz/fuzz_input.h"
#include "study/pose_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  constexpr std::array kNames = {"pose.txt", "pose.toml", "pose.tfm", "result.json"};
  fuzz::InputBytes input(data, size);
  const char* const name = kNames[input.take<std::uint8_t>() % kNames.size()];
  const auto path = fuzz::written(name, fuzz::as_text(input.rest()));
  std::optional<RigidTransform> pose;
  if (!fuzz::is_accepted([&] { pose = read_pose(path); })) return 0;
  fuzz::require(rigidity_problems(pose->matrix()).empty(), "a pose is rigid");
  for (const char* text_name : {"again.toml", "again.tfm"}) {
    const bool is_toml = std::string_view(text_name).ends_with("toml");
    const auto again =
        fuzz::written(text_name, is_toml ? pose_to_toml(*pose) : pose_to_itk_transform(*pose));
    fuzz::require(fuzz::is_accepted([&] { read_pose(again); }), "a pose can be written and read");
  }
  return 0;
}
