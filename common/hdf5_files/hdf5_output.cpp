// SPDX-License-Identifier: Apache-2.0
#include "hdf5_files/hdf5_output.h"

#include <algorithm>

#include "base/error.h"
#include "hdf5_files/hdf5_handles.h"

namespace af {
namespace {

hdf5::Handle created_in_memory() {
  const hdf5::Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "H5Pcreate");
  hdf5::checked(H5Pset_fapl_core(access, hdf5::kMemoryStep, 0), "H5Pset_fapl_core");
  return {H5Fcreate(hdf5::memory_name().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access),
          H5Fclose,
          "H5Fcreate"};
}

void write_dataset(
    hid_t file, const std::string& path, hid_t space, hid_t stored, hid_t given, const void* data) {
  const hdf5::Handle dataset(
      H5Dcreate2(file, path.c_str(), stored, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
      H5Dclose,
      "H5Dcreate2");
  hdf5::checked(H5Dwrite(dataset, given, H5S_ALL, H5S_ALL, H5P_DEFAULT, data), "H5Dwrite");
}

hdf5::Handle scalar_space() {
  return {H5Screate(H5S_SCALAR), H5Sclose, "H5Screate"};
}

hdf5::Handle list_space(hsize_t count) {
  return {H5Screate_simple(1, &count, nullptr), H5Sclose, "H5Screate_simple"};
}

hdf5::Handle text_type(std::size_t size) {
  hdf5::Handle type(H5Tcopy(H5T_C_S1), H5Tclose, "H5Tcopy");
  hdf5::checked(H5Tset_size(type, size), "H5Tset_size");
  return type;
}

template <typename Use>
auto or_input_error(Use&& use) {
  const hdf5::QuietErrors quiet;
  try {
    return use();
  } catch (const hdf5::CallFailed& failure) {
    throw InputError(std::string("cannot be written as HDF5: ") + failure.what());
  }
}

}  // namespace

struct Hdf5Output::State {
  hdf5::Handle file = created_in_memory();
};

Hdf5Output::Hdf5Output() : state_(or_input_error([] { return std::make_unique<State>(); })) {}
Hdf5Output::~Hdf5Output() = default;

void Hdf5Output::add_group(const std::string& path) {
  or_input_error([&] {
    const hdf5::Handle group(
        H5Gcreate2(state_->file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
        H5Gclose,
        "H5Gcreate2");
  });
}

void Hdf5Output::add_numbers(const std::string& path, const std::vector<double>& numbers) {
  or_input_error([&] {
    const hdf5::Handle space = list_space(numbers.size());
    write_dataset(state_->file, path, space, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, numbers.data());
  });
}

void Hdf5Output::add_matrix(const std::string& path, const Eigen::MatrixXd& matrix) {
  or_input_error([&] {
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = matrix;
    const hsize_t extents[] = {static_cast<hsize_t>(rows.rows()),
                               static_cast<hsize_t>(rows.cols())};
    const hdf5::Handle space(H5Screate_simple(2, extents, nullptr), H5Sclose, "H5Screate_simple");
    write_dataset(state_->file, path, space, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, rows.data());
  });
}

void Hdf5Output::add_scalar(const std::string& path, double number) {
  or_input_error([&] {
    const hdf5::Handle space = scalar_space();
    write_dataset(state_->file, path, space, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, &number);
  });
}

void Hdf5Output::add_count(const std::string& path, std::size_t number) {
  or_input_error([&] {
    const hdf5::Handle space = scalar_space();
    const auto value = static_cast<unsigned long long>(number);
    write_dataset(state_->file, path, space, H5T_STD_U64LE, H5T_NATIVE_ULLONG, &value);
  });
}

void Hdf5Output::add_text(const std::string& path, const std::string& text) {
  or_input_error([&] {
    const hdf5::Handle space = list_space(1);
    const hdf5::Handle type = text_type(H5T_VARIABLE);
    const char* const pointer = text.c_str();
    write_dataset(state_->file, path, space, type, type, &pointer);
  });
}

void Hdf5Output::add_fixed_text(const std::string& path, const std::string& text) {
  or_input_error([&] {
    const hdf5::Handle space = scalar_space();
    const hdf5::Handle type = text_type(std::max<std::size_t>(1, text.size()));
    write_dataset(state_->file, path, space, type, type, text.c_str());
  });
}

void Hdf5Output::add_attribute(const std::string& group,
                               const char* name,
                               const std::string& text) {
  or_input_error([&] {
    const hdf5::Handle object(
        H5Oopen(state_->file, group.c_str(), H5P_DEFAULT), H5Oclose, "H5Oopen");
    const hdf5::Handle space = scalar_space();
    const hdf5::Handle type = text_type(std::max<std::size_t>(1, text.size()));
    const hdf5::Handle attribute(
        H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, "H5Acreate2");
    hdf5::checked(H5Awrite(attribute, type, text.c_str()), "H5Awrite");
  });
}

std::string Hdf5Output::bytes() const {
  return or_input_error([&] {
    hdf5::checked(H5Fflush(state_->file, H5F_SCOPE_LOCAL), "H5Fflush");
    const ssize_t size =
        hdf5::checked(H5Fget_file_image(state_->file, nullptr, 0), "H5Fget_file_image");
    std::string bytes(static_cast<std::size_t>(size), '\0');
    hdf5::checked(H5Fget_file_image(state_->file, bytes.data(), bytes.size()), "H5Fget_file_image");
    return bytes;
  });
}

}  // namespace af
