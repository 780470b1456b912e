// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/arrays.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string_view>

#include "attenuation_fields/errors.h"

namespace attenuation_fields::python {
namespace {

std::string extents_text(const std::vector<py::ssize_t>& extents) {
  std::string text = "(";
  for (std::size_t i = 0; i < extents.size(); ++i)
    text += (i == 0 ? "" : ", ") + (extents[i] < 0 ? "n" : std::to_string(extents[i]));
  return text + (extents.size() == 1 ? ",)" : ")");
}

std::string type_text(const py::object& object) {
  return py::str(py::type::of(object).attr("__name__"));
}

std::string dtype_text(const py::array& array) {
  return py::str(array.dtype());
}

/// The n numbers of a Python list or tuple, which is the usual way to give a few numbers, without
/// an array in between. None of any other object.
template <std::size_t n>
std::optional<std::array<double, n>> few_of(const py::object& given) {
  const bool is_list = PyList_CheckExact(given.ptr()) != 0;
  if (!is_list && PyTuple_CheckExact(given.ptr()) == 0) return std::nullopt;
  if (PySequence_Fast_GET_SIZE(given.ptr()) != static_cast<py::ssize_t>(n)) return std::nullopt;
  std::array<double, n> values{};
  for (std::size_t i = 0; i < n; ++i) {
    PyObject* const item = PySequence_Fast_GET_ITEM(given.ptr(), static_cast<py::ssize_t>(i));
    if (PyFloat_Check(item) == 0) return std::nullopt;
    values[i] = PyFloat_AS_DOUBLE(item);
  }
  return values;
}

template <std::size_t n>
std::array<double, n> few_of(const Numbers& numbers, const char* name) {
  if (const auto few = few_of<n>(numbers.given)) return *few;
  const auto array = converted<double>(numbers, name, {static_cast<py::ssize_t>(n)});
  std::array<double, n> values{};
  std::copy_n(array.data(), n, values.begin());
  return values;
}

}  // namespace

std::string shape_text(const py::array& array) {
  return extents_text({array.shape(), array.shape() + array.ndim()});
}

void require_shape(const py::array& array,
                   const char* name,
                   const std::vector<py::ssize_t>& shape) {
  bool is_right = array.ndim() == static_cast<py::ssize_t>(shape.size());
  for (std::size_t i = 0; is_right && i < shape.size(); ++i)
    is_right = shape[i] < 0 || array.shape(static_cast<py::ssize_t>(i)) == shape[i];
  if (!is_right)
    throw InputError(std::string(name) + ": shape = " + shape_text(array) + ": must be " +
                     extents_text(shape));
}

py::array array_of_numbers(const Numbers& numbers, const char* name) {
  constexpr std::string_view kKinds = "biufO";  // objects may be numbers: Decimal, Fraction
  const auto refuse = [&](const std::string& found) {
    throw InputError(std::string(name) + " = " + found + ": must be an array of real numbers");
  };
  py::array array;
  try {
    array = py::module_::import("numpy").attr("asarray")(numbers.given);
  } catch (py::error_already_set& error) {
    if (!error.matches(PyExc_ValueError) && !error.matches(PyExc_TypeError)) throw;
    refuse(type_text(numbers.given));
  }
  if (numbers.given.is_none()) refuse("None");
  if (kKinds.find(array.dtype().kind()) == std::string_view::npos)
    refuse(type_text(numbers.given) + " of " + dtype_text(array));
  return array;
}

template <typename Number>
py::array_t<Number, py::array::c_style | py::array::forcecast> converted(
    const Numbers& numbers, const char* name, const std::vector<py::ssize_t>& shape) {
  const py::array array = array_of_numbers(numbers, name);
  require_shape(array, name, shape);
  const auto found = py::array_t<Number, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!found)
    throw InputError(std::string(name) + " = " + type_text(numbers.given) +
                     " of other objects than numbers: must be an array of real numbers");
  return found;
}
template py::array_t<double, py::array::c_style | py::array::forcecast> converted(
    const Numbers&, const char*, const std::vector<py::ssize_t>&);
template py::array_t<float, py::array::c_style | py::array::forcecast> converted(
    const Numbers&, const char*, const std::vector<py::ssize_t>&);

py::array_t<float> output_array(const std::vector<py::ssize_t>& shape,
                                const py::object& out,
                                const char* name) {
  if (out.is_none()) return py::array_t<float>(shape);
  using Exact = py::array_t<float, py::array::c_style>;
  if (!py::isinstance<Exact>(out)) {
    std::string found = type_text(out);
    if (py::isinstance<py::array>(out)) {
      const auto other = py::reinterpret_borrow<py::array>(out);
      found = dtype_text(other) + " " + shape_text(other);
    }
    throw InputError(std::string(name) + " = " + found + ": must be float32 in C order, " +
                     extents_text(shape));
  }
  auto array = py::reinterpret_borrow<py::array_t<float>>(out);
  require_shape(array, name, shape);
  if (!array.writeable())
    throw InputError(std::string(name) + " = a read-only array: must be writeable");
  if ((array.flags() & py::detail::npy_api::NPY_ARRAY_ALIGNED_) == 0)
    throw InputError(std::string(name) +
                     " = an array whose numbers do not stand at multiples of their size in memory: "
                     "must be aligned (numpy.require(array, requirements=\"A\"))");
  return array;
}

std::span<float> floats_of(py::array_t<float>& array) {
  return {array.mutable_data(), static_cast<std::size_t>(array.size())};
}

void require_apart(std::span<const float> first, std::span<const float> second, const char* names) {
  const std::less<const float*> is_before;
  const auto ends_before = [&](std::span<const float> a, std::span<const float> b) {
    return !is_before(b.data(), a.data() + a.size());
  };
  if (!ends_before(first, second) && !ends_before(second, first))
    throw InputError(std::string(names) + " = the same memory: must not overlap");
}

std::array<double, 2> pair_of(const Numbers& values, const char* name) {
  return few_of<2>(values, name);
}

std::array<int, 2> whole_pair_of(const Numbers& values, const char* name) {
  std::array<int, 2> whole{};
  const std::array<double, 2> pair = few_of<2>(values, name);
  for (std::size_t i = 0; i < 2; ++i) {
    if (!(std::abs(pair[i]) <= std::numeric_limits<int>::max() && std::floor(pair[i]) == pair[i]))
      throw InputError(std::string(name) + " = " + std::string(py::str(py::float_(pair[i]))) +
                       ": must be whole numbers below 2^31");
    whole[i] = static_cast<int>(pair[i]);
  }
  return whole;
}

Vector3 vector_of(const Numbers& values, const char* name) {
  return few_of<3>(values, name);
}

Pose pose_of(const Numbers& matrix, const char* name) {
  const auto values = converted<double>(matrix, name, {4, 4});
  Pose pose;
  std::copy_n(values.data(), pose.room_from_ct.size(), pose.room_from_ct.begin());
  return pose;
}

std::vector<Pose> poses_of(const Numbers& matrices, const char* name) {
  const auto array = converted<double>(matrices, name, {-1, 4, 4});
  std::vector<Pose> poses(static_cast<std::size_t>(array.shape(0)));
  const double* values = array.data();
  for (Pose& pose : poses) {
    std::copy_n(values, pose.room_from_ct.size(), pose.room_from_ct.begin());
    values += pose.room_from_ct.size();
  }
  return poses;
}

py::array_t<double> matrix_of(const Pose& pose) {
  return py::array_t<double>({4, 4}, pose.room_from_ct.data());
}

}  // namespace attenuation_fields::python
