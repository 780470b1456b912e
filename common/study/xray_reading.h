// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <tuple>

namespace af {

class TomlTableReader;

/// What an X-ray's pixel values mean: detector intensity (bright = unattenuated; reading takes
/// -log), or attenuation.
enum class XrayDomain { Intensity, Attenuation };

/// What the detector reads in the open beam.
enum class AirSource {
  NotAsked,           ///< like Percentile
  Percentile,         ///< 99.9th percentile of the picture
  OpenBeam,           ///< the brightest peak of the histogram
  CollimatedBorders,  ///< beside the edge of the collimated field
  Value
};

/// Whether an X-ray's values are inverted before `xray_domain` is applied.
enum class XrayPolarity {
  ByHeader,  ///< as a DICOM file says; other formats are taken as stored
  AsStored,
  Inverted
};

/// How a view's X-ray becomes line integrals: keys of [[case.view]].
struct XrayReading {
  std::optional<int> frame;  ///< in a multi-frame DICOM file, from 1
  XrayPolarity polarity = XrayPolarity::ByHeader;
  AirSource air = AirSource::NotAsked;
  double air_level = 0.0;  ///< with AirSource::Value
  std::optional<std::filesystem::path> flat;
  std::optional<std::filesystem::path> dark;
  double dark_level = 0.0;
  bool masks_borders = false;    ///< mask = "auto"
  bool ignores_spacing = false;  ///< the file's pixel spacing may differ from the camera's

  auto members() {
    return std::tie(
        frame, polarity, air, air_level, flat, dark, dark_level, masks_borders, ignores_spacing);
  }
};

/// Reads a path of the study and notes its place.
using StudyPathReader = std::function<std::optional<std::filesystem::path>(const char* key)>;

/// Reads the keys of XrayReading except `mask`. Contradictions become problems of `reader`.
XrayReading read_xray_keys(TomlTableReader& reader,
                           XrayDomain domain,
                           const StudyPathReader& read_path);

/// The keys that differ from their defaults, except `mask`, one per line. Paths go through
/// `path_text`.
std::string xray_keys_text(
    const XrayReading& reading,
    const std::function<std::string(const std::filesystem::path&)>& path_text);

}  // namespace af
