// SPDX-License-Identifier: Apache-2.0
// Which datasets a field file holds, and what they mean. Internal to field_file, and free of HDF5.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "field/attenuation_atlas.h"
#include "field/compressed_attenuation_field.h"
#include "field/field_file.h"
#include "field/stored_values.h"

namespace af::field_layout {

inline constexpr const char* kFormat = "attenuation-field";
inline constexpr int kFormatVersion = 5;

/// What a codebook has besides its codewords.
struct CodebookParts {
  bool has_means = false;
  bool has_filter = false;

  auto members() { return std::tie(has_means, has_filter); }
};
CodebookParts parts_of(const Codebook& codebook);
/// Datasets that a file has only for these parts.
inline constexpr const char* kMeanStepDataset = "/codebook/mean_step";
inline constexpr const char* kTileFilterDataset = "/codebook/tile_filter";

inline constexpr const char* kAtlasFormat = "attenuation-atlas";
inline constexpr int kMaxSlabs = 64;
inline constexpr int kMaxMembers = 64;
inline constexpr std::size_t kSha256Digits = 64;
inline constexpr std::uint64_t kMaxTextBytes = 16u << 20;

/// Where a field is written until it is complete.
inline std::filesystem::path unfinished_path(const std::filesystem::path& path) {
  return path.string() + ".partial";
}
/// The field that check_parallel_writing() makes.
inline std::filesystem::path io_test_path(const std::filesystem::path& path) {
  return path.string() + ".io-test";
}

/// The rules of all small datasets of the payload, in the fixed order of the payload hash. The
/// indices of the slabs follow them.
std::vector<DatasetRule> payload_rules(int slab_count, const CodebookParts& parts);
DatasetRule slab_count_rule();
DatasetRule index_rule(const FieldLattice& lattice, std::size_t slab, bool has_means);
/// One per slab.
std::vector<DatasetRule> index_rules(const FieldLattice& lattice, bool has_means);
/// How a file stores the codewords that index_rule() describes, in the group of that name.
DatasetRule codewords_rule(const DatasetRule& tiles);
/// How means are stored where tiles have them (rows_per_tile). Means are smooth along t, so they
/// are stored as differences from their predecessors along t, modulo 2^16. Every kMeanRunTiles-th
/// one is stored as it is. t is slower than s, so that neighbouring bytes resemble each other.
DatasetRule means_rule(const DatasetRule& tiles);
std::vector<DatasetRule> index_rules(const CompressedAttenuationField& field);
std::vector<DatasetRule> provenance_rules();

/// The group that holds an atlas member's datasets, laid out as in the root of a field:
/// "/member_3".
std::string member_group(std::size_t member);
/// The same rules, or datasets, with the group in front of their names.
std::vector<DatasetRule> within(const std::string& group, std::vector<DatasetRule> rules);
std::vector<Dataset> within(const std::string& group, std::vector<Dataset> datasets);
DatasetRule member_count_rule();
/// Rules of the payload in the root of an atlas: the identity and, as the last shared_rules() of
/// them, codebook and quantiser. payload_rules() ends with the same ones, so a member's datasets
/// followed by the shared ones are those of a field.
std::vector<DatasetRule> atlas_rules(const CodebookParts& parts);
inline constexpr std::size_t shared_rules(const CodebookParts& parts) {
  return std::size_t{2} + (parts.has_means ? 1u : 0u) + (parts.has_filter ? 1u : 0u);
}
std::vector<Dataset> datasets_of(const AttenuationAtlas& atlas);
/// One per slab of every member, in the order of the atlas's lattice.
std::vector<DatasetRule> index_rules(const AttenuationAtlas& atlas);
/// payload_rules() without the shared ones; and a member's datasets by these rules.
std::vector<DatasetRule> member_rules(int slab_count);
std::vector<Dataset> datasets_of(const AtlasMember& member);
int member_count_of(const Dataset& dataset, const std::string& path);
/// The atlas, without members, from datasets that satisfy atlas_rules(). Throws FileError.
AttenuationAtlas atlas_of(std::span<const Dataset> datasets, const std::string& path);

/// The small payload datasets of a field, in the order of payload_rules().
std::vector<Dataset> datasets_of(const CompressedAttenuationField& field);
std::vector<Dataset> datasets_of(const FieldProvenance& provenance);
/// The datasets of a field's geometry alone, the number of slabs first.
std::vector<Dataset> geometry_datasets(const LightSlab& light_slab);

/// Datasets besides the payload for a motion range that two numbers cannot state; none for other
/// ranges.
std::vector<Dataset> range_datasets(const MotionRange& range);
std::vector<DatasetRule> range_rules();
/// The range that such datasets state. Throws FileError when it is no range, or contradicts the two
/// numbers that the payload states.
MotionRange range_of(std::span<const Dataset> datasets,
                     const MotionRange& stated,
                     const std::string& path);

/// The dataset besides the payload that marks a field of bone alone; none for other fields.
std::vector<Dataset> material_datasets(FieldMaterial material);
DatasetRule material_rule();
/// Throws FileError when the dataset names no material that a field can have.
FieldMaterial material_of(const Dataset& dataset, const std::string& path);

/// Takes the geometry from the first datasets and returns the others. Throws FileError on NaN and
/// infinity.
std::span<const Dataset> set_geometry(std::span<const Dataset> datasets,
                                      const std::string& path,
                                      LightSlab& light_slab);
/// The field, without indices, from datasets that satisfy payload_rules(). Throws FileError when
/// values make no sense: NaN, bad geometry, a codebook out of order, ranges outside the lattice.
CompressedAttenuationField field_of(std::span<const Dataset> datasets, const std::string& path);
FieldProvenance provenance_of(std::span<const Dataset> datasets);
int slab_count_of(const Dataset& dataset, const std::string& path);

/// SHA-256 of a field's content: its datasets, and the hashes of its indices.
std::string payload_hash(std::span<const Dataset> datasets,
                         const std::vector<DatasetRule>& rules,
                         const std::vector<std::string>& index_sha256);

/// Bytes of codebook, indices and means, as stored.
std::uint64_t payload_bytes(const Codebook& codebook, const FieldLattice& lattice);

}  // namespace af::field_layout
