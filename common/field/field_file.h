// SPDX-License-Identifier: Apache-2.0
// What a field file says of itself. field_writing.h writes it, field_reading.h reads it.
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
  /// How DRRs look the field up, as its options say: "cubic", or "linear", also when they name
  /// none.
  std::string look_up = "linear";
};

}  // namespace af
