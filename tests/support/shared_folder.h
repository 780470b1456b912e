// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <system_error>

#include "ranks/communicator.h"
#include "support/test_paths.h"

namespace af::test {

/// Collective. A folder that all ranks share. All of them make and remove it together, so that none
/// removes what another still reads.
class SharedFolder {
 public:
  SharedFolder() {
    std::string path;
    if (world_.is_root()) {
      folder_ = std::make_unique<ScratchFolder>();
      path = folder_->path().string();
    }
    world_.broadcast(path);
    path_ = path;
  }
  ~SharedFolder() { world_.barrier(); }
  SharedFolder(const SharedFolder&) = delete;
  SharedFolder& operator=(const SharedFolder&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  Communicator world_ = Communicator::world();
  std::unique_ptr<ScratchFolder> folder_;
  std::filesystem::path path_;
};

/// Collective. Removes a file that all ranks share, once none of them reads it any more.
inline void remove_shared_file(const std::filesystem::path& path) {
  const Communicator world = Communicator::world();
  world.barrier();
  std::error_code ignored;
  if (world.is_root()) std::filesystem::remove(path, ignored);
  world.barrier();
}

}  // namespace af::test
