// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"

#include <string_view>

namespace af {

namespace {

std::string file_prefix(const std::string& file) {
  return file.empty() ? std::string() : file + ": ";
}

/// The nearest position that does not cut a UTF-8 character.
std::size_t character_start(std::string_view text, std::size_t position) {
  constexpr unsigned kMask = 0xC0;
  constexpr unsigned kContinuation = 0x80;
  while (position > 0 && position < text.size() &&
         (static_cast<unsigned char>(text[position]) & kMask) == kContinuation)
    --position;
  return position;
}

std::string shortened_line(std::string_view line) {
  constexpr std::size_t kMostBytes = 1500;
  constexpr std::size_t kFirstBytes = 800;
  constexpr std::size_t kLastBytes = 400;
  if (line.size() <= kMostBytes) return std::string(line);
  const std::size_t first = character_start(line, kFirstBytes);
  const std::size_t last = character_start(line, line.size() - kLastBytes);
  return std::string(line.substr(0, first)) + " ... (" + std::to_string(last - first) +
         " bytes left out) ... " + std::string(line.substr(last));
}

}  // namespace

std::string shortened(const std::string& message) {
  std::string result;
  std::string_view rest = message;
  for (std::size_t end = rest.find('\n'); end != std::string_view::npos; end = rest.find('\n')) {
    result += shortened_line(rest.substr(0, end)) + '\n';
    rest.remove_prefix(end + 1);
  }
  return result + shortened_line(rest);
}

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
