// SPDX-License-Identifier: Apache-2.0
// Jobs on the small study that take long enough to be cut short in every stage.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace af::test {

/// Sets a vector width that makes training and encoding slow.
inline void prepare_slow_jobs() {
  setenv("AF_VECTOR_BITS", "128", 1);
}

/// The job yields to the test, so that the test does not miss a moment on a busy machine.
inline std::vector<std::string> under_mpirun(int ranks, const std::vector<std::string>& command) {
  std::vector<std::string> all = {"nice", "-n", "5", AF_MPIEXEC, "-n", std::to_string(ranks)};
  all.insert(all.end(), command.begin(), command.end());
  return all;
}

/// af-precompute of a study written by write_small_study().
inline std::vector<std::string> slow_precompute(const std::filesystem::path& study_folder,
                                                const std::filesystem::path& field,
                                                const std::vector<std::string>& options = {}) {
  std::vector<std::string> command = {AF_PROGRAM_FOLDER "/af-precompute", "-o", field.string()};
  for (const char* word : {"--camera",
                           "AP",
                           "--max-translation-mm",
                           "12",
                           "--uv-nodes",
                           "24",
                           "--st-nodes",
                           "144",
                           "--caster",
                           "trilinear",
                           "--step-mm",
                           "1",
                           "--codewords",
                           "10000",
                           "--study"})
    command.emplace_back(word);
  command.push_back((study_folder / "study.toml").string());
  command.insert(command.end(), options.begin(), options.end());
  return command;
}

}  // namespace af::test
