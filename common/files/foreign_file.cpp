// SPDX-License-Identifier: Apache-2.0
#include "files/foreign_file.h"

#include <algorithm>
#include <array>

#include "base/joined.h"
#include "files/shell_words.h"

namespace af {

bool has_foreign_mark(std::string_view beginning) {
  constexpr std::array<std::string_view, 16> kMarks = {
      "image size\n",
      "image size\r",
      "<RTKThreeDCircularGeometry",
      "%YAML",
      "camera_matrix:",
      "\nExtrinsic",
      "plastimatch drr",
      "(FocalPoint",
      "SourcePosition[mm]:",
      "[[diffdrr_camera]]",
      "diffdrr_parameterization",
      "1.2.840.10008.5.1.4.1.1.66.1",  // registration
      "TransformGroup",                // HDF5 of ITK
      "num-projs",                     // of xReg
      "proj-params",
      "cam-coord-frame-type"};
  return std::ranges::any_of(kMarks, [&](std::string_view mark) {
    return beginning.find(mark) != std::string_view::npos;
  });
}

std::string conversion_options(const std::filesystem::path& study, const std::string& case_name) {
  return "--study " + shell_quoted(study.string()) + " --case " + shell_quoted(case_name);
}

InputError needs_conversion(std::span<const std::filesystem::path> files,
                            const std::string& what,
                            const std::string& options,
                            const std::string& output) {
  std::string command = "af-convert";
  for (const std::filesystem::path& file : files) command += " " + shell_quoted(file.string());
  if (!options.empty()) command += " " + options;
  return InputError(
      joined(files, ", ", [](const std::filesystem::path& file) { return file.string(); }) + ": " +
      what + "; a file of another program is converted by: " + command + " -o " + output);
}

}  // namespace af
