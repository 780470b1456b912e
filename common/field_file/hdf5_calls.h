// SPDX-License-Identifier: Apache-2.0
// Internal to field_file: HDF5 handles that close themselves, checked calls, and small datasets.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

#include <hdf5.h>

#include "field_file/field_layout.h"

#ifndef H5_HAVE_PARALLEL
#error "the field file needs parallel HDF5: link hdf5-openmpi (see common/cmake/ThirdParty.cmake)"
#endif

namespace af::hdf5 {

/// An HDF5 call failed; the text names the call and HDF5's own reason. Callers know the path.
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
  using Closer = herr_t (*)(hid_t);
  Handle(hid_t id, Closer closer, const char* call) : id_(checked(id, call)), closer_(closer) {}
  ~Handle() {
    if (id_ >= 0) closer_(id_);
  }
  Handle(Handle&& other) noexcept : id_(other.id_), closer_(other.closer_) { other.id_ = -1; }
  Handle& operator=(Handle&&) = delete;
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  operator hid_t() const { return id_; }  // NOLINT(google-explicit-constructor): used as the id
  /// Closes now and reports failure, which a destructor cannot.
  void close(const char* call) {
    const hid_t id = id_;
    id_ = -1;
    checked(closer_(id), call);
  }

 private:
  hid_t id_;
  Closer closer_;
};

/// Keeps HDF5 from printing its error stack while alive; errors travel as exceptions.
class QuietErrors {
 public:
  QuietErrors();
  ~QuietErrors();
  QuietErrors(const QuietErrors&) = delete;
  QuietErrors& operator=(const QuietErrors&) = delete;

 private:
  H5E_auto2_t function_ = nullptr;
  void* client_data_ = nullptr;
};

/// File access of new files: formats whose metadata carry checksums.
Handle file_access();
Handle create_file(const std::filesystem::path& path);
Handle open_file(const std::filesystem::path& path, unsigned flags);

void write_text_attribute(hid_t object, const char* name, const std::string& text);
/// Overwrites an attribute of the same length.
void replace_text_attribute(hid_t object, const char* name, const std::string& text);
std::string read_text_attribute(hid_t object, const char* name);
void write_int_attribute(hid_t object, const char* name, int value);
int read_int_attribute(hid_t object, const char* name);

/// In-file type of an element; little-endian whatever the machine.
Handle file_type(const field_layout::DatasetRule& rule);

/// Writes a small dataset with its attributes units, frame, sha256; groups are made as needed.
void write_dataset(hid_t file, const field_layout::Dataset& dataset, const std::string& sha256);

/// Opens a dataset and checks type, rank and extents against the rule before anything is read;
/// returns its true extents in `found`. Throws FileError.
Handle open_dataset(hid_t file,
                    const field_layout::DatasetRule& rule,
                    const std::string& path,
                    std::vector<std::uint64_t>& found);

/// Reads a small dataset and verifies its sha256. Throws FileError.
field_layout::Dataset read_dataset(hid_t file,
                                   const field_layout::DatasetRule& rule,
                                   const std::string& path);

}  // namespace af::hdf5
