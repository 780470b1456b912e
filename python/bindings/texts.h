// SPDX-License-Identifier: Apache-2.0
// The library's texts as Python strings. File names and cells may hold bytes that are not UTF-8.
#pragma once

#include <pybind11/pybind11.h>
#include <string>
#include <string_view>
#include <vector>

namespace attenuation_fields::python {

namespace py = pybind11;

/// For people to read: other bytes become \xNN.
py::str message_of(std::string_view text);

/// As os.fsdecode() has it: text.encode("utf-8", "surrogateescape") gives all bytes back.
py::str cell_of(std::string_view bytes);

/// Gives each as a UserWarning. Throws py::error_already_set where warnings are errors.
void warn_of(const std::vector<std::string>& texts);

}  // namespace attenuation_fields::python
