// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "cli/app_forward.h"
#include "parallel/communicator.h"
#include "study/study_file.h"

namespace af::evaluation {

/// `af-evaluate join-studies` as typed.
struct JoinStudiesOptions {
  std::vector<std::filesystem::path> studies;
  std::string fields;  ///< path of every view's field with {case} and {camera}; empty: as they are
  std::filesystem::path output = "study.toml";

  void describe(Fields& field);
};

/// Adds the subcommand; returns it.
CLI::App* bind_join_studies(CLI::App& app, JoinStudiesOptions& options);

/// One study of all cases, with the first one's rig. InputError when rigs differ or two cases have
/// one name. \test JoinedStudy.HasAllCasesAndTheirFields
Study joined_study(const std::vector<Study>& studies,
                   const std::string& fields,
                   const std::filesystem::path& path);

/// Reads, joins and writes on rank 0.
void run_join_studies(const JoinStudiesOptions& options, const Communicator& world);

}  // namespace af::evaluation
