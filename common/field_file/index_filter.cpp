// SPDX-License-Identifier: Apache-2.0
#include "field_file/index_filter.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "field_file/hdf5_calls.h"

namespace af::hdf5 {

using field_layout::DatasetRule;

namespace {

/// What a dataset stores of the filter: version, chunk [u][v][s][t].
constexpr std::size_t kParameters = 5;
constexpr unsigned kVersion = 1;

/// Set by the IndexFilter that lives: HDF5 gives its filters no object to work with.
IndexFilter* filter_in_use = nullptr;

/// The tiles of a chunk of values along its axes, by the coding in use; false when there are none.
bool tiles_of_chunk(const std::array<std::size_t, 4>& values, std::array<std::size_t, 4>& tiles) {
  const std::size_t rows = filter_in_use->coding().values_per_tile();
  tiles = {values[0], values[1], values[2] / rows, values[3]};
  return values[2] % rows == 0;
}

/// Replaces HDF5's buffer; 0, which is HDF5's sign of failure, when there is no memory.
std::size_t give(std::span<const std::byte> bytes, std::size_t* buffer_size, void** buffer) {
  void* const replacement = H5allocate_memory(bytes.size(), false);
  if (replacement == nullptr) return 0;
  std::memcpy(replacement, bytes.data(), bytes.size());
  H5free_memory(*buffer);
  *buffer = replacement;
  *buffer_size = bytes.size();
  return bytes.size();
}

std::size_t code_chunk(bool reads,
                       const std::array<std::size_t, 4>& values,
                       std::size_t bytes,
                       std::size_t* buffer_size,
                       void** buffer) {
  std::array<std::size_t, 4> tiles{};
  if (!tiles_of_chunk(values, tiles)) return 0;
  std::vector<std::uint16_t> indices(values[0] * values[1] * values[2] * values[3]);
  if (reads) {
    if (!filter_in_use->coding().decode(
            {static_cast<const std::uint8_t*>(*buffer), bytes}, tiles, indices))
      return 0;
    return give(std::as_bytes(std::span(indices)), buffer_size, buffer);
  }
  if (bytes != indices.size() * sizeof(std::uint16_t)) return 0;
  std::memcpy(indices.data(), *buffer, bytes);
  const std::vector<std::uint8_t> coded = filter_in_use->coding().encode(indices, tiles);
  return give(std::as_bytes(std::span(coded)), buffer_size, buffer);
}

/// As H5Z_func_t asks for. The machine and the file are little-endian.
std::size_t filter_chunk(unsigned flags,
                         std::size_t parameter_count,
                         const unsigned* parameters,
                         std::size_t bytes,
                         std::size_t* buffer_size,
                         void** buffer) {
  if (filter_in_use == nullptr || parameter_count != kParameters) return 0;
  std::array<std::size_t, 4> values{};
  std::copy(parameters + 1, parameters + kParameters, values.begin());
  try {
    return code_chunk((flags & H5Z_FLAG_REVERSE) != 0, values, bytes, buffer_size, buffer);
  } catch (...) {
    return 0;  // nothing may be thrown through HDF5
  }
}

/// A chunk as the file has it, and its first value. No bytes where none was written: zeros.
struct StoredChunk {
  ChunkShape first;
  std::vector<std::uint8_t> bytes;
};

StoredChunk stored_chunk(hid_t dataset, const ChunkShape& chunk_shape, const ChunkShape& first) {
  hsize_t size = 0;
  checked(H5Dget_chunk_storage_size(dataset, first.data(), &size), "H5Dget_chunk_storage_size");
  const ChunkShape& c = chunk_shape;
  if (size > IndexCoding::most_bytes(c[0] * c[1] * c[2] * c[3]))
    throw std::runtime_error("a chunk of indices is too large");
  StoredChunk chunk{first, std::vector<std::uint8_t>(size)};
  if (size == 0) return chunk;
  std::uint32_t filters_left_out = 0;
  checked(H5Dread_chunk(dataset, H5P_DEFAULT, first.data(), &filters_left_out, chunk.bytes.data()),
          "H5Dread_chunk");
  if (filters_left_out != 0) throw std::runtime_error("a chunk of indices is not coded");
  return chunk;
}

/// Copies what of a chunk lies within the dataset, of `count` planes from the chunk's first.
void copy_into(std::span<const std::uint16_t> indices,
               const ChunkShape& first,
               const DatasetRule& rule,
               const ChunkShape& chunk,
               std::uint64_t count,
               std::span<std::uint16_t> planes) {
  const auto run = static_cast<std::ptrdiff_t>(std::min(chunk[3], rule.extents[3] - first[3]));
  for (std::size_t u = 0; u < count; ++u)
    for (std::size_t v = 0; v < std::min(chunk[1], rule.extents[1] - first[1]); ++v)
      for (std::size_t s = 0; s < std::min(chunk[2], rule.extents[2] - first[2]); ++s) {
        const std::size_t from = ((u * chunk[1] + v) * chunk[2] + s) * chunk[3];
        const std::size_t to =
            ((u * rule.extents[1] + first[1] + v) * rule.extents[2] + first[2] + s) *
                rule.extents[3] +
            first[3];
        std::copy_n(indices.begin() + static_cast<std::ptrdiff_t>(from),
                    run,
                    planes.begin() + static_cast<std::ptrdiff_t>(to));
      }
}

/// Chunks that one thread decodes together.
void decode_into(std::span<const StoredChunk> stored,
                 const DatasetRule& rule,
                 const ChunkShape& chunk,
                 std::uint64_t count,
                 std::span<std::uint16_t> planes) {
  std::array<std::size_t, 4> tiles{};
  if (!tiles_of_chunk({chunk[0], chunk[1], chunk[2], chunk[3]}, tiles))
    throw std::runtime_error("a chunk of indices ends without their means");
  const std::size_t size = chunk[0] * chunk[1] * chunk[2] * chunk[3];
  std::vector<std::uint16_t> indices(stored.size() * size);
  std::vector<CodedBlock> coded;
  for (std::size_t i = 0; i < stored.size(); ++i)
    if (!stored[i].bytes.empty())
      coded.push_back({stored[i].bytes, std::span(indices).subspan(i * size, size)});
  if (!filter_in_use->coding().decode(coded, tiles))
    throw std::runtime_error("a chunk of indices cannot be decoded");
  for (std::size_t i = 0; i < stored.size(); ++i)
    copy_into(
        std::span(indices).subspan(i * size, size), stored[i].first, rule, chunk, count, planes);
}

void register_filter() {
  constexpr H5Z_class2_t kClass = {H5Z_CLASS_T_VERS,
                                   kIndexFilter,
                                   1,
                                   1,
                                   "attenuation-field indices",
                                   nullptr,
                                   nullptr,
                                   filter_chunk};
  checked(H5Zregister(&kClass), "H5Zregister");
}

}  // namespace

IndexFilter::IndexFilter(const Codebook& codebook, int threads)
    : coding_(codebook), threads_(threads), outer_(filter_in_use) {
  register_filter();
  filter_in_use = this;
}

IndexFilter::~IndexFilter() {
  filter_in_use = outer_;
}

ThreadPool& IndexFilter::pool() {
  if (!pool_.has_value()) pool_.emplace(threads_);
  return *pool_;
}

bool is_coded(hid_t dataset, ChunkShape& chunk) {
  const Handle creation(H5Dget_create_plist(dataset), H5Pclose, "H5Dget_create_plist");
  if (H5Pget_nfilters(creation) != 1) return false;
  unsigned flags = 0;
  std::size_t none = 0;
  if (H5Pget_filter2(creation, 0, &flags, &none, nullptr, 0, nullptr, nullptr) != kIndexFilter)
    return false;
  return checked(H5Pget_chunk(creation, 4, chunk.data()), "H5Pget_chunk") == 4;
}

void read_coded_planes(hid_t dataset,
                       const DatasetRule& rule,
                       const ChunkShape& chunk,
                       std::uint64_t u,
                       std::uint64_t count,
                       std::span<std::uint16_t> planes) {
  std::vector<StoredChunk> stored;
  for (hsize_t v = 0; v < rule.extents[1]; v += chunk[1])
    for (hsize_t s = 0; s < rule.extents[2]; s += chunk[2])
      for (hsize_t t = 0; t < rule.extents[3]; t += chunk[3])
        stored.push_back(stored_chunk(dataset, chunk, {u, v, s, t}));
  filter_in_use->pool().for_each_block(
      static_cast<int>(stored.size()), IndexCoding::kBlocksTogether, [&](int begin, int end) {
        decode_into(std::span(stored).subspan(static_cast<std::size_t>(begin),
                                              static_cast<std::size_t>(end - begin)),
                    rule,
                    chunk,
                    count,
                    planes);
      });
}

void add_index_filter(hid_t creation, const ChunkShape& chunk) {
  std::array<unsigned, kParameters> parameters = {kVersion};
  std::transform(chunk.begin(), chunk.end(), parameters.begin() + 1, [](hsize_t extent) {
    return static_cast<unsigned>(extent);
  });
  checked(H5Pset_filter(
              creation, kIndexFilter, H5Z_FLAG_MANDATORY, parameters.size(), parameters.data()),
          "H5Pset_filter");
}

std::string index_filter_problem(hid_t creation) {
  if (H5Pget_nfilters(creation) != 1) return "a filter of indices beside others";
  std::array<unsigned, kParameters> parameters{};
  std::size_t count = parameters.size();
  unsigned flags = 0;
  H5Pget_filter2(creation, 0, &flags, &count, parameters.data(), 0, nullptr, nullptr);
  if (count != kParameters || parameters[0] != kVersion) return "an unknown coding of indices";
  std::array<hsize_t, H5S_MAX_RANK> chunk{};
  if (H5Pget_chunk(creation, H5S_MAX_RANK, chunk.data()) != 4 ||
      !std::equal(parameters.begin() + 1, parameters.end(), chunk.begin()))
    return "indices coded in blocks other than the chunks";
  return {};
}

}  // namespace af::hdf5
