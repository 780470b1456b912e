// SPDX-License-Identifier: Apache-2.0
#include "support/test_paths.h"

#include <cstdlib>
#include <stdexcept>

namespace af::test {

ScratchFolder::ScratchFolder() {
  std::string pattern = (std::filesystem::temp_directory_path() / "af-test-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make a scratch folder");
  path_ = pattern;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

void prepare_once(const std::filesystem::path& folder, const std::function<void()>& prepare) {
  constexpr auto kWhole = std::filesystem::copy_options::recursive;
  const auto variable = [](const char* name, const std::filesystem::path& otherwise) {
    const char* const value = std::getenv(name);
    return value == nullptr ? otherwise : std::filesystem::path(value);
  };
  static std::filesystem::path prepared = variable("AF_PREPARED_IN", "");
  if (!prepared.empty()) {
    std::filesystem::copy(prepared, folder, kWhole);
    return;
  }
  prepare();
  static const ScratchFolder own;
  prepared = variable("AF_PREPARE_INTO", own / "prepared");
  std::filesystem::remove_all(prepared);
  std::filesystem::copy(folder, prepared, kWhole);
}

}  // namespace af::test
