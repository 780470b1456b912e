// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "base/described_fields.h"
#include "cli/sub_command.h"

namespace af::evaluation {

/// `af-evaluate compare` as typed.
struct CompareOptions {
  std::vector<std::filesystem::path> runs;
  std::filesystem::path output = "methods.md";
  bool is_screen = false;  ///< Markdown shows measures against optimisers

  bool with_pose_distances = false;
  double equivalence_margin_mm = 0.1;

  void describe(Fields& field);
};

/// Collective. Makes one table of all finished registration runs, as Markdown and, beside it, as
/// CSV. When runs have both renderers, one of pairs follows below it.
cli::SubCommand compare_command(CLI::App& app);

}  // namespace af::evaluation
