// SPDX-License-Identifier: Apache-2.0
#include "library/files_lock.h"

namespace af::library {
namespace {

std::mutex& files_mutex() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

FilesLock::FilesLock() : guard_(files_mutex()) {}

}  // namespace af::library
