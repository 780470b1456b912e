// SPDX-License-Identifier: Apache-2.0
// What a field file says of itself; written by field_writing.h, read by field_reading.h.
#pragma once

#include <cstdint>
#include <string>

namespace af {

/// Strings stored beside a field: program, version, command line, options_toml, seed, rank count,
/// training statistics (JSON).
struct FieldProvenance {
  std::string source_version;
  std::string command_line;
  std::string options_toml;
  std::string provenance_json;
};

struct FieldFileInfo {
  FieldProvenance provenance;
  std::string payload_sha256;  ///< over the named datasets in fixed order
  std::uint64_t file_bytes = 0;
  std::uint64_t payload_bytes = 0;  ///< indices, means and codebook, by the bits stored
  /// The look-up for DRRs that the field's options name: "linear", also when they name none, or
  /// "cubic".
  std::string look_up = "linear";
};

}  // namespace af
