// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

#include "attenuation_fields/export.h"

namespace attenuation_fields {

/// Base of all errors that this library throws on purpose, with the text that the programs print.
/// Memory that is not available gives std::bad_alloc.
class ATTENUATION_FIELDS_API Error : public std::runtime_error {
 public:
  Error(const std::string& message, int exit_code);
  ~Error() override;
  /// The exit code of a program that meets this error.
  [[nodiscard]] int exit_code() const noexcept { return exit_code_; }

 private:
  int exit_code_;
};

/// Readable but unacceptable input (exit code 3). The text names field, value, constraint and, when
/// there is one, file and line.
class ATTENUATION_FIELDS_API InputError : public Error {
 public:
  explicit InputError(const std::string& message);
  ~InputError() override;
};

/// A file cannot be parsed, is truncated, fails its checksum or belongs to another CT or camera
/// (exit code 4).
class ATTENUATION_FIELDS_API FileError : public Error {
 public:
  explicit FileError(const std::string& message);
  ~FileError() override;
};

/// Numerics failed (exit code 5).
class ATTENUATION_FIELDS_API NumericError : public Error {
 public:
  explicit NumericError(const std::string& message);
  ~NumericError() override;
};

}  // namespace attenuation_fields
