// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/arrays.h"

#include <algorithm>
#include <functional>

#include "attenuation_fields/errors.h"

namespace attenuation_fields::python {
namespace {

std::string extents_text(const std::vector<py::ssize_t>& extents) {
  std::string text = "(";
  for (std::size_t i = 0; i < extents.size(); ++i)
    text += (i == 0 ? "" : ", ") + (extents[i] < 0 ? "n" : std::to_string(extents[i]));
  return text + (extents.size() == 1 ? ",)" : ")");
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

void require_aligned(const py::array& array, const char* name) {
  if ((array.flags() & py::detail::npy_api::NPY_ARRAY_ALIGNED_) == 0)
    throw InputError(std::string(name) +
                     " = an array whose numbers do not stand at multiples of their size in memory: "
                     "must be aligned (numpy.require(array, requirements=\"A\"))");
}

py::array_t<float> output_array(const std::vector<py::ssize_t>& shape,
                                const py::object& out,
                                const char* name) {
  if (out.is_none()) return py::array_t<float>(shape);
  using Exact = py::array_t<float, py::array::c_style>;
  if (!py::isinstance<Exact>(out))
    throw InputError(std::string(name) + " = another kind of array: must be float32 in C order");
  auto array = py::reinterpret_borrow<py::array_t<float>>(out);
  require_shape(array, name, shape);
  if (!array.writeable())
    throw InputError(std::string(name) + " = a read-only array: must be writeable");
  require_aligned(array, name);
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

Vector3 vector_of(const Numbers& values, const char* name) {
  require_shape(values, name, {3});
  return {values.at(0), values.at(1), values.at(2)};
}

Pose pose_of(const Numbers& matrix, const char* name) {
  require_shape(matrix, name, {4, 4});
  Pose pose;
  std::copy_n(matrix.data(), pose.room_from_ct.size(), pose.room_from_ct.begin());
  return pose;
}

std::vector<Pose> poses_of(const Numbers& matrices, const char* name) {
  require_shape(matrices, name, {-1, 4, 4});
  std::vector<Pose> poses(static_cast<std::size_t>(matrices.shape(0)));
  const double* values = matrices.data();
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
