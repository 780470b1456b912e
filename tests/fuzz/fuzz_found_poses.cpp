// SPDX-License-Identifier: Apache-2.0
// Poses by which registrations are judged, or at which they begin: a folder of files with one pose
// each, and each of these files as a file of starts.
#include <array>
#include <string>
#include <vector>

#include "evaluate/registration/start_tables.h"
#include "fuzz/fuzz_input.h"

namespace {

namespace fs = std::filesystem;

constexpr std::array kNames = {"0.tfm",
                               "skull-01-1.json",
                               "skull-01-0.toml",
                               "2.txt",
                               "skull-01-00.tra",
                               "3.dcm",
                               "4.h5",
                               "skull-02-99999999999999999999.txt",
                               "no-number.tfm",
                               "-5.toml"};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  constexpr int kMostFiles = 3;
  fuzz::InputBytes input(data, size);
  const fs::path folder = fuzz::scratch_folder() / "found";
  fs::remove_all(folder);
  fs::create_directories(folder);
  evaluation::PoseTableFrames frames;
  frames.case_name = "skull-01";
  frames.context.frame = PoseFrame();
  frames.is_only_case = input.take<std::uint8_t>() % 2 == 0;
  std::vector<fs::path> files;
  for (int i = 0; i < kMostFiles && !input.empty(); ++i) {
    const std::string name = std::string("found/") + kNames[input.take_below(kNames.size())];
    const std::size_t bytes = input.take<std::uint16_t>();
    files.push_back(fuzz::written(name, fuzz::as_text(input.take_bytes(bytes))));
  }
  evaluation::FoundPoses found;
  (void)fuzz::is_accepted([&] { found = evaluation::read_found_poses(folder, frames); });
  for (const auto& [index, pose] : found.room_from_ct)
    fuzz::require(index >= 0 && rigidity_problems(pose.matrix()).empty(), "poses are rigid");
  (void)fuzz::is_accepted([&] { evaluation::unknown_case_problems(folder, {"skull-01"}); });
  for (const fs::path& file : files) {
    std::vector<std::string> notes;
    std::vector<RigidTransform> starts;
    (void)fuzz::is_accepted([&] { starts = evaluation::read_starts(file, frames, notes); });
    for (const RigidTransform& start : starts)
      fuzz::require(rigidity_problems(start.matrix()).empty(), "starts are rigid");
    (void)fuzz::is_accepted([&] { evaluation::read_found_poses(file, frames); });
  }
  return 0;
}
