// SPDX-License-Identifier: Apache-2.0
// Checked calls of HDF5, and small datasets. Internal to field_file.
#pragma once

#include <filesystem>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include <hdf5.h>

#include "base/error.h"
#include "field/dataset_rule.h"
#include "field/hdf5_handles.h"

namespace af::hdf5 {

/// Runs `function`, and turns an HDF5 failure or a missing attribute into a FileError.
template <typename Function>
auto naming_file(const std::filesystem::path& path, Function&& function) {
  try {
    return function();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::logic_error&) {
    throw;
  } catch (const std::exception& error) {
    throw FileError(path.string(), error.what());
  }
}

/// File access for new files: formats whose metadata carry checksums.
Handle file_access();
Handle create_file(const std::filesystem::path& path);
Handle open_file(const std::filesystem::path& path, unsigned flags);

void write_text_attribute(hid_t object, const char* name, const std::string& text);
/// Overwrites an attribute of the same length.
void replace_text_attribute(hid_t object, const char* name, const std::string& text);
std::string read_text_attribute(hid_t object, const char* name);
void write_int_attribute(hid_t object, const char* name, int value);
int read_int_attribute(hid_t object, const char* name);

/// Type of an element in the file, little-endian on any machine.
Handle file_type(const field_layout::DatasetRule& rule);

/// Writes a small dataset with its attributes units, frame, sha256; groups are made as needed.
void write_dataset(hid_t file, const field_layout::Dataset& dataset, const std::string& sha256);

/// Opens a dataset, and checks type, rank and extents against the rule before anything is read.
/// Returns its true extents in `found`. Throws FileError.
Handle open_dataset(hid_t file,
                    const field_layout::DatasetRule& rule,
                    const std::string& path,
                    std::vector<std::uint64_t>* found = nullptr);

/// Reads a small dataset and verifies its sha256. Throws FileError.
field_layout::Dataset read_dataset(hid_t file,
                                   const field_layout::DatasetRule& rule,
                                   const std::string& path);

}  // namespace af::hdf5
