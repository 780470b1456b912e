// SPDX-License-Identifier: Apache-2.0
#include "field/index_dataset.h"

#include <algorithm>

#include "base/error.h"
#include "field/field_layout.h"
#include "field/field_writing.h"
#include "field/hdf5_calls.h"
#include "field/mpi_io.h"
#include "ranks/work_watch.h"

namespace af::hdf5 {

using field_layout::codewords_rule;
using field_layout::DatasetRule;
using field_layout::means_rule;

namespace {

constexpr const char* kSha256Attribute = "sha256";

std::uint64_t position_hash(std::uint64_t position, std::uint16_t value) {
  std::uint64_t x = (position << 16u | value) + 0x9E3779B97F4A7C15ull;
  x = (x ^ (x >> 30u)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27u)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31u);
}

/// Creates a dataset with its attributes.
Handle create_dataset(hid_t file, const DatasetRule& rule, const ChunkShape& chunk) {
  constexpr unsigned kDeflateLevel = 6;  // 3 % smaller than 4
  const std::vector<hsize_t> extents(rule.extents.begin(), rule.extents.end());
  const Handle space(H5Screate_simple(4, extents.data(), nullptr), H5Sclose, "H5Screate_simple");
  const Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose, "H5Pcreate");
  checked(H5Pset_create_intermediate_group(links, 1), "H5Pset_create_intermediate_group");
  const Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, "H5Pcreate");
  checked(H5Pset_chunk(creation, 4, chunk.data()), "H5Pset_chunk");
  checked(H5Pset_shuffle(creation), "H5Pset_shuffle");
  checked(H5Pset_deflate(creation, kDeflateLevel), "H5Pset_deflate");
  checked(H5Pset_fletcher32(creation), "H5Pset_fletcher32");
  const Handle type = file_type(rule);
  Handle dataset(H5Dcreate2(file, rule.name.c_str(), type, space, links, creation, H5P_DEFAULT),
                 H5Dclose,
                 "H5Dcreate2");
  write_text_attribute(dataset, "units", rule.units);
  write_text_attribute(dataset, "frame", rule.frame);
  return dataset;
}

/// Planes of equal u that the chunks of a dataset span.
std::uint64_t planes_of_chunk(hid_t dataset) {
  const Handle creation(H5Dget_create_plist(dataset), H5Pclose, "H5Dget_create_plist");
  std::array<hsize_t, 4> chunk = {1, 1, 1, 1};
  if (H5Pget_layout(creation) == H5D_CHUNKED)
    checked(H5Pget_chunk(creation, 4, chunk.data()), "H5Pget_chunk");
  return chunk[0];
}

/// One plain hyperslab with a memory space of the same shape. Collective filtered writes of unions
/// of hyperslabs from a 1-D memory space sometimes crash or hang in HDF5 1.10.8. Selects nothing
/// where `block` is null.
struct Selection {
  Handle in_file;
  Handle in_memory;

  Selection(hid_t dataset, const DatasetBlock* block)
      : in_file(H5Dget_space(dataset), H5Sclose, "H5Dget_space"), in_memory(memory_of(block)) {
    if (block == nullptr) {
      checked(H5Sselect_none(in_file), "H5Sselect_none");
      checked(H5Sselect_none(in_memory), "H5Sselect_none");
      return;
    }
    std::array<hsize_t, 4> first{};
    std::array<hsize_t, 4> count{};
    std::ranges::copy(block->first, first.begin());
    std::ranges::copy(block->count, count.begin());
    checked(
        H5Sselect_hyperslab(in_file, H5S_SELECT_SET, first.data(), nullptr, count.data(), nullptr),
        "H5Sselect_hyperslab");
  }

 private:
  static Handle memory_of(const DatasetBlock* block) {
    std::array<hsize_t, 4> count = {1, 1, 1, 1};
    if (block != nullptr) std::ranges::copy(block->count, count.begin());
    return {H5Screate_simple(4, count.data(), nullptr), H5Sclose, "H5Screate_simple"};
  }
};

void read(hid_t dataset, const DatasetBlock& block, std::span<std::uint16_t> values) {
  const Selection selected(dataset, &block);
  checked(H5Dread(dataset,
                  H5T_NATIVE_UINT16,
                  selected.in_memory,
                  selected.in_file,
                  H5P_DEFAULT,
                  values.data()),
          "H5Dread");
}

/// The rows of codewords of a block, and of means, as codewords_rule() and means_rule() have them.
DatasetBlock codewords_of(const DatasetBlock& rows) {
  DatasetBlock block = rows;
  block.first[2] /= 2;
  block.count[2] /= 2;
  return block;
}
DatasetBlock means_of(const DatasetBlock& rows) {
  DatasetBlock block = codewords_of(rows);
  std::swap(block.first[2], block.first[3]);
  std::swap(block.count[2], block.count[3]);
  return block;
}

/// Calls visit(row of codewords, row of means, first place among the means of the file). `rows`:
/// values of a block of index_rule() with means. `places`: distance between the block's rows along
/// s.
template <typename Value, typename Visit>
void for_each_row(const DatasetBlock& block, std::span<Value> rows, Visit&& visit) {
  const std::size_t along_t = block.count[3];
  const std::size_t along_s = block.count[2] / 2;
  for (std::size_t plane = 0; plane < block.count[0] * block.count[1]; ++plane)
    for (std::size_t s = 0; s < along_s; ++s, rows = rows.subspan(2 * along_t))
      visit(rows.first(along_t), rows.subspan(along_t, along_t), plane * along_s * along_t + s);
}

/// Interleaves rows of codewords and of means, and undoes the means' differences.
void join(const DatasetBlock& block,
          std::span<const std::uint16_t> codewords,
          std::span<const std::uint16_t> means,
          std::span<std::uint16_t> rows) {
  const std::size_t along_s = block.count[2] / 2;
  for_each_row(block, rows, [&](auto of_codewords, auto of_means, std::size_t place) {
    std::ranges::copy(codewords.first(of_codewords.size()), of_codewords.begin());
    codewords = codewords.subspan(of_codewords.size());
    std::uint16_t before = 0;
    for (std::size_t t = 0; t < of_means.size(); ++t, place += along_s) {
      if (t % kMeanRunTiles == 0) before = 0;
      before = static_cast<std::uint16_t>(before + means[place]);
      of_means[t] = before;
    }
  });
}

}  // namespace

std::uint64_t hash_sum(std::uint64_t first, std::span<const std::uint16_t> values) {
  std::uint64_t sum = 0;
  for (const std::uint16_t value : values) sum += position_hash(first++, value);
  return sum;
}

void create_tiles(hid_t file, const DatasetRule& rule, const ChunkShape& chunk) {
  create_dataset(file, codewords_rule(rule), chunk);
  if (rule.rows_per_tile > 1)
    create_dataset(file, means_rule(rule), {chunk[0], chunk[1], chunk[3], chunk[2]});
  const Handle group(H5Gopen2(file, rule.name.c_str(), H5P_DEFAULT), H5Gclose, "H5Gopen2");
  // The true hash replaces this once the data are there.
  write_text_attribute(group, kSha256Attribute, std::string(field_layout::kSha256Digits, '0'));
}

std::string stated_sha256(hid_t file, const std::string& group) {
  const Handle object(H5Gopen2(file, group.c_str(), H5P_DEFAULT), H5Gclose, "H5Gopen2");
  return read_text_attribute(object, kSha256Attribute);
}

void state_sha256(hid_t file, const std::string& group, const std::string& sha256) {
  const Handle object(H5Gopen2(file, group.c_str(), H5P_DEFAULT), H5Gclose, "H5Gopen2");
  replace_text_attribute(object, kSha256Attribute, sha256);
}

StoredTiles::StoredTiles(hid_t file,
                         const DatasetRule& rule,
                         const std::string& path,
                         Writers writers)
    : rule_(rule), writers_(writers), codewords_(open_dataset(file, codewords_rule(rule), path)) {
  if (rule.rows_per_tile > 1) means_.emplace(open_dataset(file, means_rule(rule), path));
}

void StoredTiles::read_planes(
    const std::function<std::span<std::uint16_t>(std::uint64_t u, std::uint64_t count)>& planes_of,
    const std::function<void(std::uint64_t u, std::span<const std::uint16_t> planes)>& done) const {
  const std::uint64_t at_once = planes_of_chunk(codewords_);
  const auto& extents = rule_.extents;
  std::vector<std::uint16_t> codewords;
  std::vector<std::uint16_t> means;
  for (std::uint64_t u = 0; u < extents[0]; u += at_once) {
    const std::uint64_t count = std::min(at_once, extents[0] - u);
    const DatasetBlock block = {{u, 0, 0, 0}, {count, extents[1], extents[2], extents[3]}};
    const std::span<std::uint16_t> planes = planes_of(u, count);
    if (!means_) {
      read(codewords_, block, planes);
    } else {
      codewords.resize(planes.size() / 2);
      means.resize(planes.size() / 2);
      read(codewords_, codewords_of(block), codewords);
      read(*means_, means_of(block), means);
      join(block, codewords, means, planes);
    }
    done(u, std::span<const std::uint16_t>(planes));
    note_progress();
  }
}

void StoredTiles::write_to(hid_t dataset,
                           const DatasetBlock* block,
                           std::span<const std::uint16_t> values) const {
  const Selection selected(dataset, block);
  const Handle transfer(H5Pcreate(H5P_DATASET_XFER), H5Pclose, "H5Pcreate");
  if (writers_ == Writers::AllRanks) write_collectively(transfer);
  const std::uint16_t nothing = 0;
  checked(H5Dwrite(dataset,
                   H5T_NATIVE_UINT16,
                   selected.in_memory,
                   selected.in_file,
                   transfer,
                   block == nullptr ? &nothing : values.data()),
          "H5Dwrite");
}

void StoredTiles::write(const DatasetBlock* block, std::span<const std::uint16_t> values) const {
  if (!means_) return write_to(codewords_, block, values);
  if (block == nullptr) {
    write_to(codewords_, nullptr, {});
    return write_to(*means_, nullptr, {});
  }
  check(block->first[3] % kMeanRunTiles == 0, "a block begins where differences of means do");
  std::vector<std::uint16_t> codewords;
  codewords.reserve(values.size() / 2);
  std::vector<std::uint16_t> means(values.size() / 2);
  const std::size_t along_s = block->count[2] / 2;
  for_each_row(*block, values, [&](auto of_codewords, auto of_means, std::size_t place) {
    codewords.insert(codewords.end(), of_codewords.begin(), of_codewords.end());
    for (std::size_t t = 0; t < of_means.size(); ++t, place += along_s) {
      const int before = t % kMeanRunTiles == 0 ? 0 : of_means[t - 1];
      means[place] = static_cast<std::uint16_t>(of_means[t] - before);
    }
  });
  const DatasetBlock of_codewords = codewords_of(*block);
  write_to(codewords_, &of_codewords, codewords);
  const DatasetBlock of_means = means_of(*block);
  write_to(*means_, &of_means, means);
}

void StoredTiles::close() {
  codewords_.close("H5Dclose");
  if (means_) means_->close("H5Dclose");
}

}  // namespace af::hdf5
