// SPDX-License-Identifier: Apache-2.0
#include <exception>

#include "attenuation_fields/errors.h"
#include "attenuation_fields/version.h"
#include "python/bindings/arrays.h"
#include "python/bindings/texts.h"
#include "python/bindings/without_lock.h"

namespace attenuation_fields::python {
namespace {

/// Raises attenuation_fields.errors.NAME with the text and the exit code of the programs.
void raise(const char* name, const Error& error) {
  const py::object type = py::module_::import("attenuation_fields.errors").attr(name);
  py::object exception = type(message_of(error.what()));
  exception.attr("exit_code") = error.exit_code();
  PyErr_SetObject(type.ptr(), exception.ptr());
}

}  // namespace

void bind_errors(py::module_& /*module*/) {
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const InputError& error) {
      raise("InputError", error);
    } catch (const FileError& error) {
      raise("FileError", error);
    } catch (const NumericError& error) {
      raise("NumericError", error);
    } catch (const Error& error) {
      raise("Error", error);
    }
  });
}

}  // namespace attenuation_fields::python

// NOLINTNEXTLINE(readability-identifier-naming): the name of the module
PYBIND11_MODULE(_core, module) {
  namespace bindings = attenuation_fields::python;
  module.doc() = "The compiled part of attenuation_fields.";
  bindings::await_calls_at_the_end();
  bindings::bind_errors(module);
  bindings::bind_geometry(module);
  bindings::bind_ct(module);
  bindings::bind_renderers(module);
  bindings::bind_registration(module);
  bindings::bind_evaluation(module);
  module.def("version", &attenuation_fields::version, "Version of the library.");
}
