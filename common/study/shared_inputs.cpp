// SPDX-License-Identifier: Apache-2.0
#include "study/shared_inputs.h"

#include "study/rig_file.h"

namespace af {

Shared<Study> shared_study(const std::filesystem::path& path, const Communicator& communicator) {
  return on_root(communicator, [&] { return read_study(path); }).share();
}

CameraRig shared_rig(const std::string& name_or_path,
                     const Communicator& communicator,
                     std::vector<std::string>* warnings) {
  return on_root(communicator, [&] { return read_rig(name_or_path, warnings); }).share().take();
}

std::vector<RigidTransform> shared_poses(const Communicator& communicator,
                                         const std::function<std::vector<RigidTransform>()>& read) {
  return on_root(communicator, read).share().take();
}

}  // namespace af
