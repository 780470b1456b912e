// SPDX-License-Identifier: Apache-2.0
// Image files: formats, headers, payloads; pixels of PNG and TIFF.
#include <limits>
#include <optional>

#include "base/error.h"
#include "fuzz/fuzz_input.h"
#include "images/image_header.h"
#include "images/stored_image.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  const auto path = fuzz::written("image", fuzz::as_text({data, size}));
  const auto format = sniff_image_format(path);
  if (!format || *format == ImageFormat::Dicom) return 0;
  std::optional<ImageHeader> header;
  std::vector<std::string> warnings;
  if (!fuzz::is_accepted([&] { header = read_image_header(path, *format); })) return 0;
  if (header->image.size.empty()) {  // PNG and TIFF
    constexpr std::size_t kMostPixels = std::size_t{1} << 20;
    (void)fuzz::is_accepted([&] {
      (void)read_stored_image(path, *header, nullptr, [&](const RawImage& image) {
        if (image.voxel_count() > kMostPixels) throw InputError("large for a fuzzer");
      });
    });
    return 0;
  }
  // The voxels of an image must lie beside its header.
  fuzz::require(header->data_file.lexically_normal().native().starts_with(
                    fuzz::scratch_folder().lexically_normal().native()),
                "voxels come from the header's folder");
  std::uint64_t seen = 0;
  const bool is_whole = fuzz::is_accepted([&] {
    read_image_payload(
        path, *header, &warnings, [&](std::span<const std::byte> piece) { seen += piece.size(); });
  });
  if (!is_whole) return 0;
  std::uint64_t promised = header->voxel_bytes();
  for (const std::size_t extent : header->image.size) promised *= extent;
  fuzz::require(seen == promised, "an accepted image has all voxels that its header promises");
  return 0;
}
