// SPDX-License-Identifier: Apache-2.0
// What a file says of a field or an atlas before its indices are read.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <tuple>
#include <vector>

#include <hdf5.h>

#include "field/field_file.h"
#include "field/field_layout.h"
#include "ranks/communicator.h"

namespace af::field_layout {

/// A field of a file, before its indices are read.
struct FieldHeader {
  std::vector<Dataset> payload;   ///< with the codebook, which members of an atlas share
  std::vector<Dataset> range;     ///< empty when two numbers of the payload state the range
  std::vector<Dataset> material;  ///< empty for all of the CT
  std::vector<DatasetRule> index_rules;
  std::vector<std::string> index_sha256;

  auto members() { return std::tie(payload, range, material, index_sha256); }
  /// The field without its indices. Throws FileError.
  [[nodiscard]] CompressedAttenuationField field(const std::string& path) const;
};

/// What rank 0 knows of a file before the indices are read.
struct FileHeader {
  bool is_atlas = false;
  std::vector<FieldHeader> fields;  ///< one, or the members of an atlas
  std::vector<Dataset> root;        ///< for an atlas: atlas_rules()
  std::vector<Dataset> root_range;  ///< for an atlas
  std::vector<Dataset> provenance;
  std::string payload_sha256;
  std::uint64_t file_bytes = 0;
  CodebookParts codebook;

  auto members() {
    return std::tie(
        is_atlas, fields, root, root_range, provenance, payload_sha256, file_bytes, codebook);
  }
  /// For an atlas only. Throws FileError.
  [[nodiscard]] AttenuationAtlas atlas(const std::string& path) const;
};

/// Throws FileError unless the file can be read and is HDF5.
void check_is_hdf5(const std::filesystem::path& path);

/// Whether an open file says that it is an atlas. FileError when it is neither atlas nor field.
bool is_atlas_format(hid_t file, const std::filesystem::path& path);

/// For rank 0 alone. Reads the header of an atlas or of a field. Throws FileError when the file is
/// of the other kind or fails verification.
FileHeader read_header_of(bool atlas, const std::filesystem::path& path);

/// Collective. Rank 0's header on every rank.
FileHeader shared_header(bool atlas,
                         const std::filesystem::path& path,
                         const Communicator& communicator);

/// What a file's header says of it.
FieldFileInfo info_of(const FileHeader& header,
                      std::uint64_t payload_bytes,
                      const std::filesystem::path& path);

}  // namespace af::field_layout
