// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "cli/sub_command.h"
#include "study/study_file.h"

namespace af::evaluation {

/// `af-evaluate join-studies` as typed.
struct JoinStudiesOptions {
  std::vector<std::filesystem::path> studies;
  std::string fields;  ///< path of every view's field with {case} and {camera}; empty to keep them
  std::filesystem::path output = "study.toml";

  void describe(Fields& field);
};

/// One study with all cases and the first study's rig. Throws InputError when rigs differ or two
/// cases have the same name. \test JoinedStudy.HasAllCasesAndTheirFields
Study joined_study(const std::vector<Study>& studies,
                   const std::string& fields,
                   const std::filesystem::path& path);

/// Reads, joins and writes on rank 0.
cli::SubCommand join_studies_command(CLI::App& app);

}  // namespace af::evaluation
