// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/ct.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "attenuation_fields/errors.h"
#include "python/bindings/arrays.h"
#include "python/bindings/pickled.h"
#include "python/bindings/texts.h"
#include "python/bindings/without_lock.h"

namespace attenuation_fields::python {
namespace {

using namespace pybind11::literals;

using Voxels = py::array_t<std::int16_t, py::array::c_style>;

/// Keeps an array. The last thread that lets go of it takes the interpreter's lock first.
std::shared_ptr<const void> kept(const py::array& array) {
  return {new py::object(array), [](void* pointer) {
            with_lock([](void* object) { delete static_cast<py::object*>(object); }, pointer);
          }};
}

std::int16_t exact_hu(double value, py::ssize_t k, py::ssize_t j, py::ssize_t i) {
  using Limits = std::numeric_limits<std::int16_t>;
  if (!(value >= Limits::min() && value <= Limits::max() && std::floor(value) == value))
    throw InputError("hu = " + std::string(py::str(py::float_(value))) +
                     " at (k, j, i) = " + std::string(py::str(py::make_tuple(k, j, i))) +
                     ": must be whole numbers from -32768 to 32767, as int16 holds them");
  return static_cast<std::int16_t>(value);
}

/// An aligned int16 array in C order is used as it is. Any other is converted slice by slice.
Voxels voxels_of_array(const Numbers& hu) {
  const py::array array = array_of_numbers(hu, "hu");
  require_shape(array, "hu", {-1, -1, -1});
  if (py::isinstance<Voxels>(array) &&
      (array.flags() & py::detail::npy_api::NPY_ARRAY_ALIGNED_) != 0)
    return array;
  Voxels voxels({array.shape(0), array.shape(1), array.shape(2)});
  for (py::ssize_t k = 0; k < array.shape(0); ++k) {
    const auto slice = converted<double>({array[py::int_(k)]}, "hu", {-1, -1});
    for (py::ssize_t j = 0; j < array.shape(1); ++j)
      for (py::ssize_t i = 0; i < array.shape(2); ++i)
        voxels.mutable_at(k, j, i) = exact_hu(slice.at(j, i), k, j, i);
  }
  return voxels;
}

Ct ct_of_array(const Numbers& numbers,
               const Numbers& spacing_mm,
               const Numbers& origin_mm,
               const Numbers& axes) {
  const Voxels hu = voxels_of_array(numbers);
  const auto direction = converted<double>(axes, "direction", {3, 3});
  CtGrid grid;
  for (int axis = 0; axis < 3; ++axis) {
    const py::ssize_t extent = hu.shape(2 - axis);
    if (extent > std::numeric_limits<int>::max())
      throw InputError("hu: shape = " + shape_text(hu) + ": must be below 2^31");
    grid.size[static_cast<std::size_t>(axis)] = static_cast<int>(extent);
  }
  grid.spacing_mm = vector_of(spacing_mm, "spacing_mm");
  grid.origin_mm = vector_of(origin_mm, "origin_mm");
  std::copy_n(direction.data(), grid.direction.size(), grid.direction.begin());
  return Ct::from_voxels(grid, kept(hu), {hu.data(), static_cast<std::size_t>(hu.size())});
}

Ct ct_read(const std::filesystem::path& path, const std::string& series_uid) {
  Ct ct = without_lock([&] { return Ct::read(path, series_uid); });
  warn_of(ct.warnings());
  return ct;
}

/// The voxels themselves, read-only. The array keeps the CT alive.
py::array_t<std::int16_t> voxels_of(const Ct& ct) {
  const py::capsule owner(new Ct(ct), [](void* pointer) { delete static_cast<Ct*>(pointer); });
  const auto& size = ct.grid().size;
  py::array_t<std::int16_t> voxels({size[2], size[1], size[0]}, ct.hu().data(), owner);
  voxels.attr("flags").attr("writeable") = false;
  return voxels;
}

}  // namespace

void bind_ct(py::module_& module) {
  py::class_<Ct> ct(module,
                    "Ct",
                    "A CT in Hounsfield units, in DICOM LPS (mm). Arrays of voxels have the order "
                    "(k, j, i).");
  ct.def(
      py::init(&ct_of_array),
      "hu"_a,
      "spacing_mm"_a,
      "origin_mm"_a = std::array<double, 3>{},
      "direction"_a =
          std::array<std::array<double, 3>, 3>{{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}},
      "A CT from an array (k, j, i) of whole HU, int16 or exact as int16. An int16 array in C "
      "order is not copied and must not change afterwards, because attenuation and hash are kept. "
      "spacing_mm and origin_mm are (x, y, z). The columns of direction belong to i, j, k.");
  ct.def_static("read",
                &ct_read,
                "path"_a,
                "series_uid"_a = "",
                "Reads a DICOM folder, or a NIfTI, MetaImage or NRRD file.");
  ct.def_property_readonly("hu", &voxels_of, "HU as int16 (k, j, i), read-only, not a copy.");
  ct.def_property_readonly(
      "size", [](const Ct& self) { return self.grid().size; }, "(i, j, k)");
  ct.def_property_readonly("spacing_mm",
                           [](const Ct& self) { return array_of(self.grid().spacing_mm); });
  ct.def_property_readonly("origin_mm",
                           [](const Ct& self) { return array_of(self.grid().origin_mm); });
  ct.def_property_readonly("center_mm",
                           [](const Ct& self) { return array_of(self.grid().center_mm()); });
  ct.def_property_readonly("direction", [](const Ct& self) {
    return py::array_t<double>({3, 3}, self.grid().direction.data());
  });
  ct.def_property_readonly(
      "content_sha256",
      &Ct::content_sha256,
      "Hash of size and voxels, but not of their place, which Field.is_of(ct) compares too.");
  ct.def(py::pickle(
      [](const Ct& self) {
        const CtGrid& grid = self.grid();
        return py::make_tuple(voxels_of(self),
                              array_of(grid.spacing_mm),
                              array_of(grid.origin_mm),
                              py::array_t<double>({3, 3}, grid.direction.data()));
      },
      [](const py::tuple& state) {
        return ct_of_array({state[0]}, {state[1]}, {state[2]}, {state[3]});
      }));
  def_protocols(ct);
  def_copies(ct);
}

}  // namespace attenuation_fields::python
