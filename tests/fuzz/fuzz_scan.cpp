// SPDX-License-Identifier: Apache-2.0
// A scan file of any content.
#include <cmath>
#include <optional>

#include "base/file_name.h"
#include "evaluate/scan/scan_file.h"
#include "fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  std::optional<tools::ScanFile> file;
  const std::string text(fuzz::as_text({data, size}));
  if (!fuzz::is_accepted([&] { file = tools::parse_scan_file(text, "scan.toml"); })) return 0;
  fuzz::require(is_plain_file_name(file->name), "a scan's name can be a part of file names");
  fuzz::require(problems(file->scan).empty(), "an accepted scan is a possible one");
  double sum = 0.0;
  for (const double share : angle_shares_rad(file->scan.angles_rad)) sum += share;
  fuzz::require(std::abs(sum - 2.0 * 3.14159265358979323846) < 1e-6, "its views fill the circle");
  fuzz::require(!file->file_of(0).empty(), "its views have files");
  return 0;
}
