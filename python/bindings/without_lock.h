// SPDX-License-Identifier: Apache-2.0
// The interpreter's lock around calls of the library, and its end during such calls.
#pragma once

#include <exception>
#include <optional>
#include <pybind11/pybind11.h>
#include <type_traits>
#include <utility>

#include "attenuation_fields/stop_condition.h"

namespace attenuation_fields::python {

namespace py = pybind11;

/// Gives up the interpreter's lock for a call of the library. When the interpreter ends, only the
/// last thread gets it back. CPython unwinds the others, which C++ does not survive, so they sleep
/// in take() until the process is over.
class GivenUpLock {
 public:
  GivenUpLock();
  void take();
  /// Whether one of Python's signal handlers, which run in here, has raised something, or the
  /// interpreter is ending.
  bool has_raised();

 private:
  PyThreadState* state_;
};

/// Before the process destroys its static objects, waits for calls in other threads to end.
void await_calls_at_the_end();

/// Runs `work` with the lock, on a thread that may have it already or may not belong to Python.
/// Does nothing when the interpreter is gone.
void with_lock(void (*work)(void* context), void* context);

/// Runs `compute` without the lock, and returns its result. An exception from a signal handler,
/// such as KeyboardInterrupt, ends the computation and leaves as py::error_already_set.
template <typename Compute>
std::invoke_result_t<Compute> without_lock(const Compute& compute) {
  GivenUpLock lock;
  std::optional<std::invoke_result_t<Compute>> result;
  std::exception_ptr failure;
  try {
    const StopCondition condition([&] { return lock.has_raised(); });
    result.emplace(compute());
  } catch (...) {
    failure = std::current_exception();
  }
  lock.take();
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  if (failure) std::rethrow_exception(failure);
  return *std::move(result);
}

}  // namespace attenuation_fields::python
