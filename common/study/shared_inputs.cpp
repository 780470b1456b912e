// SPDX-License-Identifier: Apache-2.0
#include "study/shared_inputs.h"

#include <array>
#include <cstddef>
#include <cstring>

#include "files/output_file.h"
#include "study/rig_file.h"

namespace af {

Study shared_study(const std::filesystem::path& path, const Communicator& communicator) {
  std::string study_text;
  std::string rig_text;
  Study study = all_or_none(communicator, [&] {
    if (!communicator.is_root()) return Study();
    study_text = read_text_file(path);
    Study found = read_study(path);
    rig_text = rig_to_toml(found.rig);
    return found;
  });
  communicator.broadcast(study_text);
  communicator.broadcast(rig_text);
  all_or_none(communicator, [&] {
    if (!communicator.is_root())
      study = parse_study(
          study_text, path, [&](const std::string& rig) { return parse_rig(rig_text, rig); });
  });
  return study;
}

CameraRig shared_rig(const std::string& name_or_path,
                     const Communicator& communicator,
                     std::vector<std::string>* warnings) {
  std::string text;
  CameraRig rig = all_or_none(communicator, [&] {
    if (!communicator.is_root()) return CameraRig();
    CameraRig found = read_rig(name_or_path, warnings);
    text = rig_to_toml(found);
    return found;
  });
  communicator.broadcast(text);
  all_or_none(communicator, [&] {
    if (!communicator.is_root()) rig = parse_rig(text, name_or_path);
  });
  return rig;
}

std::vector<RigidTransform> shared_poses(const Communicator& communicator,
                                         const std::function<std::vector<RigidTransform>()>& read) {
  constexpr std::size_t kPoseBytes = 16 * sizeof(double);
  std::vector<RigidTransform> poses = all_or_none(communicator, [&] {
    return communicator.is_root() ? read() : std::vector<RigidTransform>();
  });
  std::vector<std::byte> bytes(poses.size() * kPoseBytes);
  for (std::size_t i = 0; i < poses.size(); ++i)
    std::memcpy(bytes.data() + i * kPoseBytes, poses[i].matrix().data(), kPoseBytes);
  communicator.broadcast(bytes);
  poses.resize(bytes.size() / kPoseBytes);
  for (std::size_t i = 0; i < poses.size(); ++i)
    std::memcpy(poses[i].matrix().data(), bytes.data() + i * kPoseBytes, kPoseBytes);
  return poses;
}

void broadcast(Image2d& image, const Communicator& communicator) {
  const std::size_t head_bytes = 2 * sizeof(int);
  std::vector<std::byte> bytes;
  if (communicator.is_root()) {
    const std::array<int, 2> size = {image.width, image.height};
    bytes.resize(head_bytes + image.pixels.size() * sizeof(float));
    std::memcpy(bytes.data(), size.data(), head_bytes);
    if (!image.pixels.empty())
      std::memcpy(bytes.data() + head_bytes, image.pixels.data(), bytes.size() - head_bytes);
  }
  communicator.broadcast(bytes);
  if (communicator.is_root()) return;
  std::array<int, 2> size{};
  std::memcpy(size.data(), bytes.data(), head_bytes);
  image = Image2d(size[0], size[1]);
  if (!image.pixels.empty())
    std::memcpy(image.pixels.data(), bytes.data() + head_bytes, bytes.size() - head_bytes);
}

}  // namespace af
