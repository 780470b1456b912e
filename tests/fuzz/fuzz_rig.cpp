// SPDX-License-Identifier: Apache-2.0
// A rig file of any content.
#include <optional>

#include "base/file_name.h"
#include "fuzz/fuzz_input.h"
#include "study/rig_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  const auto path = fuzz::written("rig.toml", fuzz::as_text({data, size}));
  std::optional<CameraRig> rig;
  std::vector<std::string> warnings;
  if (!fuzz::is_accepted([&] { rig = read_rig(path, &warnings); })) return 0;
  for (const CameraGeometry& camera : rig->cameras)
    fuzz::require(is_plain_file_name(camera.name), "camera names can be parts of file names");
  const std::string text = rig_to_toml(*rig);
  const auto again = fuzz::written("again.toml", text);
  fuzz::require(rig_to_toml(read_rig(again)) == text, "a rig reads back as it was written");
  return 0;
}
