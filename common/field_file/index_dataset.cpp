// SPDX-License-Identifier: Apache-2.0
#include "field_file/index_dataset.h"

#include <algorithm>
#include <array>

#include "field_file/field_layout.h"
#include "field_file/hdf5_calls.h"
#include "field_file/index_filter.h"
#include "parallel/work_watch.h"

namespace af::hdf5 {
namespace {

constexpr unsigned kDeflateLevel = 4;

std::uint64_t position_hash(std::uint64_t position, std::uint16_t value) {
  std::uint64_t x = (position << 16u | value) + 0x9E3779B97F4A7C15ull;
  x = (x ^ (x >> 30u)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27u)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31u);
}

Handle index_creation(const ChunkShape& chunk, IndexPacking packing) {
  Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, "H5Pcreate");
  checked(H5Pset_chunk(creation, 4, chunk.data()), "H5Pset_chunk");
  if (packing == IndexPacking::CodebookTree) {
    add_index_filter(creation, chunk);
    return creation;
  }
  checked(H5Pset_shuffle(creation), "H5Pset_shuffle");
  checked(H5Pset_deflate(creation, kDeflateLevel), "H5Pset_deflate");
  return creation;
}

/// Planes of equal u that the chunks of a dataset span.
std::uint64_t planes_of_chunk(hid_t dataset) {
  const Handle creation(H5Dget_create_plist(dataset), H5Pclose, "H5Dget_create_plist");
  std::array<hsize_t, 4> chunk = {1, 1, 1, 1};
  if (H5Pget_layout(creation) == H5D_CHUNKED)
    checked(H5Pget_chunk(creation, 4, chunk.data()), "H5Pget_chunk");
  return chunk[0];
}

}  // namespace

std::uint64_t hash_sum(std::uint64_t first, std::span<const std::uint16_t> values) {
  std::uint64_t sum = 0;
  for (const std::uint16_t value : values) sum += position_hash(first++, value);
  return sum;
}

void create_index_dataset(hid_t file,
                          const field_layout::DatasetRule& rule,
                          const ChunkShape& chunk,
                          IndexPacking packing) {
  const std::vector<hsize_t> extents(rule.extents.begin(), rule.extents.end());
  const Handle space(H5Screate_simple(4, extents.data(), nullptr), H5Sclose, "H5Screate_simple");
  const Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose, "H5Pcreate");
  checked(H5Pset_create_intermediate_group(links, 1), "H5Pset_create_intermediate_group");
  const Handle creation = index_creation(chunk, packing);
  const Handle type = file_type(rule);
  const Handle dataset(
      H5Dcreate2(file, rule.name.c_str(), type, space, links, creation, H5P_DEFAULT),
      H5Dclose,
      "H5Dcreate2");
  write_text_attribute(dataset, "units", rule.units);
  write_text_attribute(dataset, "frame", rule.frame);
  // The true hash replaces this once the data are there.
  write_text_attribute(dataset, "sha256", std::string(field_layout::kSha256Digits, '0'));
}

void read_planes(
    hid_t dataset,
    const field_layout::DatasetRule& rule,
    const std::function<std::span<std::uint16_t>(std::uint64_t u, std::uint64_t count)>& planes_of,
    const std::function<void(std::uint64_t u, std::span<const std::uint16_t> planes)>& done) {
  const Handle in_file(H5Dget_space(dataset), H5Sclose, "H5Dget_space");
  std::array<hsize_t, 4> start{};
  std::array<hsize_t, 4> count = {1, rule.extents[1], rule.extents[2], rule.extents[3]};
  const std::uint64_t at_once = planes_of_chunk(dataset);
  ChunkShape chunk{};
  const bool coded = is_coded(dataset, chunk);
  for (std::uint64_t u = 0; u < rule.extents[0]; u += count[0]) {
    start[0] = u;
    count[0] = std::min(at_once, rule.extents[0] - u);
    const Handle in_memory(
        H5Screate_simple(4, count.data(), nullptr), H5Sclose, "H5Screate_simple");
    checked(
        H5Sselect_hyperslab(in_file, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr),
        "H5Sselect_hyperslab");
    const std::span<std::uint16_t> planes = planes_of(u, count[0]);
    if (coded)
      read_coded_planes(dataset, rule, chunk, u, count[0], planes);
    else
      checked(H5Dread(dataset, H5T_NATIVE_UINT16, in_memory, in_file, H5P_DEFAULT, planes.data()),
              "H5Dread");
    done(u, std::span<const std::uint16_t>(planes));
    note_progress();
  }
}

}  // namespace af::hdf5
