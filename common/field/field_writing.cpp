// SPDX-License-Identifier: Apache-2.0
#include "field/field_writing.h"

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <optional>
#include <span>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "field/field_layout.h"
#include "field/hdf5_calls.h"
#include "field/index_chunks.h"
#include "field/index_dataset.h"
#include "field/mpi_io.h"
#include "files/input_guard.h"
#include "files/output_file.h"
#include "files/sha256.h"
#include "ranks/job_end.h"
#include "ranks/root_only.h"
#include "ranks/work_watch.h"

namespace af {

namespace {

using field_layout::Dataset;
using field_layout::DatasetRule;
using field_layout::index_rules;
using field_layout::kSha256Digits;
using field_layout::payload_hash;
using hdf5::checked;
using hdf5::DatasetBlock;
using hdf5::Handle;
using hdf5::hash_sum;
using hdf5::naming_file;

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
    check(block.indices.size() == needed, "an index block has values_per_tile() numbers per tile");
  }
}

/// What a file is to hold except the provenance: a field or an atlas.
struct FileContents {
  const char* format = field_layout::kFormat;
  std::string ct_sha256;
  std::vector<Dataset> payload;
  std::vector<Dataset> beside;  ///< outside the payload: ranges that two numbers cannot state, bone
  std::vector<DatasetRule> indices;
  std::uint64_t payload_bytes = 0;
};

FileContents contents_of(const CompressedAttenuationField& field) {
  FileContents contents = {field_layout::kFormat,
                           field.identity.ct.content_sha256,
                           field_layout::datasets_of(field),
                           field_layout::range_datasets(field.identity.range),
                           index_rules(field),
                           field_layout::payload_bytes(field.codebook, field.lattice())};
  for (Dataset& dataset : field_layout::material_datasets(field.identity.material))
    contents.beside.push_back(std::move(dataset));
  return contents;
}

FileContents contents_of(const AttenuationAtlas& atlas) {
  FileContents contents = {field_layout::kAtlasFormat,
                           atlas.identity.ct.content_sha256,
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
    append(field_layout::within(group, field_layout::material_datasets(member.identity.material)),
           contents.beside);
  }
  return contents;
}

/// For rank 0 alone. Writes everything but the indices and the provenance.
void create_file_without_indices(const FileContents& contents, const std::filesystem::path& path) {
  Handle file = hdf5::create_file(path);
  hdf5::write_text_attribute(file, "format", contents.format);
  hdf5::write_int_attribute(file, "format_version", field_layout::kFormatVersion);
  hdf5::write_text_attribute(file, "ct_sha256", contents.ct_sha256);
  hdf5::write_text_attribute(file, "payload_sha256", std::string(kSha256Digits, '0'));
  for (const std::vector<Dataset>* datasets : {&contents.payload, &contents.beside})
    for (const Dataset& dataset : *datasets)
      hdf5::write_dataset(file, dataset, sha256_hex(dataset.bytes));
  const std::vector<hdf5::ChunkShape> chunks = hdf5::index_chunks(contents.indices);
  for (std::size_t k = 0; k < contents.indices.size(); ++k)
    hdf5::create_tiles(file, contents.indices[k], chunks[k]);
  file.close("H5Fclose");
}

/// The file that all ranks have open. After a failed write it can neither be written nor closed:
/// some ranks know of the failure, and others wait for them within MPI-IO. A rank that fails
/// therefore throws at once, the file stays open, and the job must end by abort.
class SharedFile {
 public:
  /// Collective.
  SharedFile(const std::filesystem::path& path,
             const std::vector<DatasetRule>& rules,
             const Communicator& communicator,
             const MpiIoHints& hints)
      : path_(path), rules_(rules), communicator_(communicator) {
    all_or_none(communicator_, [&] {
      if (!writes_by_mpi_ && !communicator_.is_root()) return;
      naming_file(path_, [&] {
        const Handle access = hdf5::file_access();
        hdf5::hold_chunk_index(access, hdf5::chunk_count(rules_));
        if (writes_by_mpi_) hdf5::open_by_mpi(access, communicator_, hints);
        file_ = checked(H5Fopen(path_.c_str(), H5F_ACC_RDWR, access), "H5Fopen");
      });
    });
  }

  /// Collective. Writes the blocks of all ranks slab by slab, one block of every rank at a time.
  /// Without MPI-IO rank 0 writes them all.
  void write(std::vector<IndexBlock>& blocks) {
    std::vector<std::uint64_t> most_blocks(rules_.size(), 0);
    for (const IndexBlock& block : blocks) ++most_blocks[block.slab];
    communicator_.maximum(most_blocks);
    for (std::size_t k = 0; k < rules_.size(); ++k) {
      if (most_blocks[k] == 0) continue;
      std::vector<IndexBlock*> of_slab;
      for (IndexBlock& block : blocks)
        if (block.slab == k) of_slab.push_back(&block);
      if (writes_by_mpi_)
        write_together(k, of_slab, most_blocks[k]);
      else
        write_on_root(k, of_slab, most_blocks[k]);
    }
  }

  /// Collective. Open MPI may silently lose what a collective write could not store. Then this
  /// fails, or what is read back differs.
  void close() {
    const WorkNote note("closing the file that all ranks wrote");
    if (file_ == H5I_INVALID_HID) return;
    naming_file(path_,
                [&] { checked(H5Fclose(std::exchange(file_, H5I_INVALID_HID)), "H5Fclose"); });
  }

 private:
  void write_together(std::size_t slab, std::span<IndexBlock* const> mine, std::size_t most) {
    naming_file(path_, [&] {
      const hdf5::StoredTiles tiles(file_, rules_[slab], path_.string(), hdf5::Writers::AllRanks);
      for (std::size_t i = 0; i < most; ++i) {
        if (i >= mine.size()) {
          tiles.write(nullptr, {});
          continue;
        }
        const DatasetBlock block = in_dataset(*mine[i], rules_[slab]);
        tiles.write(&block, std::exchange(mine[i]->indices, {}));
      }
    });
  }

  /// Rank 0 gets one block at a time: no rank has room for the blocks of all.
  void write_on_root(std::size_t slab, std::span<IndexBlock* const> mine, std::size_t most) {
    std::optional<hdf5::StoredTiles> tiles;
    const auto if_root = [&](const std::function<void()>& action) {
      if (communicator_.is_root()) naming_file(path_, action);
    };
    if_root([&] { tiles.emplace(file_, rules_[slab], path_.string()); });
    for (std::size_t i = 0; i < most; ++i)
      for (int rank = 0; rank < communicator_.size(); ++rank) {
        std::vector<IndexBlock> next;
        if (rank == communicator_.rank() && i < mine.size()) next.push_back(std::move(*mine[i]));
        const std::vector<IndexBlock> blocks = at_root(rank, std::move(next));
        if_root([&] {
          for (const IndexBlock& block : blocks) {
            const DatasetBlock values = in_dataset(block, rules_[slab]);
            tiles->write(&values, block.indices);
          }
        });
      }
    if_root([&] { tiles->close(); });
  }

  /// Collective. What `rank` gives, on rank 0.
  [[nodiscard]] std::vector<IndexBlock> at_root(int rank, std::vector<IndexBlock> blocks) const {
    if (rank == 0) return blocks;
    const bool is_sender = communicator_.rank() == rank;
    const auto of_ranks =
        communicator_.all_gather(is_sender ? bytes_of(blocks) : std::vector<std::byte>());
    if (!communicator_.is_root()) return {};
    return value_of<std::vector<IndexBlock>>(of_ranks[static_cast<std::size_t>(rank)],
                                             "index blocks of a rank");
  }

  const std::filesystem::path& path_;
  const std::vector<DatasetRule>& rules_;
  const Communicator& communicator_;
  bool writes_by_mpi_ = hdf5::writes_by_mpi(communicator_);
  hid_t file_ = H5I_INVALID_HID;
};

/// Collective. Writes blocks in rounds until no rank has any. Returns the hash sums of each slab
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
                   [&](std::uint64_t first, std::span<const std::uint16_t> values) {
                     sums[block.slab] += hash_sum(first, values);
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
    // A stop is thrown on every rank, and the file is intact.
    if (error.exit_code() == ExitCode::Stopped) file.close();
    throw;
  }
}

/// Reads every index of a slab back, compares with what the ranks wrote, and returns its hash.
std::string verified_sha256(hid_t file,
                            const DatasetRule& rule,
                            std::uint64_t written_sum,
                            const std::filesystem::path& path) {
  const hdf5::StoredTiles tiles(file, rule, path.string());
  const std::uint64_t plane_values = rule.value_count() / rule.extents[0];
  std::vector<std::uint16_t> planes;
  Sha256 sha256;
  std::uint64_t sum = 0;
  tiles.read_planes(
      [&](std::uint64_t, std::uint64_t count) {
        planes.resize(count * plane_values);
        return std::span(planes);
      },
      [&](std::uint64_t u, std::span<const std::uint16_t> indices) {
        sha256.update(std::as_bytes(indices));
        sum += hash_sum(u * plane_values, indices);
      });
  if (sum != written_sum)
    throw FileError(
        path.string(), rule.name, "the indices written", "different indices on reading back");
  return sha256.hex_digest();
}

/// Collective. The hash of every slab's indices, read back. Ranks take the slabs in turn.
std::vector<std::string> verify_indices(const std::vector<DatasetRule>& rules,
                                        const std::vector<std::uint64_t>& written_sums,
                                        const std::filesystem::path& path,
                                        const Communicator& communicator) {
  // On network file systems, ranks see what others wrote only once those have closed the file.
  communicator.barrier();
  const auto ranks = static_cast<std::size_t>(communicator.size());
  const auto mine = all_or_none(communicator, [&] {
    std::vector<std::string> digests;
    const auto rank = static_cast<std::size_t>(communicator.rank());
    if (rank >= rules.size()) return digests;
    const WorkNote note("reading " + path.string() + " back to verify it");
    naming_file(path, [&] {
      const Handle file = hdf5::open_file(path, H5F_ACC_RDONLY);
      for (std::size_t k = rank; k < rules.size(); k += ranks)
        digests.push_back(verified_sha256(file, rules[k], written_sums[k], path));
    });
    return digests;
  });
  const auto of_ranks = communicator.all_gather(bytes_of(mine));
  std::vector<std::string> all(rules.size());
  for (std::size_t rank = 0; rank < ranks; ++rank) {
    auto digests = value_of<std::vector<std::string>>(of_ranks[rank], "hashes of a rank");
    for (std::size_t i = 0; i < digests.size(); ++i) all[rank + i * ranks] = std::move(digests[i]);
  }
  return all;
}

/// For rank 0 alone. Stores the hashes and the provenance.
std::string seal(const FileContents& contents,
                 const FieldProvenance& provenance,
                 const std::vector<std::string>& index_sha256,
                 const std::filesystem::path& path) {
  Handle file = hdf5::open_file(path, H5F_ACC_RDWR);
  const std::vector<DatasetRule>& rules = contents.indices;
  for (std::size_t k = 0; k < rules.size(); ++k)
    hdf5::state_sha256(file, rules[k].name, index_sha256[k]);
  std::string payload = payload_hash(contents.payload, rules, index_sha256);
  hdf5::replace_text_attribute(file, "payload_sha256", payload);
  hdf5::write_text_attribute(file, "options_toml", provenance.options_toml);
  hdf5::write_text_attribute(file, "source_version", provenance.source_version);
  for (const Dataset& dataset : field_layout::datasets_of(provenance))
    hdf5::write_dataset(file, dataset, sha256_hex(dataset.bytes));
  file.close("H5Fclose");
  return payload;
}

/// What is known of a file once it is sealed.
struct SealedFile {
  std::string payload_sha256;
  std::uint64_t file_bytes = 0;

  auto members() { return std::tie(payload_sha256, file_bytes); }
};

/// Collective. What write_field() and write_atlas() promise.
FieldFileInfo write_file(const FileContents& contents,
                         const NextBlocks& next_blocks,
                         const MakeProvenance& make_provenance,
                         const std::filesystem::path& path,
                         const Communicator& communicator,
                         const MpiIoHints& hints) {
  const hdf5::QuietErrors quiet;
  const std::filesystem::path partial = field_layout::unfinished_path(path);
  FieldFileInfo info;
  info.payload_bytes = contents.payload_bytes;
  // This check stays out of the block below, which removes the partial file on failure: it may
  // refuse a file that this program did not make.
  do_on_root(communicator, [&] { check_output_file(path, partial); });
  try {
    do_on_root(communicator, [&] {
      const WorkNote note("making " + partial.string());
      if (hdf5::writes_by_mpi(communicator)) hdf5::lay_out_by_mpi(partial, hints);
      naming_file(partial, [&] { create_file_without_indices(contents, partial); });
    });
    const auto sums = write_indices(partial, contents.indices, next_blocks, communicator, hints);
    info.provenance = make_provenance();
    const auto hashes = verify_indices(contents.indices, sums, partial, communicator);
    const auto seal_on_root = [&] {
      const WorkNote note("sealing " + partial.string());
      std::string payload =
          naming_file(partial, [&] { return seal(contents, info.provenance, hashes, partial); });
      move_into_place(partial, path);
      return SealedFile{std::move(payload), std::filesystem::file_size(path)};
    };
    const Shared<SealedFile> sealed = on_root(communicator, seal_on_root).share();
    info.payload_sha256 = sealed->payload_sha256;
    info.file_bytes = sealed->file_bytes;
  } catch (const Error& error) {
    // HDF5 would retry the failed write when MPI is finalised.
    if (error.exit_code() != ExitCode::Stopped) require_abort();
    std::error_code ignored;
    if (communicator.is_root()) std::filesystem::remove(partial, ignored);
    throw;
  }
  return info;
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
                          const MpiIoHints& hints) {
  return write_file(contents_of(field), next_blocks, make_provenance, path, communicator, hints);
}

FieldFileInfo write_atlas(const AttenuationAtlas& atlas,
                          const NextBlocks& next_blocks,
                          const MakeProvenance& make_provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator,
                          const MpiIoHints& hints) {
  return write_file(contents_of(atlas), next_blocks, make_provenance, path, communicator, hints);
}

FieldFileInfo write_field(const CompressedAttenuationField& field,
                          const std::vector<IndexBlock>& my_blocks,
                          const FieldProvenance& provenance,
                          const std::filesystem::path& path,
                          const Communicator& communicator,
                          const MpiIoHints& hints) {
  std::vector<IndexBlock> left = my_blocks;
  return write_field(
      field,
      [&] { return std::exchange(left, {}); },
      [&] { return provenance; },
      path,
      communicator,
      hints);
}

}  // namespace af
