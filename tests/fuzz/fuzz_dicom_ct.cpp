// SPDX-License-Identifier: Apache-2.0
// A DICOM series as a CT: a sound series, in which the input replaces values of slices. An accepted
// CT must have sound geometry, even if it was resampled.
#include <array>
#include <map>
#include <optional>
#include <string>

#include "ct/ct_reader.h"
#include "fuzz/fuzz_input.h"
#include "unit/ct/ct_test_data.h"

namespace {

using namespace af;
using Tag = test::DicomTestFile::Tag;

struct Changeable {
  Tag tag;
  const char* representation;  ///< "US": two bytes; else text
};

constexpr std::array<Changeable, 22> kChangeable = {
    {{{0x0020, 0x0032}, "DS"}, {{0x0020, 0x0037}, "DS"}, {{0x0028, 0x0030}, "DS"},
     {{0x0018, 0x1120}, "DS"}, {{0x0018, 0x0050}, "DS"}, {{0x0018, 0x0088}, "DS"},
     {{0x0028, 0x1052}, "DS"}, {{0x0028, 0x1053}, "DS"}, {{0x0028, 0x0008}, "IS"},
     {{0x0020, 0x0013}, "IS"}, {{0x0020, 0x000e}, "UI"}, {{0x0020, 0x0052}, "UI"},
     {{0x0008, 0x0008}, "CS"}, {{0x0008, 0x0060}, "CS"}, {{0x0028, 0x0004}, "CS"},
     {{0x0028, 0x1054}, "LO"}, {{0x0028, 0x0010}, "US"}, {{0x0028, 0x0011}, "US"},
     {{0x0028, 0x0100}, "US"}, {{0x0028, 0x0101}, "US"}, {{0x0028, 0x0102}, "US"},
     {{0x0028, 0x0103}, "US"}}};

void change(test::DicomTestFile& file, fuzz::InputBytes& input) {
  const Changeable& element = kChangeable[input.take_below(kChangeable.size())];
  const std::size_t bytes = input.take<std::uint8_t>() % 64;
  if (std::string(element.representation) == "US")
    file.set_u16(element.tag, input.take<std::uint16_t>());
  else if (bytes == 0)
    file.erase(element.tag);
  else
    file.set_text(
        element.tag, element.representation, std::string(fuzz::as_text(input.take_bytes(bytes))));
}

CtReadOptions options_of(std::uint8_t choice) {
  CtReadOptions options;
  options.resamples = (choice & 1) != 0;
  options.keeps_body_only = (choice & 2) != 0;
  if ((choice & 4) != 0) options.values = "mu";
  if ((choice & 8) != 0) {
    options.values = "raw";
    options.raw_slope_per_mm = 1e-5;
  }
  if ((choice & 16) != 0) {
    options.values = "labels";
    options.label_hu = {"1=0", "2=700"};
  }
  if ((choice & 32) != 0) options.series_uid = "1.2.3";
  return options;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const CtVolume sound = [] {
    CtGrid grid;
    grid.size = {4, 3, 4};
    grid.origin_mm = {-3.0, 2.0, -10.0};
    grid.spacing_mm = {0.8, 0.9, 1.5};
    return test::asymmetric_ct(grid);
  }();
  const auto folder = fuzz::scratch_folder() / "series";
  std::filesystem::remove_all(folder);
  fuzz::InputBytes input(data, size);
  const CtReadOptions options = options_of(input.take<std::uint8_t>());
  const auto edits = static_cast<int>(input.take_below(8));
  // Slices are written in order, but edits name slices in any order.
  std::map<int, std::vector<fuzz::InputBytes>> edits_of;
  constexpr std::size_t kMostEditBytes = 70;
  for (int edit = 0; edit < edits; ++edit) {
    const auto slice = static_cast<int>(input.take_below(4));
    const auto bytes = input.take_bytes(kMostEditBytes);
    edits_of[slice].emplace_back(bytes.data(), bytes.size());
  }
  test::write_dicom_series(sound, folder, [&](int slice, test::DicomTestFile& file) {
    for (fuzz::InputBytes& edit : edits_of[slice]) change(file, edit);
  });
  std::optional<CtVolume> ct;
  std::vector<std::string> warnings;
  if (!fuzz::is_accepted([&] { ct = read_ct(folder, options, &warnings); })) return 0;
  fuzz::require(fuzz::is_accepted([&] { (void)sound_grid(ct->grid, "series"); }),
                "an accepted CT has a sound grid");
  fuzz::require(ct->hu.size() == ct->grid.voxel_count(), "a CT has all its voxels");
  (void)fuzz::is_accepted([&] { (void)ct_frame_of_reference(folder, options); });
  return 0;
}
