// SPDX-License-Identifier: Apache-2.0
#include "field/field_reading.h"

#include <algorithm>
#include <span>

#include "base/error.h"
#include "field/field_header.h"
#include "field/field_layout.h"
#include "field/hdf5_calls.h"
#include "field/index_dataset.h"
#include "files/reading_turn.h"
#include "files/sha256.h"
#include "ranks/root_only.h"

namespace af {

namespace {

using field_layout::Dataset;
using field_layout::DatasetRule;
using field_layout::FieldHeader;
using field_layout::FileHeader;
using field_layout::info_of;
using field_layout::read_header_of;
using field_layout::shared_header;
using hdf5::Handle;
using hdf5::naming_file;

/// Reads and verifies the indices of one slab, which ranks of a node share in memory.
void read_indices(const std::filesystem::path& path,
                  const DatasetRule& rule,
                  const std::string& expected_sha256,
                  const Codebook& codebook,
                  std::span<std::uint16_t> indices) {
  const Handle file = hdf5::open_file(path, H5F_ACC_RDONLY);
  const hdf5::StoredTiles tiles(file, rule, path.string());
  const std::size_t plane = indices.size() / rule.extents[0];
  Sha256 sha256;
  std::vector<std::string> found;
  tiles.read_planes([&](std::uint64_t u,
                        std::uint64_t count) { return indices.subspan(u * plane, count * plane); },
                    [&](std::uint64_t, std::span<const std::uint16_t> values) {
                      sha256.update(std::as_bytes(values));
                      if (found.empty())
                        found = index_problems(values, rule.extents[3], codebook, rule.name);
                    });
  const std::string computed = sha256.hex_digest();
  if (computed != expected_sha256)
    throw FileError(path.string(), rule.name, "sha256 " + expected_sha256, computed);
  if (!found.empty()) throw FileError(path.string(), found.front());
}

/// Collective. The indices of all slabs, held once per node. Rank 0's node reads them for all. Its
/// ranks take the slabs in turn, because unpacking is most of the work of opening a field.
std::vector<CompressedSlab> read_slabs(const FieldHeader& header,
                                       const std::filesystem::path& path,
                                       const Codebook& codebook,
                                       const Communicator& communicator) {
  constexpr std::size_t kAligned = Communicator::kNodeMemoryAlignment / sizeof(std::uint16_t);
  std::vector<std::size_t> begins{0};
  for (const DatasetRule& rule : header.index_rules)
    begins.push_back((begins.back() + rule.value_count() + kAligned - 1) / kAligned * kAligned);
  const auto memory = communicator.allocate_on_nodes_from_root_together(
      begins.back() * sizeof(std::uint16_t), [&](std::span<std::byte> bytes, int part, int parts) {
        auto* const values = reinterpret_cast<std::uint16_t*>(bytes.data());
        naming_file(path, [&] {
          for (auto k = static_cast<std::size_t>(part); k < header.index_rules.size();
               k += static_cast<std::size_t>(parts))
            read_indices(path,
                         header.index_rules[k],
                         header.index_sha256[k],
                         codebook,
                         {values + begins[k], header.index_rules[k].value_count()});
        });
      });
  const auto* const values = reinterpret_cast<const std::uint16_t*>(memory.get());
  std::vector<CompressedSlab> slabs;
  for (std::size_t k = 0; k < header.index_rules.size(); ++k)
    slabs.push_back({SharedArray<std::uint16_t>(
        memory, {values + begins[k], header.index_rules[k].value_count()})});
  return slabs;
}

/// Collective. A field from a file, with its indices.
std::shared_ptr<const CompressedAttenuationField> field_with_indices(
    const FieldHeader& header,
    const std::filesystem::path& path,
    const Communicator& communicator) {
  auto field = std::make_shared<CompressedAttenuationField>(header.field(path.string()));
  field->slabs = read_slabs(header, path, field->codebook, communicator);
  do_on_root(communicator, [&] {
    const auto found = problems(*field);
    if (!found.empty()) throw FileError(path.string(), found.front());
  });
  return field;
}

}  // namespace

void share_geometry(LightSlab& light_slab, const Communicator& communicator) {
  const Shared<std::vector<Dataset>> geometry =
      on_root(communicator, [&] { return field_layout::geometry_datasets(light_slab); }).share();
  field_layout::set_geometry(*geometry, "the geometry of rank 0", light_slab);
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
      throw FileError(
          path.string(), "/material", "a field of all of the CT", "one of its bone alone");
  });
  return field;
}

void require_bone_of(const FieldIdentity& all,
                     const FieldIdentity& found,
                     const std::filesystem::path& path) {
  if (found.material != FieldMaterial::Bone)
    throw FileError(
        path.string(), "/material", "a field of the CT's bone alone", "one of all of it");
  require_same_ct(path.string(), all.ct, "that of the field beside it", found.ct);
  if (found.mu_water_per_mm != all.mu_water_per_mm || found.air_below_hu != all.air_below_hu)
    throw FileError(path.string(),
                    "attenuation",
                    "mu_water and air_below_hu of the field beside it",
                    "other values");
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
    field_layout::check_is_hdf5(path);
    const Handle file = hdf5::open_file(path, H5F_ACC_RDONLY);
    return field_layout::is_atlas_format(file, path);
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
  const ReadingTurn turn;  // HDF5 may be used by one thread at a time
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
