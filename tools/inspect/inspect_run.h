// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "ct/ct_reader.h"
#include "ranks/communicator.h"

namespace af {

/// What af-inspect is asked for.
struct InspectOptions {
  std::vector<std::string> paths;
  std::string template_name;
  bool as_json = false;
  bool lists_views = false;
  bool lists_inputs = false;
  std::filesystem::path pictures;
  CtReadOptions ct;

  void describe(Fields& field);
};

/// Collective. Reports on paths, prints templates or draws pictures. When a path is not usable,
/// throws an error with the worst exit code, once everything is reported.
void run_inspect(const InspectOptions& options, const Communicator& world);

}  // namespace af
