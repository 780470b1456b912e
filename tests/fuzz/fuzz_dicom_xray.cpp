// SPDX-License-Identifier: Apache-2.0
// A DICOM X-ray as a view of a study: frames, what the header says of the values, borders, air
// level. Compressed pixels are left out (GDCM decodes those).
#include <cmath>
#include <optional>

#include "fuzz/fuzz_input.h"
#include "images/dicom_elements.h"
#include "study/xray_reader.h"
#include "xray/dicom_xray.h"

namespace {

/// Larger ones take too long to look for borders in.
constexpr int kMostPixels = 1 << 14;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  if (size == 0) return 0;
  const std::uint8_t choice = data[0];  // how the study wants the file to be read
  const auto path = fuzz::written("xray.dcm", fuzz::as_text({data + 1, size - 1}));
  bool is_plain = false;
  if (!fuzz::is_accepted([&] { is_plain = !DicomElements::read(path).has_compressed_pixels(); }) ||
      !is_plain)
    return 0;
  StudyView view;
  view.xray = path;
  if ((choice & 1) != 0) view.reading.frame = 1 + (choice >> 6);
  view.reading.masks_borders = (choice & 2) != 0;
  view.xray_domain = (choice & 4) != 0 ? XrayDomain::Attenuation : XrayDomain::Intensity;
  view.reading.air = static_cast<AirSource>(choice >> 3 & 3);
  view.reading.ignores_spacing = (choice & 32) != 0;
  std::optional<DicomXray> xray;
  if (!fuzz::is_accepted([&] { xray = read_dicom_xray(path, view.reading.frame); })) return 0;
  fuzz::require(xray->frame >= 1 && xray->frame <= xray->frames, "a frame of the file is read");
  if (xray->image.width * xray->image.height > kMostPixels) return 0;
  CameraGeometry camera;
  camera.size_px = {xray->image.width, xray->image.height};
  if ((choice & 129) == 128) camera.distortion = {{-0.1, 0.0, 0.001}};
  camera.row_direction = {0.0, 1.0, 0.0};
  camera.source_point = {0.0, 0.0, -1000.0};
  view.roi = {0, 0, 1, 1};
  ViewXray found;
  if (!fuzz::is_accepted([&] { found = read_view_xray(view, camera); })) return 0;
  fuzz::require(found.attenuation.pixels.size() == xray->image.pixels.size(),
                "there is a line integral per pixel");
  for (const float value : found.attenuation.pixels)
    fuzz::require(!std::isnan(value), "line integrals are numbers");
  fuzz::require(found.mask.pixels.empty() || found.mask.pixels.size() == xray->image.pixels.size(),
                "a mask has the size of the X-ray");
  return 0;
}
