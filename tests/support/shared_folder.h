// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "parallel/communicator.h"
#include "support/test_paths.h"

namespace af::test {

/// A folder that all ranks share. Collective.
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
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  Communicator world_ = Communicator::world();
  std::unique_ptr<ScratchFolder> folder_;
  std::filesystem::path path_;
};

}  // namespace af::test
