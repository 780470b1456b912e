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

/// Collective. Reports on paths, or prints templates, draws pictures. An
/// error with the worst exit code, once all is reported, when a path is not usable.
void run_inspect(const InspectOptions& options, const Communicator& world);

}  // namespace af
