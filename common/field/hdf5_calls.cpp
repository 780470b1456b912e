// SPDX-License-Identifier: Apache-2.0
#include "field/hdf5_calls.h"

#include <array>
#include <span>

#include "base/error.h"
#include "base/joined.h"
#include "field/index_chunks.h"
#include "files/sha256.h"

namespace af::hdf5 {

using field_layout::Dataset;
using field_layout::DatasetRule;
using field_layout::ElementType;

namespace {

constexpr std::size_t kMaxAttributeBytes = 1u << 20;

Handle text_type(std::size_t bytes) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose, "H5Tcopy");
  checked(H5Tset_size(type, bytes), "H5Tset_size");
  checked(H5Tset_strpad(type, H5T_STR_NULLPAD), "H5Tset_strpad");
  checked(H5Tset_cset(type, H5T_CSET_UTF8), "H5Tset_cset");
  return type;
}

Handle memory_type(const DatasetRule& rule) {
  switch (rule.type) {
    case ElementType::Float64:
      return {H5Tcopy(H5T_NATIVE_DOUBLE), H5Tclose, "H5Tcopy"};
    case ElementType::Float32:
      return {H5Tcopy(H5T_NATIVE_FLOAT), H5Tclose, "H5Tcopy"};
    case ElementType::Int32:
      return {H5Tcopy(H5T_NATIVE_INT32), H5Tclose, "H5Tcopy"};
    case ElementType::UInt16:
      return {H5Tcopy(H5T_NATIVE_UINT16), H5Tclose, "H5Tcopy"};
    case ElementType::Text:
      break;
  }
  return text_type(rule.extents[0]);
}

Handle dataspace_of(const DatasetRule& rule) {
  if (rule.type == ElementType::Text) return {H5Screate(H5S_SCALAR), H5Sclose, "H5Screate"};
  const std::vector<hsize_t> extents(rule.extents.begin(), rule.extents.end());
  return {H5Screate_simple(static_cast<int>(extents.size()), extents.data(), nullptr),
          H5Sclose,
          "H5Screate_simple"};
}

std::string text_of(const std::vector<std::uint64_t>& extents) {
  return extents.empty()
             ? "scalar"
             : joined(extents, " x ", [](std::uint64_t extent) { return std::to_string(extent); });
}

std::vector<std::uint64_t> extents_of(hid_t dataset, const DatasetRule& rule, hid_t type) {
  if (rule.type == ElementType::Text) return {H5Tget_size(type)};
  const Handle space(H5Dget_space(dataset), H5Sclose, "H5Dget_space");
  const int dimensions = checked(H5Sget_simple_extent_ndims(space), "H5Sget_simple_extent_ndims");
  std::vector<hsize_t> extents(static_cast<std::size_t>(dimensions));
  checked(H5Sget_simple_extent_dims(space, extents.data(), nullptr), "H5Sget_simple_extent_dims");
  return {extents.begin(), extents.end()};
}

bool is_type_of(hid_t type, const DatasetRule& rule) {
  if (rule.type == ElementType::Text)
    return H5Tget_class(type) == H5T_STRING && H5Tis_variable_str(type) == 0;
  const Handle expected = file_type(rule);
  return checked(H5Tequal(type, expected), "H5Tequal") > 0;
}

/// Every part of an object's path must be an object of this file, because links may lead to other
/// files.
void check_is_of_this_file(hid_t file, const DatasetRule& rule, const std::string& path) {
  for (std::size_t end = rule.name.find('/', 1);; end = rule.name.find('/', end + 1)) {
    const std::string part = rule.name.substr(0, end);
    if (checked(H5Lexists(file, part.c_str(), H5P_DEFAULT), "H5Lexists") == 0)
      throw FileError(path, "has no " + part);
    H5L_info_t link;
    checked(H5Lget_info(file, part.c_str(), &link, H5P_DEFAULT), "H5Lget_info");
    if (link.type != H5L_TYPE_HARD) throw FileError(path, part, "an object of this file", "a link");
    if (end == std::string::npos) return;
  }
}

/// Contents must be those of this file itself, in pieces that fit into memory, by filters that HDF5
/// has built in. This rules out other files (external, virtual) and whatever loads a plug-in.
void check_storage(hid_t dataset, const DatasetRule& rule, const std::string& path) {
  const Handle creation(H5Dget_create_plist(dataset), H5Pclose, "H5Dget_create_plist");
  const H5D_layout_t layout = H5Pget_layout(creation);
  if (layout == H5D_VIRTUAL || (layout == H5D_CONTIGUOUS && H5Pget_external_count(creation) != 0))
    throw FileError(path, rule.name, "contents of this file", "those of another");
  const int filters = checked(H5Pget_nfilters(creation), "H5Pget_nfilters");
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0;
    std::size_t parameters = 0;
    const H5Z_filter_t filter = H5Pget_filter2(
        creation, static_cast<unsigned>(i), &flags, &parameters, nullptr, 0, nullptr, nullptr);
    if (filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_SHUFFLE &&
        filter != H5Z_FILTER_FLETCHER32)
      throw FileError(
          path, rule.name, "filters deflate, shuffle, fletcher32", std::to_string(filter));
  }
  if (layout != H5D_CHUNKED) return;
  std::array<hsize_t, H5S_MAX_RANK> chunk{};
  const int rank = checked(H5Pget_chunk(creation, H5S_MAX_RANK, chunk.data()), "H5Pget_chunk");
  std::uint64_t elements = 1;
  for (const hsize_t extent : std::span(chunk).first(static_cast<std::size_t>(rank))) {
    if (extent < 1 || extent > kMaxChunkElements / elements)
      throw FileError(path,
                      rule.name,
                      "chunks of at most " + std::to_string(kMaxChunkElements) + " elements",
                      "larger ones");
    elements *= extent;
  }
}

/// Only the codebook is deflated, in one chunk; the others are too small to gain.
Handle small_dataset_creation(const Dataset& dataset) {
  constexpr std::size_t kWorthDeflating = 4096;
  constexpr unsigned kLevel = 9;
  Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, "H5Pcreate");
  if (dataset.rule.type != ElementType::UInt16 || dataset.bytes.size() < kWorthDeflating)
    return creation;
  const std::vector<hsize_t> chunk(dataset.rule.extents.begin(), dataset.rule.extents.end());
  checked(H5Pset_chunk(creation, static_cast<int>(chunk.size()), chunk.data()), "H5Pset_chunk");
  checked(H5Pset_shuffle(creation), "H5Pset_shuffle");
  checked(H5Pset_deflate(creation, kLevel), "H5Pset_deflate");
  checked(H5Pset_fletcher32(creation), "H5Pset_fletcher32");
  return creation;
}

bool fits(const std::vector<std::uint64_t>& found, const DatasetRule& rule) {
  if (found.size() != rule.extents.size()) return false;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const bool is_free = i == 0 && rule.is_first_extent_free;
    if (is_free ? found[i] < 1 || found[i] > rule.extents[i] : found[i] != rule.extents[i])
      return false;
  }
  return true;
}

}  // namespace

Handle file_access() {
  Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "H5Pcreate");
  checked(H5Pset_libver_bounds(access, H5F_LIBVER_V110, H5F_LIBVER_V110), "H5Pset_libver_bounds");
  // Closes with the file what still is open: a damaged object that cannot be closed must not keep
  // its file open.
  checked(H5Pset_fclose_degree(access, H5F_CLOSE_STRONG), "H5Pset_fclose_degree");
  return access;
}

Handle create_file(const std::filesystem::path& path) {
  const Handle access = file_access();
  return {H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access), H5Fclose, "H5Fcreate"};
}

Handle open_file(const std::filesystem::path& path, unsigned flags) {
  const Handle access = file_access();
  return {H5Fopen(path.c_str(), flags, access), H5Fclose, "H5Fopen"};
}

void write_text_attribute(hid_t object, const char* name, const std::string& text) {
  const std::string stored = text.empty() ? std::string(1, '\0') : text;
  const Handle type = text_type(stored.size());
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose, "H5Screate");
  const Handle attribute(
      H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, "H5Acreate2");
  checked(H5Awrite(attribute, type, stored.data()), "H5Awrite");
}

void replace_text_attribute(hid_t object, const char* name, const std::string& text) {
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, "H5Aopen");
  const Handle type(H5Aget_type(attribute), H5Tclose, "H5Aget_type");
  check(H5Tget_size(type) == text.size(), "an attribute keeps its length");
  checked(H5Awrite(attribute, type, text.data()), "H5Awrite");
}

std::string read_text_attribute(hid_t object, const char* name) {
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, "H5Aopen");
  const Handle type(H5Aget_type(attribute), H5Tclose, "H5Aget_type");
  const Handle space(H5Aget_space(attribute), H5Sclose, "H5Aget_space");
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) != 0 ||
      H5Sget_simple_extent_npoints(space) != 1 || H5Tget_size(type) > kMaxAttributeBytes)
    throw std::runtime_error(std::string("attribute ") + name + " is not a text of fixed length");
  std::string text(H5Tget_size(type), '\0');
  checked(H5Aread(attribute, type, text.data()), "H5Aread");
  text.resize(text.find_last_not_of('\0') + 1);
  return text;
}

void write_int_attribute(hid_t object, const char* name, int value) {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose, "H5Screate");
  const Handle attribute(H5Acreate2(object, name, H5T_STD_I32LE, space, H5P_DEFAULT, H5P_DEFAULT),
                         H5Aclose,
                         "H5Acreate2");
  checked(H5Awrite(attribute, H5T_NATIVE_INT, &value), "H5Awrite");
}

int read_int_attribute(hid_t object, const char* name) {
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, "H5Aopen");
  const Handle space(H5Aget_space(attribute), H5Sclose, "H5Aget_space");
  if (H5Sget_simple_extent_npoints(space) != 1)
    throw std::runtime_error(std::string("attribute ") + name + " is not one integer");
  int value = 0;
  checked(H5Aread(attribute, H5T_NATIVE_INT, &value), "H5Aread");
  return value;
}

Handle file_type(const DatasetRule& rule) {
  switch (rule.type) {
    case ElementType::Float64:
      return {H5Tcopy(H5T_IEEE_F64LE), H5Tclose, "H5Tcopy"};
    case ElementType::Float32:
      return {H5Tcopy(H5T_IEEE_F32LE), H5Tclose, "H5Tcopy"};
    case ElementType::Int32:
      return {H5Tcopy(H5T_STD_I32LE), H5Tclose, "H5Tcopy"};
    case ElementType::UInt16:
      return {H5Tcopy(H5T_STD_U16LE), H5Tclose, "H5Tcopy"};
    case ElementType::Text:
      break;
  }
  return text_type(rule.extents[0]);
}

void write_dataset(hid_t file, const Dataset& dataset, const std::string& sha256) {
  const DatasetRule& rule = dataset.rule;
  const Handle type = file_type(rule);
  const Handle space = dataspace_of(rule);
  const Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose, "H5Pcreate");
  checked(H5Pset_create_intermediate_group(links, 1), "H5Pset_create_intermediate_group");
  const Handle creation = small_dataset_creation(dataset);
  const Handle object(
      H5Dcreate2(file, rule.name.c_str(), type, space, links, creation, H5P_DEFAULT),
      H5Dclose,
      "H5Dcreate2");
  const Handle in_memory = memory_type(rule);
  checked(H5Dwrite(object, in_memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, dataset.bytes.data()),
          "H5Dwrite");
  write_text_attribute(object, "units", rule.units);
  write_text_attribute(object, "frame", rule.frame);
  write_text_attribute(object, "sha256", sha256);
}

Handle open_dataset(hid_t file,
                    const DatasetRule& rule,
                    const std::string& path,
                    std::vector<std::uint64_t>* found) {
  check_is_of_this_file(file, rule, path);
  Handle dataset(H5Dopen2(file, rule.name.c_str(), H5P_DEFAULT), H5Dclose, "H5Dopen2");
  check_storage(dataset, rule, path);
  const Handle type(H5Dget_type(dataset), H5Tclose, "H5Dget_type");
  if (!is_type_of(type, rule))
    throw FileError(
        path, rule.name, std::string("elements ") + to_string(rule.type), "another type");
  const std::vector<std::uint64_t> extents = extents_of(dataset, rule, type);
  if (!fits(extents, rule))
    throw FileError(path,
                    rule.name,
                    std::string("extents ") + (rule.is_first_extent_free ? "up to " : "") +
                        text_of(rule.extents),
                    text_of(extents));
  if (found != nullptr) *found = extents;
  return dataset;
}

Dataset read_dataset(hid_t file, const DatasetRule& rule, const std::string& path) {
  Dataset dataset{rule, {}};
  std::vector<std::uint64_t> extents;
  const Handle object = open_dataset(file, rule, path, &extents);
  dataset.rule.extents = extents;
  std::uint64_t elements = 1;
  for (const std::uint64_t extent : extents) elements *= extent;  // bounded by the rule
  dataset.bytes.resize(elements * element_bytes(rule.type));
  const Handle in_memory = memory_type(dataset.rule);
  checked(H5Dread(object, in_memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, dataset.bytes.data()),
          "H5Dread");
  const std::string stored = read_text_attribute(object, "sha256");
  const std::string computed = sha256_hex(dataset.bytes);
  if (stored != computed) throw FileError(path, rule.name, "sha256 " + stored, computed);
  return dataset;
}

}  // namespace af::hdf5
