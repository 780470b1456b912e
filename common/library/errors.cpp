// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/errors.h"

#include <new>

#include "attenuation_fields/version.h"
#include "base/build_info.h"
#include "base/error.h"
#include "library/translation.h"
#include "parallel/communicator.h"

namespace attenuation_fields {

Error::Error(const std::string& message, int exit_code)
    : std::runtime_error(message), exit_code_(exit_code) {}
InputError::InputError(const std::string& message)
    : Error(message, static_cast<int>(af::ExitCode::Input)) {}
FileError::FileError(const std::string& message)
    : Error(message, static_cast<int>(af::ExitCode::File)) {}
NumericError::NumericError(const std::string& message)
    : Error(message, static_cast<int>(af::ExitCode::Numeric)) {}

// Here, so that there is one type information of each, in this library.
Error::~Error() = default;
InputError::~InputError() = default;
FileError::~FileError() = default;
NumericError::~NumericError() = default;

std::string version() {
  return std::string(af::program_version());
}

}  // namespace attenuation_fields

namespace af::library {

void throw_translated() {
  const std::exception_ptr error = std::current_exception();
  try {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const api::Error&) {
    throw;
  } catch (...) {
  }
  const RankFailure failure = failure_of(error);
  switch (static_cast<ExitCode>(failure.exit_code)) {
    case ExitCode::Usage:
    case ExitCode::Input:
      throw api::InputError(failure.message);
    case ExitCode::File:
      throw api::FileError(failure.message);
    case ExitCode::Numeric:
      throw api::NumericError(failure.message);
    default:
      throw api::Error(failure.message, failure.exit_code);
  }
}

}  // namespace af::library
