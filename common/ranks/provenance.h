// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "ranks/input_identity.h"

namespace af {

/// What every output records about how it was made.
struct Provenance {
  std::string program;       ///< "af-register"
  std::string command_line;  ///< quoted for a shell
  std::string options_toml;  ///< the options in force
  std::uint64_t seed = 0;
  int rank_count = 1;
  InputIdentities inputs;
  std::map<std::string, std::string> input_notes = {};  ///< name -> how it was read; may be empty
};

/// JSON object with program, version, compiler, command line, options, seed, ranks, inputs, host
/// CPU, start time (UTC).
nlohmann::json to_json(const Provenance& provenance);

/// Writes `folder`/reproduce.sh: a commented, executable script that changes to the folder from
/// which it was run and runs the same command.
void write_reproduce_script(const std::filesystem::path& folder, const Provenance& provenance);

/// Writes reproduce.sh beside `file`, then `file`: the summary with its provenance. Because it is
/// written last, it says that everything is there.
void write_results_last(const std::filesystem::path& file,
                        nlohmann::json summary,
                        const Provenance& provenance);

}  // namespace af
