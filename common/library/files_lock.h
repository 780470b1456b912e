// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>

namespace af::library {

/// One thread of this process at a time, as long as it lives: HDF5, ITK and GDCM are made for one.
class FilesLock {
 public:
  FilesLock();

 private:
  std::lock_guard<std::mutex> guard_;
};

}  // namespace af::library
