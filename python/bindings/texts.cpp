// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/texts.h"

namespace attenuation_fields::python {
namespace {

py::str decoded(std::string_view bytes, const char* errors) {
  PyObject* const text =
      PyUnicode_DecodeUTF8(bytes.data(), static_cast<py::ssize_t>(bytes.size()), errors);
  if (text == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<py::str>(text);
}

}  // namespace

py::str message_of(std::string_view text) {
  return decoded(text, "backslashreplace");
}

py::str cell_of(std::string_view bytes) {
  return decoded(bytes, "surrogateescape");
}

void warn_of(const std::vector<std::string>& texts) {
  for (const std::string& text : texts) {
    const auto utf8 = message_of(text).cast<std::string>();
    if (PyErr_WarnEx(PyExc_UserWarning, utf8.c_str(), 1) != 0) throw py::error_already_set();
  }
}

}  // namespace attenuation_fields::python
