// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"

namespace af {

namespace {

std::string file_prefix(const std::string& file) {
  return file.empty() ? std::string() : file + ": ";
}

}  // namespace

InputError::InputError(const std::string& field,
                       const std::string& value,
                       const std::string& constraint,
                       const std::string& file)
    : InputError(file_prefix(file) + field + " = " + value + ": " + constraint) {}

FileError::FileError(const std::string& path, const std::string& what_is_wrong)
    : Error(ExitCode::File, path + ": " + what_is_wrong) {}

FileError::FileError(const std::string& path,
                     const std::string& object,
                     const std::string& expected,
                     const std::string& found)
    : FileError(path, object + ": expected " + expected + ", found " + found) {}

void check(bool condition, const char* message, const char* file, int line) {
  if (!condition)
    throw std::logic_error(std::string(message) + " (" + file + ":" + std::to_string(line) + ")");
}

void throw_if_any(const std::vector<std::string>& problems, const std::string& file) {
  if (problems.empty()) return;
  std::string message = file_prefix(file) + problems.front();
  for (std::size_t i = 1; i < problems.size(); ++i)
    message += "\n  " + file_prefix(file) + problems[i];
  throw InputError(message);
}

}  // namespace af
