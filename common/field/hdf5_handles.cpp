// SPDX-License-Identifier: Apache-2.0
#include "field/hdf5_handles.h"

namespace af::hdf5 {

namespace {

/// The innermost message of HDF5's error stack: the true reason.
herr_t keep_first(unsigned position, const H5E_error2_t* error, void* text) {
  if (position == 0 && error->desc != nullptr) *static_cast<std::string*>(text) = error->desc;
  return 0;
}

std::string reason_of_last_error() {
  std::string reason;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, keep_first, &reason);
  return reason.empty() ? "no reason given" : reason;
}

}  // namespace

CallFailed::CallFailed(const char* call)
    : std::runtime_error(std::string(call) + " failed: " + reason_of_last_error()) {}

}  // namespace af::hdf5
