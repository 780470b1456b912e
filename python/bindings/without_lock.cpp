// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/without_lock.h"

#include <atomic>
#include <chrono>
#include <cxxabi.h>
#include <thread>
#include <unistd.h>

namespace attenuation_fields::python {
namespace {

std::atomic<int> calls = 0;  ///< of the library, counted over all threads

bool is_ending() {
#if PY_VERSION_HEX >= 0x030D0000
  return Py_IsFinalizing() != 0;
#else
  return _Py_IsFinalizing() != 0;
#endif
}

template <typename Call>
auto or_sleep(const Call& call) {
  try {
    return call();
  } catch (const abi::__forced_unwind&) {
    for (;;) ::pause();
  }
}

}  // namespace

GivenUpLock::GivenUpLock() : state_(PyEval_SaveThread()) {
  ++calls;
}

void GivenUpLock::take() {
  --calls;
  or_sleep([&] { PyEval_RestoreThread(state_); });
}

bool GivenUpLock::has_raised() {
  if (is_ending()) return true;
  take();
  const bool has = PyErr_CheckSignals() != 0;
  state_ = PyEval_SaveThread();
  ++calls;
  return has;
}

void await_calls_at_the_end() {
  Py_AtExit([] {
    constexpr std::chrono::seconds kLongest{10};  // a file may be read from a slow disk
    const auto until = std::chrono::steady_clock::now() + kLongest;
    while (calls > 0 && std::chrono::steady_clock::now() < until)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
  });
}

void with_lock(void (*work)(void* context), void* context) {
  if (Py_IsInitialized() == 0) return;
  const PyGILState_STATE before = or_sleep([] { return PyGILState_Ensure(); });
  work(context);
  PyGILState_Release(before);
}

}  // namespace attenuation_fields::python
