// SPDX-License-Identifier: Apache-2.0
// HDF5 handles that close themselves, and checked calls. For sources of common/hdf5_files and
// common/field_file alone.
#pragma once

#include <atomic>
#include <cstddef>
#include <stdexcept>
#include <string>

#include <hdf5.h>

namespace af {

/// An HDF5 call failed; the text names the call and HDF5's own reason. Callers know the file.
class H5CallFailed : public std::runtime_error {
 public:
  explicit H5CallFailed(const char* call);
};

/// Throws H5CallFailed when an HDF5 call returned a negative value.
template <typename Result>
Result h5_checked(Result result, const char* call) {
  if (result < 0) throw H5CallFailed(call);
  return result;
}

/// Owns an identifier. Not for files opened by several ranks: closing those is collective and must
/// not happen while one rank unwinds.
class H5Id {
 public:
  H5Id(hid_t id, herr_t (*closer)(hid_t), const char* call)
      : id_(h5_checked(id, call)), close_(closer) {}
  ~H5Id() {
    if (id_ >= 0) close_(id_);
  }
  H5Id(H5Id&& other) noexcept : id_(other.id_), close_(other.close_) { other.id_ = -1; }
  H5Id& operator=(H5Id&&) = delete;
  H5Id(const H5Id&) = delete;
  H5Id& operator=(const H5Id&) = delete;
  operator hid_t() const { return id_; }  // NOLINT(google-explicit-constructor): used as the id
  /// Closes now and reports failure, which a destructor cannot.
  void close(const char* call) {
    const hid_t id = id_;
    id_ = -1;
    h5_checked(close_(id), call);
  }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// HDF5 prints no error stack while alive: errors travel as exceptions.
class H5Quiet {
 public:
  H5Quiet() {
    H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~H5Quiet() { H5Eset_auto2(H5E_DEFAULT, function_, data_); }
  H5Quiet(const H5Quiet&) = delete;
  H5Quiet& operator=(const H5Quiet&) = delete;

 private:
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

/// HDF5 takes two files in memory of one name for the same file.
inline std::string h5_memory_name() {
  static std::atomic<std::size_t> count{0};
  return "in-memory-" + std::to_string(++count);
}

/// By how much a file in memory grows.
constexpr std::size_t kH5MemoryStep = 1U << 16;

}  // namespace af
