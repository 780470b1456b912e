// SPDX-License-Identifier: Apache-2.0
// One DICOM file: its elements, and its pixels unless they are compressed (GDCM decodes those).
#include <optional>

#include "fuzz/fuzz_input.h"
#include "images/dicom_elements.h"
#include "images/dicom_pixels.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  const auto path = fuzz::written("slice.dcm", fuzz::as_text({data, size}));
  (void)is_marked_dicom(path);
  (void)may_be_bare_dicom(path);
  std::optional<DicomElements> elements;
  if (!fuzz::is_accepted([&] { elements = DicomElements::read(path); })) return 0;
  fuzz::require(elements->pixel_bytes() <= size, "pixels lie within the file");
  for (const DicomTag& tag : {DicomTag{0x0020, 0x0032}, {0x0020, 0x0037}, {0x0028, 0x0030}})
    fuzz::is_accepted([&] { (void)elements->numbers(tag, "numbers"); });
  std::optional<DicomPixelLayout> layout;
  if (!fuzz::is_accepted([&] { layout = dicom_pixel_layout(*elements); })) return 0;
  if (elements->has_compressed_pixels()) return 0;
  std::vector<double> pixels;
  if (fuzz::is_accepted([&] { pixels = read_dicom_pixels(*layout).values; }))
    fuzz::require(pixels.size() == static_cast<std::size_t>(layout->columns) *
                                       static_cast<std::size_t>(layout->rows),
                  "there is a value per pixel");
  return 0;
}
