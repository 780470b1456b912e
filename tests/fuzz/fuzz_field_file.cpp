// SPDX-License-Identifier: Apache-2.0
// The structure of a field file. A sound one is changed through HDF5 as the input says (contents,
// types, extents, layouts, filters, links, attributes), so that HDF5's own checksums agree and our
// reader is tested. Then our checksums are mended where possible.
#include <array>
#include <fstream>
#include <iterator>
#include <memory>
#include <utility>

#include "field/field_layout.h"
#include "field/field_reading.h"
#include "field/field_writing.h"
#include "field/hdf5_calls.h"
#include "field/index_dataset.h"
#include "files/sha256.h"
#include "fuzz/fuzz_input.h"
#include "fuzz/sample_field.h"

namespace {

using namespace af;
using field_layout::Dataset;
using field_layout::DatasetRule;
using hdf5::Handle;

const std::string kElsewhere = "elsewhere.h5";

std::string bytes_of_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

/// A sound file, and what it holds.
struct SoundFile {
  std::string bytes;
  Codebook codebook;
  std::vector<DatasetRule> payload;  ///< without the indices
  std::vector<DatasetRule> indices;
  std::vector<std::string> names;  ///< of groups and datasets
  bool is_atlas = false;
};

/// Adds what every kind of file has.
SoundFile written_file(SoundFile sound, const std::vector<Dataset>& beside) {
  sound.bytes = bytes_of_file(fuzz::scratch_folder() / kElsewhere);
  sound.names = {"/", "/geometry", "/field", "/field/slab_0", "/field/slab_1"};
  const auto add = [&](const std::vector<DatasetRule>& rules) {
    for (const DatasetRule& rule : rules) sound.names.push_back(rule.name);
  };
  add(sound.payload);
  add(sound.indices);
  for (const DatasetRule& rule : sound.indices) {
    add({field_layout::codewords_rule(rule)});
    if (rule.rows_per_tile > 1) add({field_layout::means_rule(rule)});
  }
  add(field_layout::provenance_rules());
  for (const Dataset& dataset : beside) sound.names.push_back(dataset.rule.name);
  return sound;
}

constexpr const char* kOptions = "seed = 1\n";

SoundFile sound_field(const CompressedAttenuationField& field) {
  const bool has_means = field.codebook.has_means();
  write_field(field,
              fuzz::sample_blocks(field.lattice(), has_means),
              {"0.1.0", "af-precompute", kOptions, "{}"},
              fuzz::scratch_folder() / kElsewhere,
              Communicator::alone());
  std::vector<Dataset> beside = field_layout::range_datasets(field.identity.range);
  for (Dataset& dataset : field_layout::material_datasets(field.identity.material))
    beside.push_back(std::move(dataset));
  return written_file({{},
                       field.codebook,
                       field_layout::payload_rules(2, field_layout::parts_of(field.codebook)),
                       field_layout::index_rules(field),
                       {},
                       false},
                      beside);
}

SoundFile sound_atlas(const AttenuationAtlas& atlas) {
  const bool has_means = atlas.codebook.has_means();
  std::vector<IndexBlock> left = fuzz::sample_blocks(atlas.lattice(), has_means);
  write_atlas(
      atlas,
      [&] { return std::exchange(left, {}); },
      [] {
        return FieldProvenance{"0.1.0", "af-precompute", kOptions, "{}"};
      },
      fuzz::scratch_folder() / kElsewhere,
      Communicator::alone());
  SoundFile sound;
  sound.is_atlas = true;
  sound.codebook = atlas.codebook;
  sound.payload = field_layout::atlas_rules(field_layout::parts_of(atlas.codebook));
  for (std::size_t i = 0; i < atlas.members.size(); ++i)
    for (DatasetRule& rule :
         field_layout::within(field_layout::member_group(i), field_layout::member_rules(2)))
      sound.payload.push_back(std::move(rule));
  sound.indices = field_layout::index_rules(atlas);
  return written_file(sound, {});
}

/// Sound files that together have everything that a file may have.
std::vector<SoundFile> sound_files() {
  const CompressedAttenuationField plain = fuzz::sample_field();
  const CompressedAttenuationField mean_removed = fuzz::sample_field_with_means();
  CompressedAttenuationField filtered = mean_removed;
  filtered.codebook.filter.emplace();
  CompressedAttenuationField filtered_plain = plain;
  filtered_plain.codebook.filter.emplace();
  CompressedAttenuationField one_sided = plain;
  one_sided.identity.range.high.rotation_rad.y() *= 2.0;
  CompressedAttenuationField bone = plain;
  bone.identity.material = FieldMaterial::Bone;
  return {sound_field(plain),
          sound_field(mean_removed),
          sound_field(filtered),
          sound_field(filtered_plain),
          sound_field(one_sided),
          sound_field(bone),
          sound_atlas(fuzz::sample_atlas(plain)),
          sound_atlas(fuzz::sample_atlas(mean_removed)),
          sound_atlas(fuzz::sample_atlas(filtered))};
}

/// Any of the types that a file may hold.
Handle any_type(fuzz::InputBytes& input) {
  const std::array<hid_t, 8> types = {H5T_IEEE_F64LE,
                                      H5T_IEEE_F32LE,
                                      H5T_STD_I32LE,
                                      H5T_STD_U16LE,
                                      H5T_STD_U16BE,
                                      H5T_STD_I64LE,
                                      H5T_C_S1,
                                      H5T_STD_REF_OBJ};
  Handle type(H5Tcopy(types[input.take_below(types.size())]), H5Tclose, "H5Tcopy");
  if (H5Tget_class(type) != H5T_STRING) return type;
  const auto size = input.take<std::uint32_t>() % (1u << 21);
  H5Tset_size(type, size == 0 ? H5T_VARIABLE : size);
  return type;
}

Handle any_space(fuzz::InputBytes& input) {
  std::array<hsize_t, 5> extents{};
  const auto rank = static_cast<int>(input.take_below(extents.size() + 1));
  for (hsize_t& extent : extents) {
    extent = input.take<std::uint8_t>();
    if (extent > 250) extent = hsize_t{1} << input.take_below(40);
  }
  if (rank == 0) return {H5Screate(H5S_SCALAR), H5Sclose, "H5Screate"};
  return {H5Screate_simple(rank, extents.data(), nullptr), H5Sclose, "H5Screate_simple"};
}

Handle any_creation(hid_t space, fuzz::InputBytes& input) {
  Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, "H5Pcreate");
  // For large extents HDF5 would create all chunks. With the default layout it stores nothing.
  constexpr hssize_t kMostElements = 1 << 20;
  if (H5Sget_simple_extent_npoints(space) > kMostElements) return creation;
  const int rank = H5Sget_simple_extent_ndims(space);
  std::array<hsize_t, 5> chunk{};
  switch (input.take_below(5)) {
    case 0:
      H5Pset_layout(creation, H5D_COMPACT);
      break;
    case 1:
      for (hsize_t& extent : chunk) extent = 1 + input.take<std::uint16_t>();
      H5Pset_chunk(creation, rank, chunk.data());
      if (input.take_below(2) == 0) H5Pset_deflate(creation, 1);
      if (input.take_below(4) == 0) H5Pset_fletcher32(creation);
      if (input.take_below(4) == 0) H5Pset_nbit(creation);
      break;
    case 2:
      H5Pset_external(creation, (fuzz::scratch_folder() / kElsewhere).c_str(), 0, H5F_UNLIMITED);
      break;
    case 3:
      H5Pset_virtual(creation, space, kElsewhere.c_str(), "/geometry/uv_nodes", space);
      break;
    default:
      break;
  }
  return creation;
}

/// Whether the contents have at least one element and fit into memory here.
bool is_small(hid_t dataset, hid_t type) {
  constexpr std::size_t kMostBytes = 1u << 22;
  const Handle space(H5Dget_space(dataset), H5Sclose, "H5Dget_space");
  const auto elements = H5Sget_simple_extent_npoints(space);
  return elements >= 1 && H5Tis_variable_str(type) == 0 &&
         static_cast<std::size_t>(elements) <= kMostBytes / H5Tget_size(type);
}

void mend_hash(hid_t dataset) {
  const Handle type(H5Dget_type(dataset), H5Tclose, "H5Dget_type");
  if (!is_small(dataset, type)) return;
  const Handle space(H5Dget_space(dataset), H5Sclose, "H5Dget_space");
  std::vector<std::byte> bytes(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)) *
                               H5Tget_size(type));
  hdf5::checked(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()), "H5Dread");
  H5Adelete(dataset, "sha256");
  hdf5::write_text_attribute(dataset, "sha256", sha256_hex(bytes));
}

void change_content(hid_t file, const std::string& name, fuzz::InputBytes& input) {
  const Handle dataset(H5Dopen2(file, name.c_str(), H5P_DEFAULT), H5Dclose, "H5Dopen2");
  const Handle type(H5Dget_type(dataset), H5Tclose, "H5Dget_type");
  if (!is_small(dataset, type)) return;
  const Handle space(H5Dget_space(dataset), H5Sclose, "H5Dget_space");
  const std::size_t width = H5Tget_size(type);
  std::vector<std::byte> bytes(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)) *
                               width);
  H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data());
  const std::size_t place = input.take_below(bytes.size() / width) * width;
  const auto value = std::as_bytes(input.take_bytes(width));
  std::copy(value.begin(), value.end(), bytes.begin() + static_cast<std::ptrdiff_t>(place));
  hdf5::checked(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()), "H5Dwrite");
  mend_hash(dataset);
}

void replace_dataset(hid_t file, const std::string& name, fuzz::InputBytes& input) {
  hdf5::checked(H5Ldelete(file, name.c_str(), H5P_DEFAULT), "H5Ldelete");
  const Handle type = any_type(input);
  const Handle space = any_space(input);
  const Handle creation = any_creation(space, input);
  const Handle dataset(
      H5Dcreate2(file, name.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT),
      H5Dclose,
      "H5Dcreate2");
  hdf5::write_text_attribute(dataset, "sha256", std::string(64, '0'));
  mend_hash(dataset);
}

void replace_by_link(hid_t file,
                     const std::string& name,
                     const std::string& target,
                     fuzz::InputBytes& input) {
  hdf5::checked(H5Ldelete(file, name.c_str(), H5P_DEFAULT), "H5Ldelete");
  switch (input.take_below(3)) {
    case 0:
      H5Lcreate_soft(target.c_str(), file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      break;
    case 1:
      H5Lcreate_hard(file, target.c_str(), file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      break;
    default:
      H5Lcreate_external(
          kElsewhere.c_str(), target.c_str(), file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  }
}

void change_attribute(hid_t file, const std::string& name, fuzz::InputBytes& input) {
  constexpr std::array kAttributes = {
      "sha256", "format", "format_version", "payload_sha256", "ct_sha256", "units"};
  const char* const attribute = kAttributes[input.take_below(kAttributes.size())];
  const Handle object(H5Oopen(file, name.c_str(), H5P_DEFAULT), H5Oclose, "H5Oopen");
  if (H5Aexists(object, attribute) > 0) H5Adelete(object, attribute);
  const Handle type = any_type(input);
  const Handle space = any_space(input);
  // HDF5 holds a whole attribute in memory, so it must be small.
  constexpr hssize_t kMostBytes = 1 << 22;
  const auto width = static_cast<hssize_t>(H5Tget_size(type));
  if (H5Sget_simple_extent_npoints(space) > kMostBytes / width) return;
  const Handle created(
      H5Acreate2(object, attribute, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, "H5Acreate2");
}

void change(hid_t file, const std::vector<std::string>& names, fuzz::InputBytes& input) {
  const std::string& name = names[input.take_below(names.size())];
  switch (input.take_below(6)) {
    case 0:
    case 1:
      return change_content(file, name, input);
    case 2:
      return replace_dataset(file, name, input);
    case 3:
      return replace_by_link(file, name, names[input.take_below(names.size())], input);
    case 4:
      return change_attribute(file, name, input);
    default:
      H5Ldelete(file, name.c_str(), H5P_DEFAULT);
  }
}

/// Mends the hash over all datasets, as far as their own hashes can be read.
void mend_payload_hash(hid_t file, const SoundFile& sound) {
  std::vector<Dataset> datasets;
  for (const DatasetRule& rule : sound.payload)
    datasets.push_back(hdf5::read_dataset(file, rule, "field"));
  std::vector<std::string> index_sha256;
  for (const DatasetRule& rule : sound.indices) {
    index_sha256.push_back(hdf5::stated_sha256(file, rule.name));
  }
  H5Adelete(file, "payload_sha256");
  hdf5::write_text_attribute(
      file, "payload_sha256", field_layout::payload_hash(datasets, sound.indices, index_sha256));
}

/// Runs an edit; HDF5 may refuse it.
template <typename Edit>
void try_edit(Edit&& edit) {
  try {
    edit();
  } catch (const hdf5::CallFailed&) {
  } catch (const std::exception&) {
  }
}

/// What a program would do with the file.
void read_all(const std::filesystem::path& path) {
  const Communicator world = Communicator::alone();
  if (!is_atlas_file(path)) {
    const auto field = read_field_of_any_material(path, world);
    fuzz::require(problems(*field).empty(), "an accepted field is sound");
    return;
  }
  FieldFileInfo info;
  const auto atlas = read_atlas(path, world, &info);
  for (std::size_t i = 0; i < atlas->members.size(); ++i) {
    fuzz::require(atlas->members[i].identity.material == atlas->identity.material,
                  "members of an atlas hold the same part of the CT");
    const auto member = read_atlas_member(path, i, info.payload_sha256, world);
    fuzz::require(problems(*member).empty(), "an accepted member of an atlas is sound");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<SoundFile> files = sound_files();
  // HDF5 takes a megabyte for each file that it opens. Keeping it for the next file saves mapping
  // it anew.
  static const herr_t keeps_memory = H5set_free_list_limits(-1, -1, -1, -1, -1, -1);
  fuzz::require(keeps_memory >= 0, "HDF5 takes the limits");
  const hdf5::QuietErrors quiet;
  fuzz::InputBytes input(data, size);
  const SoundFile& sound = files[input.take<std::uint8_t>() % files.size()];
  const auto path = fuzz::written("field.af.h5", sound.bytes);
  {
    const Handle file = hdf5::open_file(path, H5F_ACC_RDWR);
    constexpr int kMostEdits = 6;
    for (int edits = 0; edits < kMostEdits && !input.empty(); ++edits)
      try_edit([&] { change(file, sound.names, input); });
    try_edit([&] { mend_payload_hash(file, sound); });
  }
  (void)fuzz::is_accepted([&] { read_all(path); });
  return 0;
}
