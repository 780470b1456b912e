// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/ct.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "attenuation_fields/errors.h"
#include "python/bindings/arrays.h"
#include "python/bindings/texts.h"

namespace attenuation_fields::python {
namespace {

using namespace pybind11::literals;

/// int16, C order: such an array is taken as it is, another is converted.
using Voxels = py::array_t<std::int16_t, py::array::c_style>;

/// Keeps an array; the last thread that lets go of it takes the interpreter's lock first.
std::shared_ptr<const void> kept(const py::array& array) {
  auto* const reference = new py::object(array);
  return {reference, [](const void* pointer) {
            const py::gil_scoped_acquire lock;
            delete static_cast<const py::object*>(pointer);
          }};
}

Ct ct_of_array(const Voxels& hu,
               const Numbers& spacing_mm,
               const Numbers& origin_mm,
               const Numbers& direction) {
  require_shape(hu, "hu", {-1, -1, -1});
  require_aligned(hu, "hu");
  require_shape(direction, "direction", {3, 3});
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
  Ct ct = [&] {
    const py::gil_scoped_release release;
    return Ct::read(path, series_uid);
  }();
  warn_of(ct.warnings());
  return ct;
}

/// The voxels themselves, read-only; the array keeps the CT.
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
      "A CT of an int16 array (k, j, i), which is not copied when it is in C order: it must "
      "not change afterwards, because attenuation and hash are kept. spacing_mm and origin_mm are "
      "(x, y, z), the columns of direction those of i, j, k.");
  ct.def_static("read",
                &ct_read,
                "path"_a,
                "series_uid"_a = "",
                "A DICOM folder, NIfTI, MetaImage or NRRD file.");
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
  ct.def_property_readonly("content_sha256",
                           &Ct::content_sha256,
                           "Of size and voxels, not of where they lie: Field.is_of(ct) compares "
                           "that, too.");
}

}  // namespace attenuation_fields::python
