// SPDX-License-Identifier: Apache-2.0
#include "field/field_header.h"

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <span>
#include <sstream>
#include <unistd.h>
#include <utility>

#include "base/error.h"
#include "field/hdf5_calls.h"
#include "field/index_dataset.h"
#include "files/input_file.h"
#include "files/input_guard.h"
#include "ranks/root_only.h"

namespace af::field_layout {
namespace {

using hdf5::checked;
using hdf5::Handle;

/// Deflate never shrinks data by more than this.
constexpr std::uint64_t kMaxPackingRatio = 1032;

void check_version(hid_t file, const std::filesystem::path& path) {
  const int version = hdf5::read_int_attribute(file, "format_version");
  if (version != kFormatVersion)
    throw FileError(path.string(),
                    "attribute format_version",
                    std::to_string(kFormatVersion) + " (af-precompute makes the field anew)",
                    std::to_string(version));
}

bool has_object(hid_t file, const std::string& name) {
  return checked(H5Lexists(file, name.c_str(), H5P_DEFAULT), "H5Lexists") > 0;
}

CodebookParts read_codebook_parts(hid_t file) {
  if (!has_object(file, "/codebook")) return {};
  return {has_object(file, kMeanStepDataset), has_object(file, kTileFilterDataset)};
}

/// Refuses a file that is too small to hold so many indices, before memory is asked for.
void check_plausible_size(const DatasetRule& rule,
                          std::uint64_t file_bytes,
                          const std::filesystem::path& path) {
  // Empty tiles have no means of their own.
  const std::uint64_t needed =
      rule.value_count() / rule.rows_per_tile * sizeof(std::uint16_t) / kMaxPackingRatio;
  if (needed > file_bytes)
    throw FileError(path.string(),
                    rule.name,
                    "at least " + std::to_string(needed) + " bytes",
                    "a file of " + std::to_string(file_bytes));
}

std::vector<Dataset> read_datasets(hid_t file,
                                   const std::vector<DatasetRule>& rules,
                                   const std::string& path) {
  std::vector<Dataset> datasets;
  datasets.reserve(rules.size());
  for (const DatasetRule& rule : rules) datasets.push_back(hdf5::read_dataset(file, rule, path));
  return datasets;
}

/// The range of a group ("" for the root); none where the file has none.
std::vector<Dataset> read_range(hid_t file, const std::string& group, const std::string& path) {
  if (!has_object(file, group + "/range")) return {};
  return read_datasets(file, within(group, range_rules()), path);
}

/// The field of a group ("" for the root). `shared`: what the root holds for all members of an
/// atlas.
FieldHeader read_field_of(hid_t file,
                          const std::string& group,
                          std::span<const Dataset> shared,
                          const FileHeader& of_file,
                          const std::filesystem::path& path) {
  const auto of_group = [&](std::vector<DatasetRule> rules) {
    return within(group, std::move(rules));
  };
  FieldHeader header;
  const DatasetRule slab_count = of_group({slab_count_rule()}).front();
  const int slabs =
      slab_count_of(hdf5::read_dataset(file, slab_count, path.string()), path.string());
  header.payload = read_datasets(
      file,
      of_group(shared.empty() ? payload_rules(slabs, of_file.codebook) : member_rules(slabs)),
      path.string());
  header.payload.insert(header.payload.end(), shared.begin(), shared.end());
  header.range = read_range(file, group, path.string());
  const DatasetRule material = of_group({material_rule()}).front();
  if (has_object(file, material.name))
    header.material.push_back(hdf5::read_dataset(file, material, path.string()));
  header.index_rules = of_group(index_rules(header.field(path.string())));
  for (const DatasetRule& rule : header.index_rules) {
    check_plausible_size(rule, of_file.file_bytes, path);
    const hdf5::StoredTiles tiles(file, rule, path.string());
    header.index_sha256.push_back(hdf5::stated_sha256(file, rule.name));
  }
  return header;
}

/// Reads the root of an atlas, and its members.
void read_members(hid_t file, const std::filesystem::path& path, FileHeader& header) {
  header.root = read_datasets(file, atlas_rules(header.codebook), path.string());
  header.root_range = read_range(file, "", path.string());
  const auto shared = std::span<const Dataset>(header.root).last(shared_rules(header.codebook));
  const int members = member_count_of(header.root.front(), path.string());
  for (int i = 0; i < members; ++i)
    header.fields.push_back(
        read_field_of(file, member_group(static_cast<std::size_t>(i)), shared, header, path));
}

/// Hash of everything that a file says of its content.
std::string payload_hash(const FileHeader& header) {
  std::vector<Dataset> datasets = header.root;
  std::vector<DatasetRule> rules;
  std::vector<std::string> index_sha256;
  const std::size_t shared = header.is_atlas ? shared_rules(header.codebook) : 0;
  for (const FieldHeader& field : header.fields) {
    datasets.insert(datasets.end(),
                    field.payload.begin(),
                    field.payload.end() - static_cast<std::ptrdiff_t>(shared));
    rules.insert(rules.end(), field.index_rules.begin(), field.index_rules.end());
    index_sha256.insert(index_sha256.end(), field.index_sha256.begin(), field.index_sha256.end());
  }
  return payload_hash(datasets, rules, index_sha256);
}

/// An atlas is made from one CT, either all of it or its bone, and so are its members.
void require_same_origin(const AttenuationAtlas& atlas, const std::filesystem::path& path) {
  const FieldIdentity& all = atlas.identity;
  for (std::size_t i = 0; i < atlas.members.size(); ++i) {
    const FieldIdentity& one = atlas.members[i].identity;
    require_same_ct(path.string() + ": " + member_group(i), all.ct, "the atlas's", one.ct);
    if (one.mu_water_per_mm != all.mu_water_per_mm || one.air_below_hu != all.air_below_hu)
      throw FileError(path.string(),
                      member_group(i) + "/identity",
                      "the attenuation of water and of air of the atlas",
                      "others");
    if (one.material != all.material)
      throw FileError(path.string(),
                      field_layout::member_group(i) + "/material",
                      "that of the atlas's first member",
                      "another");
  }
}

/// For rank 0 alone.
FileHeader read_header(const std::filesystem::path& path) {
  check_is_hdf5(path);
  note_input(path);
  const Handle file = hdf5::open_file(path, H5F_ACC_RDONLY);
  FileHeader header;
  header.is_atlas = is_atlas_format(file, path);
  check_version(file, path);
  header.codebook = read_codebook_parts(file);
  header.file_bytes = std::filesystem::file_size(path);
  if (header.is_atlas)
    read_members(file, path, header);
  else
    header.fields.push_back(read_field_of(file, "", {}, header, path));
  header.provenance = read_datasets(file, provenance_rules(), path.string());
  header.payload_sha256 = hdf5::read_text_attribute(file, "payload_sha256");
  const std::string computed = payload_hash(header);
  if (header.payload_sha256 != computed)
    throw FileError(path.string(), "payload_sha256", header.payload_sha256, computed);
  const std::string ct_sha256 = hdf5::read_text_attribute(file, "ct_sha256");
  const FieldIdentity identity = header.is_atlas ? header.atlas(path.string()).identity
                                                 : header.fields[0].field(path.string()).identity;
  if (ct_sha256 != identity.ct.content_sha256)
    throw FileError(path.string(), "attribute ct_sha256", identity.ct.content_sha256, ct_sha256);
  if (header.is_atlas) require_same_origin(header.atlas(path.string()), path);
  return header;
}

/// The look-up that a field's options name, "linear" where they name none. Throws FileError for an
/// unknown name.
std::string look_up_of(const FieldProvenance& provenance, const std::string& path) {
  const std::string key = "look_up = ";
  std::istringstream lines(provenance.options_toml);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(key)) continue;
    const std::string value = line.substr(key.size());
    for (const char* known : {"linear", "cubic"})
      if (value == '"' + std::string(known) + '"') return known;
    throw FileError(path, "/provenance/options_toml: look_up", "\"linear\" or \"cubic\"", value);
  }
  return "linear";
}

}  // namespace

CompressedAttenuationField FieldHeader::field(const std::string& path) const {
  CompressedAttenuationField field = field_of(payload, path);
  if (!range.empty()) field.identity.range = range_of(range, field.identity.range, path);
  if (!material.empty()) field.identity.material = material_of(material.front(), path);
  return field;
}

AttenuationAtlas FileHeader::atlas(const std::string& path) const {
  AttenuationAtlas atlas = atlas_of(root, path);
  if (!root_range.empty()) atlas.identity.range = range_of(root_range, atlas.identity.range, path);
  for (const FieldHeader& header : fields) {
    CompressedAttenuationField field = header.field(path);
    atlas.members.push_back({std::move(field.identity), std::move(field.light_slab)});
  }
  if (!atlas.members.empty()) atlas.identity.material = atlas.members.front().identity.material;
  return atlas;
}

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
  const std::string expected = std::string(kFormat) + " or " + kAtlasFormat;
  if (H5Aexists(file, "format") <= 0)
    throw FileError(path.string(), "attribute format", expected, "none");
  const std::string format = hdf5::read_text_attribute(file, "format");
  if (format == kAtlasFormat) return true;
  if (format != kFormat) throw FileError(path.string(), "attribute format", expected, format);
  return false;
}

FileHeader read_header_of(bool atlas, const std::filesystem::path& path) {
  FileHeader header = read_header(path);
  if (header.is_atlas == atlas) return header;
  const auto text = [](bool is_atlas) { return is_atlas ? kAtlasFormat : kFormat; };
  throw FileError(path.string(), "attribute format", text(atlas), text(header.is_atlas));
}

FileHeader shared_header(bool atlas,
                         const std::filesystem::path& path,
                         const Communicator& communicator) {
  const auto read = [&] {
    return hdf5::naming_file(path, [&] { return read_header_of(atlas, path); });
  };
  FileHeader header = on_root(communicator, read).share().take();
  if (communicator.is_root()) return header;
  for (std::size_t i = 0; i < header.fields.size(); ++i)
    header.fields[i].index_rules =
        within(atlas ? member_group(i) : "", index_rules(header.fields[i].field(path.string())));
  return header;
}

FieldFileInfo info_of(const FileHeader& header,
                      std::uint64_t payload_bytes,
                      const std::filesystem::path& path) {
  const FieldProvenance provenance = provenance_of(header.provenance);
  return {provenance,
          header.payload_sha256,
          header.file_bytes,
          payload_bytes,
          look_up_of(provenance, path.string())};
}

}  // namespace af::field_layout
