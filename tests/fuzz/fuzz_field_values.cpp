// SPDX-License-Identifier: Apache-2.0
// The values of a field file, as if every checksum agreed. Any numbers replace those of a sound
// field. DRRs must be able to look up every field that is accepted.
#include <array>
#include <memory>
#include <optional>

#include "drr/ray_by_ray_af_drr.h"
#include "field/field_layout.h"
#include "fuzz/fuzz_input.h"
#include "fuzz/sample_field.h"

namespace {

using namespace af;

constexpr std::uint64_t kMostTiles = 1u << 16;

void replace_values(std::vector<field_layout::Dataset>& datasets, fuzz::InputBytes& input) {
  while (!input.empty()) {
    std::vector<std::byte>& bytes = datasets[input.take_below(datasets.size())].bytes;
    const std::size_t width = std::min(bytes.size(), std::size_t{1} << input.take_below(4));
    const std::size_t place = input.take_below(bytes.size() / width) * width;
    const auto value = std::as_bytes(input.take_bytes(width));
    std::copy(value.begin(), value.end(), bytes.begin() + static_cast<std::ptrdiff_t>(place));
  }
}

/// Sets codeword 0, and mean 0, everywhere. False when the indices would be too large for a test.
bool add_indices(CompressedAttenuationField& field) {
  for (std::size_t k = 0; k < field.light_slab.slabs.size(); ++k) {
    std::uint64_t tiles = 1;
    for (const std::uint64_t extent :
         field_layout::index_rule(field.lattice(), k, field.codebook.has_means()).extents) {
      fuzz::require(extent >= 1 && extent <= 65536, "extents of indices are sane");
      tiles *= extent;
    }
    if (tiles > kMostTiles) return false;
    field.slabs.push_back({SharedArray<std::uint16_t>(std::vector<std::uint16_t>(tiles))});
  }
  return true;
}

void look_up(std::shared_ptr<const CompressedAttenuationField> field) {
  View view = View::whole_detector(field->identity.camera);
  view.roi.width = std::min(view.roi.width, 8);
  view.roi.height = std::min(view.roi.height, 8);
  const RigidTransform pose = field->identity.frame.nominal_room_from_ct();
  (void)render_image(RayByRayAfDrr(std::move(field)), pose, view);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::array sound = {field_layout::datasets_of(fuzz::sample_field()),
                                   field_layout::datasets_of(fuzz::sample_field_with_means())};
  fuzz::InputBytes input(data, size);
  auto datasets = sound[input.take<std::uint8_t>() % sound.size()];
  replace_values(datasets, input);
  auto field = std::make_shared<CompressedAttenuationField>();
  const bool is_accepted = fuzz::is_accepted([&] {
    const int slabs = field_layout::slab_count_of(datasets.front(), "field");
    if (slabs != 2) throw FileError("field", "has other datasets");
    *field = field_layout::field_of(datasets, "field");
  });
  if (!is_accepted || !add_indices(*field)) return 0;
  if (!problems(*field).empty()) return 0;  // read_field() refuses it then
  fuzz::is_accepted([&] { look_up(field); });
  return 0;
}
