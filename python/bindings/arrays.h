// SPDX-License-Identifier: Apache-2.0
// Converts between NumPy arrays and the library's types. Arrays of the required kind are not
// copied.
#pragma once

#include <array>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <span>
#include <string>
#include <vector>

#include "attenuation_fields/geometry.h"
#include "attenuation_fields/renderer.h"

namespace attenuation_fields::python {

namespace py = pybind11;

/// An argument that must hold numbers: an array, a sequence, a tensor, ... Any object is accepted
/// here, so that the errors are ours.
struct Numbers {
  py::object given;
};

/// A shape as errors state it: "(3,)", "(n, 6)".
std::string shape_text(const py::array& array);

/// Throws InputError naming `name` unless the array has this shape. -1 is any extent.
void require_shape(const py::array& array, const char* name, const std::vector<py::ssize_t>& shape);

/// The argument as an array, not copied if it is one. Throws InputError naming `name` unless it
/// holds real numbers.
py::array array_of_numbers(const Numbers& numbers, const char* name);

/// The same with this shape, converted to float64 or float32 in C order.
template <typename Number>
py::array_t<Number, py::array::c_style | py::array::forcecast> converted(
    const Numbers& numbers, const char* name, const std::vector<py::ssize_t>& shape);

/// A new float32 array, or `out` itself. Throws InputError unless that is float32, C-contiguous,
/// aligned, writeable and of this shape.
py::array_t<float> output_array(const std::vector<py::ssize_t>& shape,
                                const py::object& out,
                                const char* name);

std::span<float> floats_of(py::array_t<float>& array);

/// Throws InputError naming both when two outputs share memory.
void require_apart(std::span<const float> first, std::span<const float> second, const char* names);

/// The numbers of a short list. Throws InputError naming `name`.
std::array<double, 2> pair_of(const Numbers& values, const char* name);
std::array<int, 2> whole_pair_of(const Numbers& values, const char* name);
Vector3 vector_of(const Numbers& values, const char* name);
Pose pose_of(const Numbers& matrix, const char* name);
std::vector<Pose> poses_of(const Numbers& matrices, const char* name);
py::array_t<double> matrix_of(const Pose& pose);
template <std::size_t n>
py::array_t<double> array_of(const std::array<double, n>& values) {
  return py::array_t<double>(static_cast<py::ssize_t>(n), values.data());
}

void bind_errors(py::module_& module);
void bind_geometry(py::module_& module);
void bind_ct(py::module_& module);
void bind_renderers(py::module_& module);
void bind_registration(py::module_& module);
void bind_evaluation(py::module_& module);

}  // namespace attenuation_fields::python

namespace pybind11::detail {

template <>
struct type_caster<attenuation_fields::python::Numbers> {
  PYBIND11_TYPE_CASTER(attenuation_fields::python::Numbers, const_name("ArrayLike"));
  bool load(handle source, bool /*convert*/) {
    value.given = reinterpret_borrow<object>(source);
    return true;
  }
  static handle cast(const attenuation_fields::python::Numbers& numbers,
                     return_value_policy /*policy*/,
                     handle /*parent*/) {
    return numbers.given.inc_ref();
  }
};

}  // namespace pybind11::detail
