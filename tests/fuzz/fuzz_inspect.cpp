// SPDX-License-Identifier: Apache-2.0
// Any file, as af-inspect takes it: recognised by content, read, and described as text and as JSON.
// HDF5 files and formats that other libraries decode have their own fuzzers, or none.
#include <array>

#include "fuzz/fuzz_input.h"
#include "images/image_header.h"
#include "tools/inspect/inspection.h"

namespace {

using namespace af;

bool is_decoded_elsewhere(const std::filesystem::path& path, std::string_view bytes) {
  if (bytes.starts_with("\x89HDF")) return true;
  std::optional<ImageFormat> format;
  if (!fuzz::is_accepted([&] { format = sniff_image_format(path); })) return true;
  return format == ImageFormat::Png || format == ImageFormat::Tiff || format == ImageFormat::Dicom;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::array kNames = {
      "file", "table.csv", "study.toml", "result.json", "pose.tra", "image.nhdr"};
  fuzz::InputBytes input(data, size);
  const char* const name = kNames[input.take<std::uint8_t>() % kNames.size()];
  const std::string_view bytes = fuzz::as_text(input.rest());
  const auto path = fuzz::written(name, bytes);
  if (is_decoded_elsewhere(path, bytes)) return 0;
  const Inspection inspection = inspect_path(path, {}, Communicator::alone());
  fuzz::require(worst_exit_code(inspection) != ExitCode::Internal, inspection.error.c_str());
  fuzz::require(inspection.error.empty() == (inspection.exit_code == ExitCode::Done),
                "what cannot be used says why");
  (void)to_text(inspection);
  (void)to_json(inspection).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  return 0;
}
