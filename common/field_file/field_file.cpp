// SPDX-License-Identifier: Apache-2.0
#include "field_file/field_file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <mutex>
#include <numeric>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/stored_bytes.h"
#include "field_file/chunk_index.h"
#include "field_file/field_layout.h"
#include "field_file/hdf5_calls.h"
#include "field_file/index_filter.h"
#include "files/input_file.h"
#include "files/input_guard.h"
#include "files/output_file.h"
#include "files/sha256.h"
#include "parallel/mpi_environment.h"
#include "parallel/mpi_handle.h"
#include "parallel/work_watch.h"

namespace af {

namespace {

using field_layout::Dataset;
using field_layout::DatasetRule;
using field_layout::index_rules;
using field_layout::kSha256Digits;
using hdf5::checked;
using hdf5::Handle;

constexpr unsigned kDeflateLevel = 4;
/// Deflate shrinks nothing by more than this, and IndexCoding by less.
constexpr std::uint64_t kMaxPackingRatio = 1032;

/// Runs `function` and turns whatever HDF5 or a missing attribute makes of it into a FileError.
template <typename Function>
auto naming_file(const std::filesystem::path& path, Function&& function) {
  try {
    return function();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::logic_error&) {
    throw;
  } catch (const std::exception& error) {
    throw FileError(path.string(), error.what());
  }
}

std::uint64_t tile_count_of(const DatasetRule& rule) {
  return std::accumulate(
      rule.extents.begin(), rule.extents.end(), std::uint64_t{1}, std::multiplies<>());
}

// --- checksums of index arrays, independent of who holds which block ---------------------------

/// Adding this over all tiles gives a sum that a lost, doubled, moved or changed index changes.
std::uint64_t position_hash(std::uint64_t tile, std::uint16_t index) {
  std::uint64_t x = (tile << 16u | index) + 0x9E3779B97F4A7C15ull;
  x = (x ^ (x >> 30u)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27u)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31u);
}

std::uint64_t hash_sum(std::uint64_t first_tile, std::span<const std::uint16_t> indices) {
  std::uint64_t sum = 0;
  for (const std::uint16_t index : indices) sum += position_hash(first_tile++, index);
  return sum;
}

/// First value and number of values of a block along the axes of its dataset: tiles, but along s
/// rows.
struct DatasetBlock {
  std::array<std::uint64_t, 4> first{};
  std::array<std::uint64_t, 4> count{};
};

DatasetBlock in_dataset(const IndexBlock& block, const DatasetRule& rule) {
  DatasetBlock values;
  for (std::size_t axis = 0; axis < 4; ++axis) {
    const std::uint64_t rows = axis == 2 ? rule.rows_per_tile : 1;
    values.first[axis] = rows * static_cast<std::uint64_t>(block.first_tile[axis]);
    values.count[axis] = rows * static_cast<std::uint64_t>(block.tile_count[axis]);
  }
  return values;
}

/// Calls visit(number of the first value within the slab, values) for every run of values along t.
template <typename Visit>
void for_each_run(const IndexBlock& block, const DatasetRule& rule, Visit&& visit) {
  std::span<const std::uint16_t> rest(block.indices);
  const auto [first, count] = in_dataset(block, rule);
  for (std::uint64_t a = first[0]; a < first[0] + count[0]; ++a)
    for (std::uint64_t b = first[1]; b < first[1] + count[1]; ++b)
      for (std::uint64_t c = first[2]; c < first[2] + count[2]; ++c) {
        const std::uint64_t row = (a * rule.extents[1] + b) * rule.extents[2] + c;
        visit(row * rule.extents[3] + first[3], rest.first(count[3]));
        rest = rest.subspan(count[3]);
      }
}

// --- writing -------------------------------------------------------------------------------------

void check_blocks(const std::vector<IndexBlock>& blocks, const std::vector<DatasetRule>& rules) {
  for (const IndexBlock& block : blocks) {
    check(block.slab < rules.size(), "an index block names a slab of the field");
    const DatasetRule& rule = rules[block.slab];
    const DatasetBlock values = in_dataset(block, rule);
    std::size_t needed = 1;
    for (std::size_t axis = 0; axis < 4; ++axis) {
      check(block.first_tile[axis] >= 0 && block.tile_count[axis] >= 1 &&
                values.first[axis] + values.count[axis] <= rule.extents[axis],
            "an index block lies within its slab");
      needed *= values.count[axis];
    }
    check(block.indices.size() == needed, "an index block has one index per tile");
  }
}

Handle index_creation(const hdf5::ChunkShape& chunk, IndexPacking packing) {
  Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, "H5Pcreate");
  checked(H5Pset_chunk(creation, 4, chunk.data()), "H5Pset_chunk");
  if (packing == IndexPacking::CodebookTree) {
    hdf5::add_index_filter(creation, chunk);
    return creation;
  }
  checked(H5Pset_shuffle(creation), "H5Pset_shuffle");
  checked(H5Pset_deflate(creation, kDeflateLevel), "H5Pset_deflate");
  return creation;
}

void create_index_dataset(hid_t file,
                          const DatasetRule& rule,
                          const hdf5::ChunkShape& chunk,
                          IndexPacking packing) {
  const std::vector<hsize_t> extents(rule.extents.begin(), rule.extents.end());
  const Handle space(H5Screate_simple(4, extents.data(), nullptr), H5Sclose, "H5Screate_simple");
  const Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose, "H5Pcreate");
  checked(H5Pset_create_intermediate_group(links, 1), "H5Pset_create_intermediate_group");
  const Handle creation = index_creation(chunk, packing);
  const Handle type = hdf5::file_type(rule);
  const Handle dataset(
      H5Dcreate2(file, rule.name.c_str(), type, space, links, creation, H5P_DEFAULT),
      H5Dclose,
      "H5Dcreate2");
  hdf5::write_text_attribute(dataset, "units", rule.units);
  hdf5::write_text_attribute(dataset, "frame", rule.frame);
  // The true hash replaces this once the data are there.
  hdf5::write_text_attribute(dataset, "sha256", std::string(kSha256Digits, '0'));
}

/// What a file is to hold but for the provenance: of a field, or of an atlas.
struct FileContents {
  const char* format = field_layout::kFormat;
  IndexPacking packing = IndexPacking::CodebookTree;
  bool has_means = false;
  std::string ct_sha256;
  std::vector<Dataset> payload;
  std::vector<Dataset> beside;  ///< not of the payload: ranges that two numbers do not state, bone
  std::vector<DatasetRule> indices;
  std::uint64_t payload_bytes = 0;
};

FileContents contents_of(const CompressedAttenuationField& field, IndexPacking packing) {
  FileContents contents = {field_layout::kFormat,
                           packing,
                           field.codebook.has_means(),
                           field.identity.ct_content_sha256,
                           field_layout::datasets_of(field),
                           field_layout::range_datasets(field.identity.range),
                           index_rules(field),
                           field_layout::payload_bytes(field.codebook, field.lattice())};
  for (Dataset& dataset : field_layout::material_datasets(field.identity.material))
    contents.beside.push_back(std::move(dataset));
  return contents;
}

FileContents contents_of(const AttenuationAtlas& atlas, IndexPacking packing) {
  FileContents contents = {field_layout::kAtlasFormat,
                           packing,
                           atlas.codebook.has_means(),
                           atlas.identity.ct_content_sha256,
                           field_layout::datasets_of(atlas),
                           field_layout::range_datasets(atlas.identity.range),
                           index_rules(atlas),
                           field_layout::payload_bytes(atlas.codebook, atlas.lattice())};
  const auto append = [](std::vector<Dataset> more, std::vector<Dataset>& datasets) {
    std::move(more.begin(), more.end(), std::back_inserter(datasets));
  };
  for (std::size_t i = 0; i < atlas.members.size(); ++i) {
    const std::string group = field_layout::member_group(i);
    const AtlasMember& member = atlas.members[i];
    append(field_layout::within(group, field_layout::datasets_of(member)), contents.payload);
    append(field_layout::within(group, field_layout::range_datasets(member.identity.range)),
           contents.beside);
  }
  return contents;
}

/// Rank 0 alone: everything but the indices and the provenance.
void create_file_without_indices(const FileContents& contents, const std::filesystem::path& path) {
  Handle file = hdf5::create_file(path);
  hdf5::write_text_attribute(file, "format", contents.format);
  hdf5::write_int_attribute(file,
                            "format_version",
                            field_layout::format_version_of(contents.packing, contents.has_means));
  if (contents.has_means) {
    hdf5::write_text_attribute(
        file, field_layout::kTileCodingAttribute, field_layout::kMeanRemoved);
    hdf5::write_text_attribute(
        file, field_layout::kPackingAttribute, field_layout::to_string(contents.packing));
  }
  hdf5::write_text_attribute(file, "ct_sha256", contents.ct_sha256);
  hdf5::write_text_attribute(file, "payload_sha256", std::string(kSha256Digits, '0'));
  for (const std::vector<Dataset>* datasets : {&contents.payload, &contents.beside})
    for (const Dataset& dataset : *datasets)
      hdf5::write_dataset(file, dataset, sha256_hex(dataset.bytes));
  const std::vector<hdf5::ChunkShape> chunks = hdf5::index_chunks(contents.indices);
  for (std::size_t k = 0; k < contents.indices.size(); ++k)
    create_index_dataset(file, contents.indices[k], chunks[k], contents.packing);
  file.close("H5Fclose");
}

/// Collective. Writes one block, or none where `block` is null. One plain hyperslab with a memory
/// space of the same shape: collective filtered writes of unions of hyperslabs from a 1-D memory
/// space crash or hang in HDF5 1.10.8 now and then.
void write_block(hid_t dataset, const DatasetRule& rule, IndexBlock* block) {
  const Handle in_file(H5Dget_space(dataset), H5Sclose, "H5Dget_space");
  const Handle transfer(H5Pcreate(H5P_DATASET_XFER), H5Pclose, "H5Pcreate");
  checked(H5Pset_dxpl_mpio(transfer, H5FD_MPIO_COLLECTIVE), "H5Pset_dxpl_mpio");
  std::array<hsize_t, 4> start{};
  std::array<hsize_t, 4> count = {1, 1, 1, 1};
  if (block != nullptr) {
    const DatasetBlock values = in_dataset(*block, rule);
    std::ranges::copy(values.first, start.begin());
    std::ranges::copy(values.count, count.begin());
  }
  const Handle in_memory(H5Screate_simple(4, count.data(), nullptr), H5Sclose, "H5Screate_simple");
  const std::uint16_t nothing = 0;
  const std::uint16_t* indices = &nothing;
  if (block != nullptr) {
    indices = block->indices.data();
    checked(
        H5Sselect_hyperslab(in_file, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr),
        "H5Sselect_hyperslab");
  } else {
    checked(H5Sselect_none(in_file), "H5Sselect_none");
    checked(H5Sselect_none(in_memory), "H5Sselect_none");
  }
  checked(H5Dwrite(dataset, H5T_NATIVE_UINT16, in_memory, in_file, transfer, indices), "H5Dwrite");
  if (block != nullptr) block->indices = {};
}

/// Hints as MPI wants them.
class MpiInfo {
 public:
  explicit MpiInfo(const MpiIoHints& hints) {
    if (hints.empty()) return;
    MPI_Info_create(&info_);
    for (const auto& [key, value] : hints) MPI_Info_set(info_, key.c_str(), value.c_str());
  }
  ~MpiInfo() {
    if (info_ != MPI_INFO_NULL) MPI_Info_free(&info_);
  }
  MpiInfo(const MpiInfo&) = delete;
  MpiInfo& operator=(const MpiInfo&) = delete;

  [[nodiscard]] MPI_Info handle() const { return info_; }

 private:
  MPI_Info info_ = MPI_INFO_NULL;
};

/// Rank 0 alone. Hints of how a file is laid out (stripes) count when it is made: MPI-IO makes it
/// where there are hints, and HDF5 writes into it.
void lay_out(const std::filesystem::path& path, const MpiIoHints& hints) {
  if (hints.empty()) return;
  std::error_code ignored;
  std::filesystem::remove(path, ignored);
  const MpiInfo info(hints);
  MPI_File file = MPI_FILE_NULL;
  if (MPI_File_open(
          MPI_COMM_SELF, path.c_str(), MPI_MODE_CREATE | MPI_MODE_WRONLY, info.handle(), &file) !=
      MPI_SUCCESS)
    throw FileError(path.string(), "cannot be made by MPI-IO");
  MPI_File_close(&file);
}

/// The open file of all ranks. After a failed write it can neither be written nor closed: some
/// ranks know of the failure and others wait for them within MPI-IO. So a rank that fails throws at
/// once, the file stays open, and the job must end by abort.
class SharedFile {
 public:
  /// Collective.
  SharedFile(const std::filesystem::path& path,
             const std::vector<DatasetRule>& rules,
             const Communicator& communicator,
             const MpiIoHints& hints)
      : path_(path), rules_(rules), communicator_(communicator) {
    all_or_none(communicator_, [&] {
      naming_file(path_, [&] {
        const Handle access = hdf5::file_access();
        const MpiInfo info(hints);
        hdf5::hold_chunk_index(access, hdf5::chunk_count(rules_));
        checked(H5Pset_fapl_mpio(access, communicator_.impl().handle, info.handle()),
                "H5Pset_fapl_mpio");
        file_ = checked(H5Fopen(path_.c_str(), H5F_ACC_RDWR, access), "H5Fopen");
      });
    });
  }

  /// Collective. Writes the blocks of all ranks, slab by slab, one block of every rank at a time.
  void write(std::vector<IndexBlock>& blocks) {
    std::vector<std::uint64_t> most_blocks(rules_.size(), 0);
    for (const IndexBlock& block : blocks) ++most_blocks[block.slab];
    communicator_.maximum(most_blocks);
    for (std::size_t k = 0; k < rules_.size(); ++k) {
      if (most_blocks[k] == 0) continue;
      std::vector<IndexBlock*> of_slab;
      for (IndexBlock& block : blocks)
        if (block.slab == k) of_slab.push_back(&block);
      naming_file(path_, [&] {
        const Handle dataset(
            H5Dopen2(file_, rules_[k].name.c_str(), H5P_DEFAULT), H5Dclose, "H5Dopen2");
        for (std::size_t i = 0; i < most_blocks[k]; ++i)
          write_block(dataset, rules_[k], i < of_slab.size() ? of_slab[i] : nullptr);
      });
    }
  }

  /// Collective.
  void close() {
    naming_file(path_,
                [&] { checked(H5Fclose(std::exchange(file_, H5I_INVALID_HID)), "H5Fclose"); });
  }

 private:
  const std::filesystem::path& path_;
  const std::vector<DatasetRule>& rules_;
  const Communicator& communicator_;
  hid_t file_ = H5I_INVALID_HID;
};

/// Collective. Writes blocks in rounds until no rank has any; returns the hash sums of each slab
/// over all ranks.
std::vector<std::uint64_t> write_rounds(SharedFile& file,
                                        const std::vector<DatasetRule>& rules,
                                        const NextBlocks& next_blocks,
                                        const Communicator& communicator) {
  std::vector<std::uint64_t> sums(rules.size(), 0);
  for (int round = 1;; ++round) {
    std::vector<IndexBlock> blocks = all_or_none(communicator, [&] {
      std::vector<IndexBlock> next = next_blocks();
      check_blocks(next, rules);
      return next;
    });
    std::array<std::uint64_t, 1> any{blocks.empty() ? std::uint64_t{0} : 1};
    communicator.maximum(any);
    if (any[0] == 0) break;
    for (const IndexBlock& block : blocks)
      for_each_run(block,
                   rules[block.slab],
                   [&](std::uint64_t first_tile, std::span<const std::uint16_t> indices) {
                     sums[block.slab] += hash_sum(first_tile, indices);
                   });
    const WorkNote note("writing round " + std::to_string(round) + " of the indices");
    file.write(blocks);
  }
  communicator.sum(sums);
  return sums;
}

/// Collective.
std::vector<std::uint64_t> write_indices(const std::filesystem::path& path,
                                         const std::vector<DatasetRule>& rules,
                                         const NextBlocks& next_blocks,
                                         const Communicator& communicator,
                                         const MpiIoHints& hints) {
  SharedFile file(path, rules, communicator, hints);
  try {
    auto sums = write_rounds(file, rules, next_blocks, communicator);
    file.close();
    return sums;
  } catch (const Error& error) {
    // A stop is thrown on every rank, and nothing is wrong with the file.
    if (error.exit_code() == ExitCode::Stopped) file.close();
    throw;
  }
}

// --- reading back --------------------------------------------------------------------------------

/// Planes of equal u that the chunks of a dataset span.
std::uint64_t planes_of_chunk(hid_t dataset) {
  const Handle creation(H5Dget_create_plist(dataset), H5Pclose, "H5Dget_create_plist");
  std::array<hsize_t, 4> chunk = {1, 1, 1, 1};
  if (H5Pget_layout(creation) == H5D_CHUNKED)
    checked(H5Pget_chunk(creation, 4, chunk.data()), "H5Pget_chunk");
  return chunk[0];
}

/// Reads the planes [u] of an index dataset one after the other, as many at once as its chunks
/// span, into `planes_of(u, count)`, which returns memory for them, and calls `done(u, planes)`.
template <typename PlanesOf, typename Done>
void read_planes(hid_t dataset, const DatasetRule& rule, PlanesOf&& planes_of, Done&& done) {
  const Handle in_file(H5Dget_space(dataset), H5Sclose, "H5Dget_space");
  std::array<hsize_t, 4> start{};
  std::array<hsize_t, 4> count = {1, rule.extents[1], rule.extents[2], rule.extents[3]};
  const std::uint64_t at_once = planes_of_chunk(dataset);
  hdf5::ChunkShape chunk{};
  const bool is_coded = hdf5::is_coded(dataset, chunk);
  for (std::uint64_t u = 0; u < rule.extents[0]; u += count[0]) {
    start[0] = u;
    count[0] = std::min(at_once, rule.extents[0] - u);
    const Handle in_memory(
        H5Screate_simple(4, count.data(), nullptr), H5Sclose, "H5Screate_simple");
    checked(
        H5Sselect_hyperslab(in_file, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr),
        "H5Sselect_hyperslab");
    const std::span<std::uint16_t> planes = planes_of(u, count[0]);
    if (is_coded)
      hdf5::read_coded_planes(dataset, rule, chunk, u, count[0], planes);
    else
      checked(H5Dread(dataset, H5T_NATIVE_UINT16, in_memory, in_file, H5P_DEFAULT, planes.data()),
              "H5Dread");
    done(u, std::span<const std::uint16_t>(planes));
    note_progress();
  }
}

std::string payload_hash(std::span<const Dataset> datasets,
                         const std::vector<DatasetRule>& rules,
                         const std::vector<std::string>& index_sha256) {
  std::string lines;
  for (const Dataset& dataset : datasets)
    lines += field_layout::payload_line(dataset.rule, sha256_hex(dataset.bytes));
  for (std::size_t k = 0; k < rules.size(); ++k)
    lines += field_layout::payload_line(rules[k], index_sha256[k]);
  return sha256_hex(std::as_bytes(std::span(lines)));
}

/// Rank 0 alone: reads every index back, compares with what the ranks wrote, and stores the hashes
/// and the provenance.
std::string verify_and_seal(const FileContents& contents,
                            const FieldProvenance& provenance,
                            const std::vector<std::uint64_t>& written_sums,
                            const std::filesystem::path& path) {
  Handle file = hdf5::open_file(path, H5F_ACC_RDWR);
  const std::vector<DatasetRule>& rules = contents.indices;
  std::vector<std::string> index_sha256;
  for (std::size_t k = 0; k < rules.size(); ++k) {
    const Handle dataset(H5Dopen2(file, rules[k].name.c_str(), H5P_DEFAULT), H5Dclose, "H5Dopen2");
    const std::uint64_t plane_tiles = tile_count_of(rules[k]) / rules[k].extents[0];
    std::vector<std::uint16_t> planes;
    Sha256 sha256;
    std::uint64_t sum = 0;
    read_planes(
        dataset,
        rules[k],
        [&](std::uint64_t, std::uint64_t count) {
          planes.resize(count * plane_tiles);
          return std::span(planes);
        },
        [&](std::uint64_t u, std::span<const std::uint16_t> indices) {
          sha256.update(std::as_bytes(indices));
          sum += hash_sum(u * plane_tiles, indices);
        });
    if (sum != written_sums[k])
      throw FileError(
          path.string(), rules[k].name, "the indices written", "others on reading back");
    index_sha256.push_back(sha256.hex_digest());
    hdf5::replace_text_attribute(dataset, "sha256", index_sha256.back());
  }
  std::string payload = payload_hash(contents.payload, rules, index_sha256);
  hdf5::replace_text_attribute(file, "payload_sha256", payload);
  hdf5::write_text_attribute(file, "options_toml", provenance.options_toml);
  hdf5::write_text_attribute(file, "source_version", provenance.source_version);
  for (const Dataset& dataset : field_layout::datasets_of(provenance))
    hdf5::write_dataset(file, dataset, sha256_hex(dataset.bytes));
  file.close("H5Fclose");
  return payload;
}

void share(FieldFileInfo& info, const Communicator& communicator) {
  communicator.broadcast(info.payload_sha256);
  std::array<std::uint64_t, 1> bytes{communicator.is_root() ? info.file_bytes : 0};
  communicator.maximum(bytes);
  info.file_bytes = bytes[0];
}

// --- reading -------------------------------------------------------------------------------------

/// A field of a file, before its indices are read.
struct FieldHeader {
  std::vector<Dataset> payload;   ///< with the codebook, which an atlas's members share
  std::vector<Dataset> range;     ///< empty: two numbers of the payload state it
  std::vector<Dataset> material;  ///< empty: all of the CT
  std::vector<DatasetRule> index_rules;
  std::vector<std::string> index_sha256;

  auto members() { return std::tie(payload, range, material, index_sha256); }
  /// Without indices. FileError.
  [[nodiscard]] CompressedAttenuationField field(const std::string& path) const {
    CompressedAttenuationField field = field_layout::field_of(payload, path);
    if (!range.empty())
      field.identity.range = field_layout::range_of(range, field.identity.range, path);
    if (!material.empty())
      field.identity.material = field_layout::material_of(material.front(), path);
    return field;
  }
};

/// What rank 0 knows of a file before the indices are read.
struct FileHeader {
  bool is_atlas = false;
  std::vector<FieldHeader> fields;  ///< one, or an atlas's members
  std::vector<Dataset> root;        ///< of an atlas: atlas_rules()
  std::vector<Dataset> root_range;  ///< of an atlas
  std::vector<Dataset> provenance;
  std::string payload_sha256;
  std::uint64_t file_bytes = 0;
  IndexPacking packing = IndexPacking::CodebookTree;
  bool has_means = false;

  auto members() {
    return std::tie(is_atlas,
                    fields,
                    root,
                    root_range,
                    provenance,
                    payload_sha256,
                    file_bytes,
                    packing,
                    has_means);
  }
  /// Of an atlas. FileError.
  [[nodiscard]] AttenuationAtlas atlas(const std::string& path) const {
    AttenuationAtlas atlas = field_layout::atlas_of(root, path);
    if (!root_range.empty())
      atlas.identity.range = field_layout::range_of(root_range, atlas.identity.range, path);
    for (const FieldHeader& header : fields) {
      CompressedAttenuationField field = header.field(path);
      atlas.members.push_back({std::move(field.identity), std::move(field.light_slab)});
    }
    return atlas;
  }
};

void check_is_hdf5(const std::filesystem::path& path) {
  require_regular_file(path);
  std::error_code error;
  if (std::filesystem::file_size(path, error) == 0) throw FileError(path.string(), "is empty");
  if (::access(path.c_str(), R_OK) != 0)
    throw FileError(path.string(), std::string("cannot be read: ") + std::strerror(errno));
  if (H5Fis_hdf5(path.c_str()) <= 0)
    throw FileError(path.string(), "is not an HDF5 file (or its first bytes are damaged)");
}

bool is_atlas_format(hid_t file, const std::filesystem::path& path) {
  const std::string expected =
      std::string(field_layout::kFormat) + " or " + field_layout::kAtlasFormat;
  if (H5Aexists(file, "format") <= 0)
    throw FileError(path.string(), "attribute format", expected, "none");
  const std::string format = hdf5::read_text_attribute(file, "format");
  if (format == field_layout::kAtlasFormat) return true;
  if (format != field_layout::kFormat)
    throw FileError(path.string(), "attribute format", expected, format);
  return false;
}

/// What a file's version and attributes say of its indices.
struct StoredCoding {
  IndexPacking packing = IndexPacking::CodebookTree;
  bool has_means = false;
};

/// A text attribute that a version asks for, one of `known`.
std::string required_attribute(hid_t file,
                               const char* name,
                               const std::vector<std::string>& known,
                               const std::filesystem::path& path) {
  const std::string found =
      H5Aexists(file, name) > 0 ? hdf5::read_text_attribute(file, name) : "none";
  for (const std::string& text : known)
    if (found == text) return found;
  std::string expected = known.front();
  for (std::size_t i = 1; i < known.size(); ++i) expected += " or " + known[i];
  throw FileError(path.string(), std::string("attribute ") + name, expected, found);
}

StoredCoding checked_coding(hid_t file, const std::filesystem::path& path) {
  const int version = hdf5::read_int_attribute(file, "format_version");
  if (version < 1 || version > field_layout::kFormatVersion)
    throw FileError(path.string(),
                    "attribute format_version",
                    "1 to " + std::to_string(field_layout::kFormatVersion),
                    std::to_string(version));
  if (version != field_layout::kFormatVersionWithMeans)
    return {version == field_layout::format_version_of(IndexPacking::Deflate, false)
                ? IndexPacking::Deflate
                : IndexPacking::CodebookTree,
            false};
  required_attribute(file, field_layout::kTileCodingAttribute, {field_layout::kMeanRemoved}, path);
  const char* const deflate = field_layout::to_string(IndexPacking::Deflate);
  const std::string packing =
      required_attribute(file,
                         field_layout::kPackingAttribute,
                         {field_layout::to_string(IndexPacking::CodebookTree), deflate},
                         path);
  return {packing == deflate ? IndexPacking::Deflate : IndexPacking::CodebookTree, true};
}

/// Whether a file of this size can hold so many indices at all; refuses before memory is asked for.
void check_plausible_size(const DatasetRule& rule,
                          std::uint64_t file_bytes,
                          const std::filesystem::path& path) {
  // Empty tiles have no means of their own.
  const std::uint64_t needed =
      tile_count_of(rule) / rule.rows_per_tile * sizeof(std::uint16_t) / kMaxPackingRatio;
  if (needed > file_bytes)
    throw FileError(path.string(),
                    rule.name,
                    "at least " + std::to_string(needed) + " bytes",
                    "a file of " + std::to_string(file_bytes));
}

/// A file's version and its indices say the same of how they are packed.
void check_packing(hid_t dataset,
                   const DatasetRule& rule,
                   IndexPacking packing,
                   const std::filesystem::path& path) {
  hdf5::ChunkShape chunk{};
  const auto text = [&](IndexPacking of) {
    if (rule.rows_per_tile > 1) return std::string(field_layout::to_string(of));
    return "indices packed as in version " +
           std::to_string(field_layout::format_version_of(of, false));
  };
  const IndexPacking found =
      hdf5::is_coded(dataset, chunk) ? IndexPacking::CodebookTree : IndexPacking::Deflate;
  if (found != packing) throw FileError(path.string(), rule.name, text(packing), text(found));
}

std::vector<Dataset> read_datasets(hid_t file,
                                   const std::vector<DatasetRule>& rules,
                                   const std::string& path) {
  std::vector<Dataset> datasets;
  for (const DatasetRule& rule : rules) datasets.push_back(hdf5::read_dataset(file, rule, path));
  return datasets;
}

/// Of a group, "" for the root; none where the file has none.
std::vector<Dataset> read_range(hid_t file, const std::string& group, const std::string& path) {
  if (checked(H5Lexists(file, (group + "/range").c_str(), H5P_DEFAULT), "H5Lexists") <= 0)
    return {};
  return read_datasets(file, field_layout::within(group, field_layout::range_rules()), path);
}

/// The field of a group, "" for the root. `shared`: what stands in the root for all of an atlas.
FieldHeader read_field_of(hid_t file,
                          const std::string& group,
                          std::span<const Dataset> shared,
                          const FileHeader& of_file,
                          const std::filesystem::path& path) {
  const auto of_group = [&](std::vector<DatasetRule> rules) {
    return field_layout::within(group, std::move(rules));
  };
  FieldHeader header;
  const DatasetRule slab_count = of_group({field_layout::slab_count_rule()}).front();
  const int slabs = field_layout::slab_count_of(hdf5::read_dataset(file, slab_count, path.string()),
                                                path.string());
  header.payload =
      read_datasets(file,
                    of_group(shared.empty() ? field_layout::payload_rules(slabs, of_file.has_means)
                                            : field_layout::member_rules(slabs)),
                    path.string());
  header.payload.insert(header.payload.end(), shared.begin(), shared.end());
  header.range = read_range(file, group, path.string());
  const DatasetRule material = of_group({field_layout::material_rule()}).front();
  if (checked(H5Lexists(file, material.name.c_str(), H5P_DEFAULT), "H5Lexists") > 0)
    header.material.push_back(hdf5::read_dataset(file, material, path.string()));
  header.index_rules = of_group(index_rules(header.field(path.string())));
  for (const DatasetRule& rule : header.index_rules) {
    check_plausible_size(rule, of_file.file_bytes, path);
    std::vector<std::uint64_t> extents;
    const Handle dataset = hdf5::open_dataset(file, rule, path.string(), extents);
    check_packing(dataset, rule, of_file.packing, path);
    header.index_sha256.push_back(hdf5::read_text_attribute(dataset, "sha256"));
  }
  return header;
}

/// The root of an atlas, and its members.
void read_members(hid_t file, const std::filesystem::path& path, FileHeader& header) {
  header.root = read_datasets(file, field_layout::atlas_rules(header.has_means), path.string());
  header.root_range = read_range(file, "", path.string());
  const auto shared =
      std::span<const Dataset>(header.root).last(field_layout::shared_rules(header.has_means));
  const int members = field_layout::member_count_of(header.root.front(), path.string());
  for (int i = 0; i < members; ++i)
    header.fields.push_back(read_field_of(
        file, field_layout::member_group(static_cast<std::size_t>(i)), shared, header, path));
}

/// Of everything that a file says of its content.
std::string payload_hash(const FileHeader& header) {
  std::vector<Dataset> datasets = header.root;
  std::vector<DatasetRule> rules;
  std::vector<std::string> index_sha256;
  const std::size_t shared = header.is_atlas ? field_layout::shared_rules(header.has_means) : 0;
  for (const FieldHeader& field : header.fields) {
    datasets.insert(datasets.end(),
                    field.payload.begin(),
                    field.payload.end() - static_cast<std::ptrdiff_t>(shared));
    rules.insert(rules.end(), field.index_rules.begin(), field.index_rules.end());
    index_sha256.insert(index_sha256.end(), field.index_sha256.begin(), field.index_sha256.end());
  }
  return payload_hash(datasets, rules, index_sha256);
}

/// An atlas is of one CT, all of it, and so are its members.
void require_same_origin(const AttenuationAtlas& atlas, const std::filesystem::path& path) {
  const FieldIdentity& all = atlas.identity;
  for (std::size_t i = 0; i < atlas.members.size(); ++i) {
    const FieldIdentity& one = atlas.members[i].identity;
    if (one.ct_content_sha256 != all.ct_content_sha256)
      throw FileError(path.string(),
                      field_layout::member_group(i) + "/identity/ct_content_sha256",
                      all.ct_content_sha256,
                      one.ct_content_sha256);
    if (one.mu_water_per_mm != all.mu_water_per_mm || one.air_below_hu != all.air_below_hu)
      throw FileError(path.string(),
                      field_layout::member_group(i) + "/identity",
                      "the attenuation of water and of air of the atlas",
                      "others");
    if (one.material != FieldMaterial::All)
      throw FileError(path.string(),
                      field_layout::member_group(i) + "/material",
                      "none: members of an atlas hold all of the CT",
                      "bone alone");
  }
}

/// Rank 0 alone.
FileHeader read_header(const std::filesystem::path& path) {
  check_is_hdf5(path);
  note_input(path);
  const Handle file = hdf5::open_file(path, H5F_ACC_RDONLY);
  FileHeader header;
  header.is_atlas = is_atlas_format(file, path);
  const StoredCoding coding = checked_coding(file, path);
  header.packing = coding.packing;
  header.has_means = coding.has_means;
  header.file_bytes = std::filesystem::file_size(path);
  if (header.is_atlas)
    read_members(file, path, header);
  else
    header.fields.push_back(read_field_of(file, "", {}, header, path));
  header.provenance = read_datasets(file, field_layout::provenance_rules(), path.string());
  header.payload_sha256 = hdf5::read_text_attribute(file, "payload_sha256");
  const std::string computed = payload_hash(header);
  if (header.payload_sha256 != computed)
    throw FileError(path.string(), "payload_sha256", header.payload_sha256, computed);
  const std::string ct_sha256 = hdf5::read_text_attribute(file, "ct_sha256");
  const FieldIdentity identity = header.is_atlas ? header.atlas(path.string()).identity
                                                 : header.fields[0].field(path.string()).identity;
  if (ct_sha256 != identity.ct_content_sha256)
    throw FileError(path.string(), "attribute ct_sha256", identity.ct_content_sha256, ct_sha256);
  if (header.is_atlas) require_same_origin(header.atlas(path.string()), path);
  return header;
}

/// Rank 0 alone. Of one kind: FileError when the file is of the other.
FileHeader read_header_of(bool atlas, const std::filesystem::path& path) {
  FileHeader header = read_header(path);
  if (header.is_atlas == atlas) return header;
  const auto text = [](bool is_atlas) {
    return is_atlas ? field_layout::kAtlasFormat : field_layout::kFormat;
  };
  throw FileError(path.string(), "attribute format", text(atlas), text(header.is_atlas));
}

/// Collective. Rank 0's header on every rank.
FileHeader shared_header(bool atlas,
                         const std::filesystem::path& path,
                         const Communicator& communicator) {
  FileHeader header;
  all_or_none(communicator, [&] {
    if (communicator.is_root())
      header = naming_file(path, [&] { return read_header_of(atlas, path); });
  });
  std::vector<std::byte> bytes = bytes_of(header);
  communicator.broadcast(bytes);
  if (communicator.is_root()) return header;
  header = value_of<FileHeader>(bytes, "the header from rank 0");
  for (std::size_t i = 0; i < header.fields.size(); ++i)
    header.fields[i].index_rules =
        field_layout::within(atlas ? field_layout::member_group(i) : "",
                             index_rules(header.fields[i].field(path.string())));
  return header;
}

/// What a file's header says of it.
FieldFileInfo info_of(const FileHeader& header,
                      std::uint64_t payload_bytes,
                      const std::filesystem::path& path) {
  const FieldProvenance provenance = field_layout::provenance_of(header.provenance);
  return {provenance,
          header.payload_sha256,
          header.file_bytes,
          payload_bytes,
          field_layout::look_up_of(provenance, path.string()),
          header.packing};
}

/// Reads and verifies the indices of one slab into memory for all of them.
void read_indices(const std::filesystem::path& path,
                  const DatasetRule& rule,
                  const std::string& expected_sha256,
                  const Codebook& codebook,
                  std::span<std::uint16_t> indices) {
  const Handle file = hdf5::open_file(path, H5F_ACC_RDONLY);
  std::vector<std::uint64_t> extents;
  const Handle dataset = hdf5::open_dataset(file, rule, path.string(), extents);
  const std::size_t plane = indices.size() / rule.extents[0];
  Sha256 sha256;
  std::vector<std::string> found;
  read_planes(
      dataset,
      rule,
      [&](std::uint64_t u, std::uint64_t count) {
        return indices.subspan(u * plane, count * plane);
      },
      [&](std::uint64_t, std::span<const std::uint16_t> values) {
        sha256.update(std::as_bytes(values));
        if (found.empty()) found = index_problems(values, rule.extents[3], codebook, rule.name);
      });
  const std::string computed = sha256.hex_digest();
  if (computed != expected_sha256)
    throw FileError(path.string(), rule.name, "sha256 " + expected_sha256, computed);
  if (!found.empty()) throw FileError(path.string(), found.front());
}

/// Collective. The indices of one slab, held once per node; rank 0 reads them for all.
CompressedSlab read_slab(const std::filesystem::path& path,
                         const DatasetRule& rule,
                         const std::string& sha256,
                         const Codebook& codebook,
                         const Communicator& communicator) {
  const std::size_t tiles = tile_count_of(rule);
  const auto memory = communicator.allocate_on_nodes_from_root(
      tiles * sizeof(std::uint16_t), [&](std::span<std::byte> bytes) {
        naming_file(path, [&] {
          read_indices(path,
                       rule,
                       sha256,
                       codebook,
                       {reinterpret_cast<std::uint16_t*>(bytes.data()), tiles});
        });
      });
  const auto* first = reinterpret_cast<const std::uint16_t*>(memory.get());
  return {SharedArray<std::uint16_t>(memory, {first, tiles})};
}

/// Collective. What write_field() and write_atlas() promise.
FieldFileInfo write_file(const FileContents& contents,
                         const Codebook& codebook,
                         const NextBlocks& next_blocks,
                         const MakeProvenance& make_provenance,
                         const std::filesystem::path& path,
                         const Communicator& communicator,
                         const MpiIoHints& hints) {
  const hdf5::QuietErrors quiet;
  std::optional<hdf5::IndexFilter> filter;
  all_or_none(communicator, [&] { filter.emplace(codebook); });
  const std::filesystem::path partial = field_layout::unfinished_path(path);
  FieldFileInfo info;
  info.payload_bytes = contents.payload_bytes;
  info.packing = contents.packing;
  // Before the part that removes the partial file when it fails: it may be none of ours.
  all_or_none(communicator, [&] {
    if (communicator.is_root()) check_output_file(path, partial);
  });
  try {
    all_or_none(communicator, [&] {
      if (!communicator.is_root()) return;
      const WorkNote note("making " + partial.string());
      lay_out(partial, hints);
      naming_file(partial, [&] { create_file_without_indices(contents, partial); });
    });
    const auto sums = write_indices(partial, contents.indices, next_blocks, communicator, hints);
    info.provenance = make_provenance();
    all_or_none(communicator, [&] {
      if (!communicator.is_root()) return;
      const WorkNote note("reading " + partial.string() + " back to verify it");
      info.payload_sha256 = naming_file(
          partial, [&] { return verify_and_seal(contents, info.provenance, sums, partial); });
      move_into_place(partial, path);
      info.file_bytes = std::filesystem::file_size(path);
    });
  } catch (const Error& error) {
    // HDF5 would try again to write what could not be written, when MPI is finalised.
    if (error.exit_code() != ExitCode::Stopped) MpiEnvironment::require_abort();
    std::error_code ignored;
    if (communicator.is_root()) std::filesystem::remove(partial, ignored);
    throw;
  }
  share(info, communicator);
  return info;
}

/// Collective. A field of a file with its indices.
std::shared_ptr<const CompressedAttenuationField> field_with_indices(
    const FieldHeader& header,
    const std::filesystem::path& path,
    const Communicator& communicator) {
  auto field = std::make_shared<CompressedAttenuationField>(header.field(path.string()));
  std::optional<hdf5::IndexFilter> filter;
  all_or_none(communicator, [&] {
    if (communicator.is_root()) filter.emplace(field->codebook);
  });
  for (std::size_t k = 0; k < header.index_rules.size(); ++k)
    field->slabs.push_back(all_or_none(communicator, [&] {
      return read_slab(
          path, header.index_rules[k], header.index_sha256[k], field->codebook, communicator);
    }));
  all_or_none(communicator, [&] {
    if (!communicator.is_root()) return;
    const auto found = problems(*field);
    if (!found.empty()) throw FileError(path.string(), found.front());
  });
  return field;
}

}  // namespace

void announce_field(const std::filesystem::path& path) {
  for (const std::filesystem::path& written : {path, field_layout::io_test_path(path)}) {
    check_output_file(written, field_layout::unfinished_path(written));
    announce_output_file(written);
    announce_output_file(field_layout::unfinished_path(written));
  }
}

FieldFileInfo write_field(const CompressedAttenuationField& field,
                          const NextBlocks& next_blocks,
                          const MakeProvenance& make_provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator,
                          const MpiIoHints& hints,
                          IndexPacking packing) {
  return write_file(contents_of(field, packing),
                    field.codebook,
                    next_blocks,
                    make_provenance,
                    path,
                    communicator,
                    hints);
}

FieldFileInfo write_atlas(const AttenuationAtlas& atlas,
                          const NextBlocks& next_blocks,
                          const MakeProvenance& make_provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator,
                          const MpiIoHints& hints,
                          IndexPacking packing) {
  return write_file(contents_of(atlas, packing),
                    atlas.codebook,
                    next_blocks,
                    make_provenance,
                    path,
                    communicator,
                    hints);
}

FieldFileInfo write_field(const CompressedAttenuationField& field,
                          const std::vector<IndexBlock>& my_blocks,
                          const FieldProvenance& provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator,
                          const MpiIoHints& hints,
                          IndexPacking packing) {
  std::vector<IndexBlock> left = my_blocks;
  return write_field(
      field,
      [&] { return std::exchange(left, {}); },
      [&] { return provenance; },
      path,
      communicator,
      hints,
      packing);
}

void share_geometry(LightSlab& light_slab, const Communicator& communicator) {
  std::vector<std::byte> bytes = bytes_of(field_layout::geometry_datasets(light_slab));
  communicator.broadcast(bytes);
  field_layout::set_geometry(value_of<std::vector<Dataset>>(bytes, "the geometry of rank 0"),
                             "the geometry of rank 0",
                             light_slab);
}

CompressedAttenuationField read_field_header(const std::filesystem::path& path) {
  const hdf5::QuietErrors quiet;
  return naming_file(
      path, [&] { return read_header_of(false, path).fields.front().field(path.string()); });
}

std::filesystem::path bone_field_path(const std::filesystem::path& path) {
  std::string name = path.filename().string();
  std::size_t ending = name.find(".af.h5");
  if (ending == std::string::npos) ending = name.rfind('.');
  name.insert(std::min(ending, name.size()), ".bone");
  return path.parent_path() / name;
}

std::shared_ptr<const CompressedAttenuationField> read_field(const std::filesystem::path& path,
                                                             const Communicator& communicator,
                                                             FieldFileInfo* info) {
  auto field = read_field_of_any_material(path, communicator, info);
  all_or_none(communicator, [&] {
    if (field->identity.material != FieldMaterial::All)
      throw FileError(path.string(), "/material", "a field of all of the CT", "of its bone alone");
  });
  return field;
}

std::shared_ptr<const CompressedAttenuationField> read_bone_field(
    const std::filesystem::path& path,
    const CompressedAttenuationField& of_all,
    const Communicator& communicator,
    FieldFileInfo* info) {
  all_or_none(communicator, [&] {
    if (!std::filesystem::exists(path))
      throw FileError(path.string(),
                      "does not exist: a tube voltage needs the field of the CT's bone, which "
                      "af-precompute --material bone makes with the other options of the field "
                      "beside it");
  });
  auto field = read_field_of_any_material(path, communicator, info);
  const FieldIdentity& wanted = of_all.identity;
  const FieldIdentity& found = field->identity;
  all_or_none(communicator, [&] {
    if (found.material != FieldMaterial::Bone)
      throw FileError(path.string(), "/material", "a field of the CT's bone alone", "of all of it");
    if (found.ct_content_sha256 != wanted.ct_content_sha256)
      throw FileError(path.string(),
                      "CT of the field (ct_content_sha256)",
                      wanted.ct_content_sha256 + " (that of the field of all)",
                      found.ct_content_sha256);
    if (found.mu_water_per_mm != wanted.mu_water_per_mm ||
        found.air_below_hu != wanted.air_below_hu)
      throw FileError(path.string(),
                      "attenuation",
                      "mu_water and the HU that count as air as in the field of all",
                      "others");
  });
  return field;
}

std::shared_ptr<const CompressedAttenuationField> read_field_of_any_material(
    const std::filesystem::path& path, const Communicator& communicator, FieldFileInfo* info) {
  const hdf5::QuietErrors quiet;
  const FileHeader header = shared_header(false, path, communicator);
  auto field = field_with_indices(header.fields.front(), path, communicator);
  const FieldFileInfo said = all_or_none(communicator, [&] {
    return info_of(header, field_layout::payload_bytes(field->codebook, field->lattice()), path);
  });
  if (info != nullptr) *info = said;
  return field;
}

bool is_atlas_file(const std::filesystem::path& path) {
  const hdf5::QuietErrors quiet;
  return naming_file(path, [&] {
    check_is_hdf5(path);
    const Handle file = hdf5::open_file(path, H5F_ACC_RDONLY);
    return is_atlas_format(file, path);
  });
}

AttenuationAtlas read_atlas_header(const std::filesystem::path& path) {
  const hdf5::QuietErrors quiet;
  return naming_file(path, [&] { return read_header_of(true, path).atlas(path.string()); });
}

std::shared_ptr<const AttenuationAtlas> read_atlas(const std::filesystem::path& path,
                                                   const Communicator& communicator,
                                                   FieldFileInfo* info) {
  const hdf5::QuietErrors quiet;
  const FileHeader header = shared_header(true, path, communicator);
  auto atlas = std::make_shared<AttenuationAtlas>(header.atlas(path.string()));
  const FieldFileInfo said = all_or_none(communicator, [&] {
    return info_of(header, field_layout::payload_bytes(atlas->codebook, atlas->lattice()), path);
  });
  if (info != nullptr) *info = said;
  return atlas;
}

std::shared_ptr<const CompressedAttenuationField> read_atlas_member(
    const std::filesystem::path& path,
    std::size_t member,
    const std::string& payload_sha256,
    const Communicator& communicator) {
  static std::mutex one_at_a_time;  // HDF5 and its filter are for one thread
  const std::scoped_lock lock(one_at_a_time);
  const hdf5::QuietErrors quiet;
  const FileHeader header = shared_header(true, path, communicator);
  all_or_none(communicator, [&] {
    if (header.payload_sha256 != payload_sha256)
      throw FileError(path.string(), "payload_sha256", payload_sha256, header.payload_sha256);
  });
  check(member < header.fields.size(), "a member of the atlas");
  return field_with_indices(header.fields[member], path, communicator);
}

}  // namespace af
