// SPDX-License-Identifier: Apache-2.0
#include "files/input_file.h"

#include <cerrno>
#include <string>
#include <system_error>

#include "base/error.h"

namespace af {

namespace fs = std::filesystem;

namespace {

const char* kind_name(fs::file_type type) {
  switch (type) {
    case fs::file_type::directory:
      return "is a folder";
    case fs::file_type::fifo:
      return "is a pipe";
    case fs::file_type::socket:
      return "is a socket";
    case fs::file_type::character:
    case fs::file_type::block:
      return "is a device";
    default:
      return "is something else";
  }
}

}  // namespace

void require_regular_file(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::not_found) throw FileError(path.string(), "does not exist");
  if (error) throw FileError(path.string(), "cannot be opened: " + error.message());
  if (status.type() != fs::file_type::regular)
    throw FileError(path.string(), std::string(kind_name(status.type())) + ", not a file");
}

std::ifstream open_input_file(const fs::path& path) {
  require_regular_file(path);
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw FileError(path.string(), "cannot be opened: " + std::generic_category().message(errno));
  return file;
}

}  // namespace af
