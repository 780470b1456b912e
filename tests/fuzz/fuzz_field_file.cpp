// SPDX-License-Identifier: Apache-2.0
// The structure of a field file. A sound one is changed through HDF5 as the input says (contents,
// types, extents, layouts, filters, links, attributes), so that HDF5's own checksums agree and our
// reader is what is tested; then the reader's checksums are mended where that is possible.
#include <array>
#include <fstream>
#include <iterator>
#include <memory>

#include "field_file/hdf5_calls.h"
#include "field_file/index_filter.h"
#include "files/sha256.h"
#include "fuzz/fuzz_input.h"
#include "fuzz/sample_field.h"
#include "parallel/mpi_environment.h"

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

std::string sound_file(const CompressedAttenuationField& field) {
  static int argc = 1;
  static std::array<char, 5> name = {'f', 'u', 'z', 'z', '\0'};
  static char* pointer = name.data();
  static char** argv = &pointer;
  static const MpiEnvironment mpi(argc, argv);
  const auto path = fuzz::scratch_folder() / kElsewhere;
  write_field(field,
              fuzz::sample_blocks(field),
              {"0.1.0", "af-precompute", "seed = 1\n", "{}"},
              path,
              Communicator::world());
  return bytes_of_file(path);
}

std::vector<std::string> all_names() {
  std::vector<std::string> names = {"/", "/geometry", "/field", "/field/slab_0", "/field/slab_1"};
  for (const DatasetRule& rule : field_layout::payload_rules(2, true)) names.push_back(rule.name);
  for (const DatasetRule& rule : field_layout::provenance_rules()) names.push_back(rule.name);
  return names;
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
  // Of large ones HDF5 would make all chunks; without storage only their extents are large.
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
      if (input.take_below(4) == 0) {
        std::array<unsigned, 5> parameters = {1};
        std::copy(chunk.begin(), chunk.begin() + 4, parameters.begin() + 1);
        if (input.take_below(4) == 0) parameters[input.take_below(5)] = input.take<std::uint16_t>();
        H5Pset_filter(creation, hdf5::kIndexFilter, 0, parameters.size(), parameters.data());
      }
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

/// Whether its contents can be held here; they have at least one element then.
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
  // HDF5 writes an attribute when it makes it, and holds it whole.
  constexpr hssize_t kMostBytes = 1 << 22;
  const auto width = static_cast<hssize_t>(H5Tget_size(type));
  if (H5Sget_simple_extent_npoints(space) > kMostBytes / width) return;
  const Handle created(
      H5Acreate2(object, attribute, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, "H5Acreate2");
}

void change(hid_t file, fuzz::InputBytes& input) {
  static const std::vector<std::string> names = all_names();
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

/// The hash over all datasets, as far as their hashes can be found.
void mend_payload_hash(hid_t file, bool has_means) {
  std::vector<Dataset> datasets;
  for (const DatasetRule& rule : field_layout::payload_rules(2, has_means))
    datasets.push_back(hdf5::read_dataset(file, rule, "field"));
  const CompressedAttenuationField field = field_layout::field_of(datasets, "field");
  std::string lines;
  for (const Dataset& dataset : datasets)
    lines += field_layout::payload_line(dataset.rule, sha256_hex(dataset.bytes));
  for (std::size_t k = 0; k < 2; ++k) {
    const DatasetRule rule = field_layout::index_rule(field.lattice(), k, has_means);
    const Handle dataset(H5Dopen2(file, rule.name.c_str(), H5P_DEFAULT), H5Dclose, "H5Dopen2");
    lines += field_layout::payload_line(rule, hdf5::read_text_attribute(dataset, "sha256"));
  }
  H5Adelete(file, "payload_sha256");
  hdf5::write_text_attribute(file, "payload_sha256", sha256_hex(std::as_bytes(std::span(lines))));
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

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const CompressedAttenuationField plain = fuzz::sample_field();
  static const CompressedAttenuationField mean_removed = fuzz::sample_field_with_means();
  static const std::array<std::string, 2> sound = {sound_file(plain), sound_file(mean_removed)};
  // An odd number of bytes changes a field with means.
  const bool has_means = size % 2 == 1;
  // HDF5 keeps a megabyte for each file it opens: kept for the next one, it need not be mapped
  // anew.
  static const herr_t keeps_memory = H5set_free_list_limits(-1, -1, -1, -1, -1, -1);
  fuzz::require(keeps_memory >= 0, "HDF5 takes the limits");
  const hdf5::QuietErrors quiet;
  const hdf5::IndexFilter filter((has_means ? mean_removed : plain).codebook);
  const auto path = fuzz::written("field.af.h5", sound[has_means ? 1 : 0]);
  {
    const Handle file = hdf5::open_file(path, H5F_ACC_RDWR);
    fuzz::InputBytes input(data, size);
    constexpr int kMostEdits = 6;
    for (int edits = 0; edits < kMostEdits && !input.empty(); ++edits)
      try_edit([&] { change(file, input); });
    try_edit([&] { mend_payload_hash(file, has_means); });
  }
  std::shared_ptr<const CompressedAttenuationField> field;
  if (fuzz::is_accepted([&] { field = read_field(path, Communicator::world()); }))
    fuzz::require(problems(*field).empty(), "an accepted field is sound");
  return 0;
}
