// SPDX-License-Identifier: Apache-2.0
// HDF5 handles that close themselves, and checked calls. Only for sources of common/field.
#pragma once

#include <atomic>
#include <cstddef>
#include <stdexcept>
#include <string>

#include <hdf5.h>

namespace af::hdf5 {

/// An HDF5 call failed. The text names the call and HDF5's own reason; callers know the file.
class CallFailed : public std::runtime_error {
 public:
  explicit CallFailed(const char* call);
};

/// Throws CallFailed when an HDF5 call returned a negative value.
template <typename Result>
Result checked(Result result, const char* call) {
  if (result < 0) throw CallFailed(call);
  return result;
}

/// Owns an identifier. Not for files opened by several ranks: closing those is collective and must
/// not happen while one rank unwinds.
class Handle {
 public:
  Handle(hid_t id, herr_t (*closer)(hid_t), const char* call)
      : id_(checked(id, call)), close_(closer) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(Handle&& other) noexcept : id_(other.id_), close_(other.close_) { other.id_ = -1; }
  Handle& operator=(Handle&&) = delete;
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }  // NOLINT(google-explicit-constructor): used as the id
  /// Closes now and reports failure, which a destructor cannot.
  void close(const char* call) {
    const hid_t id = id_;
    id_ = -1;
    checked(close_(id), call);
  }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// While one is alive, HDF5 prints no error stack: errors travel as exceptions.
class QuietErrors {
 public:
  QuietErrors() {
    H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~QuietErrors() { H5Eset_auto2(H5E_DEFAULT, function_, data_); }
  QuietErrors(const QuietErrors&) = delete;
  QuietErrors& operator=(const QuietErrors&) = delete;

 private:
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

/// A new name each time, because HDF5 takes two files in memory of the same name for one file.
inline std::string memory_name() {
  static std::atomic<std::size_t> count{0};
  return "in-memory-" + std::to_string(++count);
}

/// The step by which a file in memory grows.
inline constexpr std::size_t kMemoryStep = 1U << 16;

}  // namespace af::hdf5
