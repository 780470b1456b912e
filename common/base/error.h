// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace af {

/// Process exit codes that users and scripts rely on.
enum class ExitCode : int {
  Done = 0,
  Usage = 2,
  Input = 3,
  File = 4,
  Numeric = 5,
  Internal = 6,
  NotFound = 7,  ///< a search is done and its files are written, but what it sought is not found,
                 ///< or found with a doubt that the caller does not accept
  Stopped = 75,  ///< stopped on request, progress saved: run the same command again
};

/// The message with every long line shortened to some thousand bytes. The middle, which holds text
/// from a file or the command line, is replaced by a note of how many bytes were left out.
std::string shortened(const std::string& message);

/// Base of all errors the project throws on purpose; carries the exit code that app_main returns.
/// The message is shortened().
class Error : public std::runtime_error {
 public:
  [[nodiscard]] ExitCode exit_code() const noexcept { return exit_code_; }

 protected:
  Error(ExitCode exit_code, const std::string& message)
      : std::runtime_error(shortened(message)), exit_code_(exit_code) {}

 private:
  ExitCode exit_code_;
};

/// The command line itself is wrong (unknown combination, missing option).
class UsageError : public Error {
 public:
  explicit UsageError(const std::string& message) : Error(ExitCode::Usage, message) {}
};

/// Readable but unacceptable input. Names field, value, constraint and, when there is one, file
/// (and line).
class InputError : public Error {
 public:
  explicit InputError(const std::string& message) : Error(ExitCode::Input, message) {}
  /// Message "file: field = value: constraint"; an empty file is left out.
  InputError(const std::string& field,
             const std::string& value,
             const std::string& constraint,
             const std::string& file = "");
};

/// A file cannot be parsed, is truncated, fails its checksum or belongs to another CT or camera.
class FileError : public Error {
 public:
  FileError(const std::string& path, const std::string& what_is_wrong);
  /// Message "path: object: expected E, found F".
  FileError(const std::string& path,
            const std::string& object,
            const std::string& expected,
            const std::string& found);
};

/// Numerics failed (NaN, codebook beyond repair).
class NumericError : public Error {
 public:
  explicit NumericError(const std::string& message) : Error(ExitCode::Numeric, message) {}
};

/// A search finished without finding what it sought; its results say so.
class NotFoundError : public Error {
 public:
  explicit NotFoundError(const std::string& message) : Error(ExitCode::NotFound, message) {}
};

/// Stopped by SIGUSR1 or a time limit with progress saved.
class StoppedError : public Error {
 public:
  explicit StoppedError(const std::string& message) : Error(ExitCode::Stopped, message) {}
};

/// An error that happened on some rank, thrown again on all of them with its exit code.
class RemoteError : public Error {
 public:
  RemoteError(ExitCode exit_code, const std::string& message) : Error(exit_code, message) {}
};

/// Fails on a broken promise of the caller (a defect, not bad input), which becomes exit code 6.
/// The location comes from builtins that GCC and Clang share, because Clang 14, whose tools check
/// this code, lacks std::source_location.
void check(bool condition,
           const char* message,
           const char* file = __builtin_FILE(),
           int line = __builtin_LINE());

/// Throws one InputError that lists all problems, or does nothing when there is none.
void throw_if_any(const std::vector<std::string>& problems, const std::string& file = "");

}  // namespace af
