// SPDX-License-Identifier: Apache-2.0
// ITK's transforms in HDF5 (itk::HDF5TransformIO): a group of each transform, whose datasets are
// its type and its two lists of numbers. Files are read from and written to memory, so that HDF5
// opens no other file on behalf of a link.
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <hdf5.h>

#include "base/error.h"
#include "pose_files/itk_transform.h"

namespace af {
namespace {

constexpr const char* kGroup = "/TransformGroup";
constexpr const char* kTransform = "/TransformGroup/0";
constexpr std::array kTypeNames = {"/TransformGroup/0/TransformType"};
/// ITK 4 wrote both lists without the s.
constexpr std::array kParameterLists = {"/TransformGroup/0/TransformParameters",
                                        "/TransformGroup/0/TranformParameters"};
constexpr std::array kFixedLists = {"/TransformGroup/0/TransformFixedParameters",
                                    "/TransformGroup/0/TranformFixedParameters"};

/// An HDF5 call failed; callers know the file.
struct H5CallFailed : std::runtime_error {
  using std::runtime_error::runtime_error;
};

template <typename Result>
Result h5_checked(Result result, const char* call) {
  if (result < 0) throw H5CallFailed(call);
  return result;
}

/// Closes what it holds.
class H5Id {
 public:
  H5Id(hid_t id, herr_t (*close)(hid_t), const char* call)
      : id_(h5_checked(id, call)), close_(close) {}
  ~H5Id() {
    if (id_ >= 0) close_(id_);
  }
  H5Id(H5Id&& other) noexcept : id_(other.id_), close_(other.close_) { other.id_ = -1; }
  H5Id& operator=(H5Id&&) = delete;
  H5Id(const H5Id&) = delete;
  H5Id& operator=(const H5Id&) = delete;
  operator hid_t() const { return id_; }  // NOLINT(google-explicit-constructor): used as the id

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// HDF5 prints no error stack while alive.
class H5Quiet {
 public:
  H5Quiet() {
    H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~H5Quiet() { H5Eset_auto2(H5E_DEFAULT, function_, data_); }
  H5Quiet(const H5Quiet&) = delete;
  H5Quiet& operator=(const H5Quiet&) = delete;

 private:
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

constexpr std::size_t kMemoryStep = 1u << 16;

H5Id memory_access() {
  return {H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "H5Pcreate"};
}

/// Opens these bytes as if they were a file. HDF5 copies them.
H5Id image_access(std::string bytes) {
  H5Id access = memory_access();
  h5_checked(H5Pset_fapl_core(access, kMemoryStep, 0), "H5Pset_fapl_core");
  h5_checked(H5Pset_file_image(access, bytes.data(), bytes.size()), "H5Pset_file_image");
  return access;
}

/// Of this file itself, uncompressed or deflated in small pieces.
void check_storage_of(hid_t dataset, const std::string& where) {
  const H5Id creation(H5Dget_create_plist(dataset), H5Pclose, "H5Dget_create_plist");
  const H5D_layout_t layout = H5Pget_layout(creation);
  if (layout == H5D_VIRTUAL || (layout == H5D_CONTIGUOUS && H5Pget_external_count(creation) != 0))
    throw FileError(where, "holds the contents of another file");
  if (layout != H5D_CHUNKED) return;
  constexpr hsize_t kMostOfAChunk = 4096;
  std::array<hsize_t, H5S_MAX_RANK> chunk{};
  const int rank = h5_checked(H5Pget_chunk(creation, H5S_MAX_RANK, chunk.data()), "H5Pget_chunk");
  if (rank != 1 || chunk[0] > kMostOfAChunk) throw FileError(where, "is stored in large pieces");
  const int filters = h5_checked(H5Pget_nfilters(creation), "H5Pget_nfilters");
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0;
    std::size_t values = 0;
    if (H5Pget_filter2(
            creation, static_cast<unsigned>(i), &flags, &values, nullptr, 0, nullptr, nullptr) !=
        H5Z_FILTER_DEFLATE)
      throw FileError(where, "is compressed in another way than by deflate");
  }
}

template <std::size_t Count>
H5Id open_one_of(hid_t file, const std::array<const char*, Count>& names, const std::string& path) {
  for (const char* const name : names) {
    if (H5Lexists(file, name, H5P_DEFAULT) <= 0) continue;
    H5L_info_t link;
    h5_checked(H5Lget_info(file, name, &link, H5P_DEFAULT), "H5Lget_info");
    if (link.type != H5L_TYPE_HARD) throw FileError(path, name, "a dataset of this file", "a link");
    return {H5Dopen2(file, name, H5P_DEFAULT), H5Dclose, "H5Dopen2"};
  }
  throw FileError(path, std::string("has no ") + names[0] + ": not an ITK transform");
}

hssize_t count_of(hid_t dataset) {
  const H5Id space(H5Dget_space(dataset), H5Sclose, "H5Dget_space");
  return h5_checked(H5Sget_simple_extent_npoints(space), "H5Sget_simple_extent_npoints");
}

std::vector<double> numbers_in(hid_t dataset, const std::string& where) {
  check_storage_of(dataset, where);
  const H5Id type(H5Dget_type(dataset), H5Tclose, "H5Dget_type");
  constexpr hssize_t kMost = 16;
  const hssize_t count = count_of(dataset);
  if (H5Tget_class(type) != H5T_FLOAT || count > kMost)
    throw FileError(where, "is no list of at most 16 numbers");
  std::vector<double> numbers(static_cast<std::size_t>(count));
  if (count > 0)
    h5_checked(H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()),
               "H5Dread");
  for (const double number : numbers)
    if (!std::isfinite(number)) throw FileError(where, "holds a number that is not finite");
  return numbers;
}

/// A text of variable length, as ITK writes it, or of a fixed one.
std::string text_in(hid_t dataset, const std::string& where) {
  check_storage_of(dataset, where);
  const H5Id type(H5Dget_type(dataset), H5Tclose, "H5Dget_type");
  if (H5Tget_class(type) != H5T_STRING || count_of(dataset) != 1)
    throw FileError(where, "is no text");
  constexpr std::size_t kMostBytes = 256;
  if (h5_checked(H5Tis_variable_str(type), "H5Tis_variable_str") > 0) {
    char* text = nullptr;
    const H5Id memory(H5Tcopy(type), H5Tclose, "H5Tcopy");
    h5_checked(H5Dread(dataset, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, &text), "H5Dread");
    const std::string copy = text == nullptr ? "" : text;
    H5free_memory(text);
    return copy.substr(0, kMostBytes);
  }
  // The file's word, up to 4 GB: asked before memory is.
  const std::size_t bytes = H5Tget_size(type);
  if (bytes > kMostBytes) throw FileError(where, "is too long");
  std::string text(bytes, '\0');
  h5_checked(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, text.data()), "H5Dread");
  return text.substr(0, text.find('\0'));
}

ItkTransform transform_in(const PoseFileBytes& file) {
  const std::string path = file.path.string();
  const H5Id access = image_access(file.bytes);
  const H5Id h5(H5Fopen("pose", H5F_ACC_RDONLY, access), H5Fclose, "H5Fopen");
  if (H5Lexists(h5, kGroup, H5P_DEFAULT) <= 0 || H5Lexists(h5, kTransform, H5P_DEFAULT) <= 0)
    throw FileError(path, std::string("has no ") + kTransform + ": not an ITK transform");
  if (H5Lexists(h5, "/TransformGroup/1", H5P_DEFAULT) > 0)
    throw InputError(path + ": holds several transforms (a composite one); one is expected");
  const H5Id type = open_one_of(h5, kTypeNames, path);
  const H5Id parameters = open_one_of(h5, kParameterLists, path);
  const H5Id fixed = open_one_of(h5, kFixedLists, path);
  return {text_in(type, path + ": TransformType"),
          numbers_in(parameters, path + ": TransformParameters"),
          numbers_in(fixed, path + ": TransformFixedParameters")};
}

void write_numbers(hid_t group, const char* name, const std::vector<double>& numbers) {
  const hsize_t count = numbers.size();
  const H5Id space(H5Screate_simple(1, &count, nullptr), H5Sclose, "H5Screate_simple");
  const H5Id dataset(
      H5Dcreate2(group, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
      H5Dclose,
      "H5Dcreate2");
  h5_checked(H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()),
             "H5Dwrite");
}

void write_text(hid_t group, const char* name, const std::string& text) {
  const hsize_t one = 1;
  const H5Id space(H5Screate_simple(1, &one, nullptr), H5Sclose, "H5Screate_simple");
  const H5Id type(H5Tcopy(H5T_C_S1), H5Tclose, "H5Tcopy");
  h5_checked(H5Tset_size(type, H5T_VARIABLE), "H5Tset_size");
  const H5Id dataset(H5Dcreate2(group, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                     H5Dclose,
                     "H5Dcreate2");
  const char* const pointer = text.c_str();
  h5_checked(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, &pointer), "H5Dwrite");
}

std::string hdf5_bytes(const ItkTransform& transform) {
  const H5Id access = memory_access();
  h5_checked(H5Pset_fapl_core(access, kMemoryStep, 0), "H5Pset_fapl_core");
  const H5Id file(H5Fcreate("pose", H5F_ACC_TRUNC, H5P_DEFAULT, access), H5Fclose, "H5Fcreate");
  write_text(file, "/ITKVersion", "5.2.1");
  write_text(file, "/HDFVersion", "HDF5");
  write_text(file, "/OSName", "-");
  write_text(file, "/OSVersion", "-");
  {
    const H5Id group(
        H5Gcreate2(file, kGroup, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose, "H5Gcreate2");
    const H5Id first(H5Gcreate2(file, kTransform, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                     H5Gclose,
                     "H5Gcreate2");
    write_text(first, "TransformType", transform.type);
    write_numbers(first, "TransformFixedParameters", transform.fixed_parameters);
    write_numbers(first, "TransformParameters", transform.parameters);
  }
  h5_checked(H5Fflush(file, H5F_SCOPE_LOCAL), "H5Fflush");
  const ssize_t size = h5_checked(H5Fget_file_image(file, nullptr, 0), "H5Fget_file_image");
  std::string bytes(static_cast<std::size_t>(size), '\0');
  h5_checked(H5Fget_file_image(file, bytes.data(), bytes.size()), "H5Fget_file_image");
  return bytes;
}

}  // namespace

bool is_hdf5(const PoseFileBytes& file) {
  return file.bytes.starts_with("\x89HDF\r\n\x1a\n");
}

bool holds_itk_hdf5_transform(const PoseFileBytes& file) {
  if (!is_hdf5(file)) return false;
  const H5Quiet quiet;
  try {
    const H5Id access = image_access(file.bytes);
    const H5Id h5(H5Fopen("pose", H5F_ACC_RDONLY, access), H5Fclose, "H5Fopen");
    return H5Lexists(h5, kGroup, H5P_DEFAULT) > 0;
  } catch (const H5CallFailed&) {
    return false;
  }
}

PosesInFile read_itk_hdf5(const PoseFileBytes& file, const PoseContext& /*context*/) {
  const H5Quiet quiet;
  try {
    const ItkTransform transform = transform_in(file);
    return {{{1, map_of_itk_transform(transform, file.path.string()).inverse()}}, {}};
  } catch (const H5CallFailed& failure) {
    throw FileError(file.path.string(), std::string("damaged HDF5: ") + failure.what() + " fails");
  }
}

std::string write_itk_hdf5(std::span<const RigidTransform> room_from_ct,
                           const PoseContext& /*context*/) {
  const H5Quiet quiet;
  try {
    return hdf5_bytes(itk_transform_of_map(only_pose(room_from_ct, "itk-hdf5").inverse()));
  } catch (const H5CallFailed& failure) {
    throw InputError(std::string("a transform cannot be written as HDF5: ") + failure.what());
  }
}

}  // namespace af
