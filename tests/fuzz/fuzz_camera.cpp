// SPDX-License-Identifier: Apache-2.0
// A camera file of any content and format. The first byte says how much the options state, as they
// do for formats that leave much open.
#include <optional>

#include "base/file_name.h"
#include "camera_files/camera_formats.h"
#include "camera_files/rig_toml.h"
#include "fuzz/fuzz_input.h"

namespace {

af::CameraFileOptions options_of(std::uint8_t choice) {
  af::CameraFileOptions options;
  if ((choice & 1) != 0) options.size_px = {64, 48};
  if ((choice & 2) != 0) options.pixel_spacing_mm = {0.5, 0.5};
  if ((choice & 4) != 0) options.isocenter_point = {0.0, 0.0, 0.0};
  if ((choice & 8) != 0) options.flip = "rows";
  if ((choice & 16) != 0) {
    options.source_detector_mm = 1200.0;
    options.source_isocenter_mm = 800.0;
    options.positioner_deg = {30.0, -20.0};
  }
  return options;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  fuzz::InputBytes input(data, size);
  const auto choice = input.take_bytes(1);
  const CameraFileOptions options = options_of(choice.empty() ? 0 : choice.front());
  const auto path = fuzz::written("camera", fuzz::as_text(input.rest()));
  std::optional<CameraRig> rig;
  std::vector<std::string> warnings;
  if (!fuzz::is_accepted([&] { rig = read_camera_files({path}, options, &warnings); })) return 0;
  fuzz::require(problems(*rig).empty(), "an accepted rig has no problems");
  for (const CameraGeometry& camera : rig->cameras)
    fuzz::require(is_plain_file_name(camera.name), "camera names can be parts of file names");
  const std::string text = rig_to_toml(*rig);
  std::optional<CameraRig> again;
  fuzz::require(fuzz::is_accepted([&] { again = parse_rig(text, "rig.toml"); }),
                "an accepted rig can be written as rig.toml");
  fuzz::require(rig_to_toml(*again) == text, "a rig reads back as it was written");
  for (const CameraFormat& format : camera_formats())
    if (format.write != nullptr)
      (void)fuzz::is_accepted([&] { (void)camera_files_of(*rig, format.name, "camera"); });
  return 0;
}
