// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <tuple>

namespace af {

class TomlTableReader;

/// What an X-ray's pixel values mean: detector intensity (bright = unattenuated; -log is taken on
/// reading) or attenuation.
enum class XrayDomain { Intensity, Attenuation };

/// What the detector reads in the open beam.
enum class AirSource {
  NotAsked,           ///< as Percentile
  Percentile,         ///< 99.9th percentile of the picture
  OpenBeam,           ///< the brightest peak of the histogram
  CollimatedBorders,  ///< beside the edge of the collimated field
  Value
};

/// Whether an X-ray's values are turned round before `xray_domain` is applied.
enum class XrayPolarity {
  ByHeader,  ///< as a DICOM file says; other formats as stored
  AsStored,
  Inverted
};

/// How a view's X-ray becomes line integrals: keys of [[case.view]].
struct XrayReading {
  std::optional<int> frame;  ///< of a multi-frame DICOM file, from 1
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

/// Reads the keys of XrayReading but `mask`; contradictions become problems of `reader`.
XrayReading read_xray_keys(TomlTableReader& reader,
                           XrayDomain domain,
                           const StudyPathReader& read_path);

/// The keys that are not as they are by default, but `mask`, one per line; paths through
/// `path_text`.
std::string xray_keys_text(
    const XrayReading& reading,
    const std::function<std::string(const std::filesystem::path&)>& path_text);

}  // namespace af
