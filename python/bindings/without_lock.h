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

/// The interpreter's lock given up, for a call of the library. When the interpreter ends, threads
/// other than the last never get it back: CPython unwinds them, which C++ does not survive, so they
/// sleep in take() until the process is over.
class GivenUpLock {
 public:
  GivenUpLock();
  void take();
  /// Whether one of Python's signal handlers, which run in here, has raised something, or the
  /// interpreter ends.
  bool has_raised();

 private:
  PyThreadState* state_;
};

/// Before the process destroys its static objects, it waits for calls of other threads to end.
void await_calls_at_the_end();

/// Runs `work` with the lock, on a thread that may have it already or be none of Python's; not at
/// all when the interpreter is gone.
void with_lock(void (*work)(void* context), void* context);

/// Runs `compute` without the lock, and gives its result. What a signal handler raises, such as
/// KeyboardInterrupt, ends the computation and leaves as py::error_already_set.
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
