// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "evaluate/scan/scan_geometry.h"
#include "study/study_file.h"

namespace af::tools {

/// A scan as scan.toml states it: geometry, and where its images are and what they mean.
struct ScanFile {
  std::string name;
  CircularScan scan;
  /// "Projection{}.png"; {:04} writes the index with four digits. Without braces, a stack of views.
  std::string files;
  int first_index = 0;
  int index_step = 1;  ///< from one view's file to the next one's
  /// Names a file per view, instead of all three.
  std::vector<std::string> listed_files;
  XrayDomain xray_domain = XrayDomain::Intensity;
  double attenuation_scale = 1.0;  ///< line integral per stored number
  double dark_level = 0.0;  ///< counts of every pixel without beam, if there is no dark image
  std::optional<std::string> dark;
  std::optional<std::string> flat;
  std::optional<double> flat_level;  ///< instead of an image: the same open beam at every pixel

  /// Whether one file holds all views, one after the other.
  [[nodiscard]] bool is_stack() const;
  /// File name of a view (or of the stack), relative to the scan's folder.
  [[nodiscard]] std::string file_of(int view) const;
};

/// Reads scan.toml. Throws InputError (3) that names file, line, key, value and constraint of
/// everything that is unacceptable, FileError (4) when it cannot be parsed.
ScanFile read_scan_file(const std::filesystem::path& path);

/// The same from its text. Messages name `file`, beside which angles_file lies.
ScanFile parse_scan_file(const std::string& text, const std::string& file);

}  // namespace af::tools
