// SPDX-License-Identifier: Apache-2.0
#include "fuzz/fuzz_input.h"

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <unistd.h>

namespace af::fuzz {

namespace fs = std::filesystem;

const fs::path& scratch_folder() {
  static const struct Folder {
    Folder() : path(fs::temp_directory_path() / ("af-fuzz-" + std::to_string(getpid()))) {
      fs::create_directories(path);
    }
    ~Folder() {
      std::error_code ignored;
      fs::remove_all(path, ignored);
    }
    fs::path path;
  } folder;
  return folder.path;
}

fs::path written(const std::string& name, std::string_view bytes) {
  const fs::path path = scratch_folder() / name;
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
  return path;
}

void require(bool condition, const char* what) {
  if (condition) return;
  std::fprintf(stderr, "fuzz: not true of an accepted input: %s\n", what);
  std::abort();
}

}  // namespace af::fuzz
