// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/sub_command.h"
#include "ct/ct_reader.h"
#include "ct/ray_caster.h"

namespace af::evaluation {

/// `af-evaluate held-out` as typed.
struct HeldOutOptions {
  std::filesystem::path study;
  std::vector<std::string> cases;  ///< empty for all
  std::vector<std::filesystem::path> fields;
  std::filesystem::path ct;  ///< from which the fields were made
  CtReadOptions ct_reading;
  RayCasterOptions ray_caster;
  std::string look_up;  ///< empty for each field's own
  int threads = 0;
  std::filesystem::path output = "held-out.md";

  void describe(Fields& field_list);
};

std::vector<std::string> problems(const HeldOutOptions& options);

/// Collective. Measures how well fields, and ray casting of their CT, predict the X-rays of a study
/// at their true poses. The measure is PSNR of eq. (12) with the X-ray as the reference, over the
/// pixels of each view's region that no mask hides and whose rays the CT attenuates. It is taken of
/// the images as they are and of both images smoothed. A view is left out for all predictors if
/// some field lacks a ray of its region. Writes a table (Markdown), and a row per view and renderer
/// (CSV beside it). Rank 0 does the work.
cli::SubCommand held_out_command(CLI::App& app);

}  // namespace af::evaluation
