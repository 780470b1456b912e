// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/errors.h"

#include <algorithm>
#include <iterator>
#include <new>
#include <string_view>

#include "attenuation_fields/version.h"
#include "base/build_info.h"
#include "base/error.h"
#include "library/translation.h"
#include "ranks/communicator.h"

namespace attenuation_fields {

Error::Error(const std::string& message, int exit_code)
    : std::runtime_error(message), exit_code_(exit_code) {}
InputError::InputError(const std::string& message)
    : Error(message, static_cast<int>(af::ExitCode::Input)) {}
FileError::FileError(const std::string& message)
    : Error(message, static_cast<int>(af::ExitCode::File)) {}
NumericError::NumericError(const std::string& message)
    : Error(message, static_cast<int>(af::ExitCode::Numeric)) {}

// Defined here, so that each has one type information, in this library.
Error::~Error() = default;
InputError::~InputError() = default;
FileError::~FileError() = default;
NumericError::~NumericError() = default;

std::string version() {
  return std::string(af::program_version());
}

}  // namespace attenuation_fields

namespace af::library {
namespace {

/// What this library calls an option of the programs. Empty for those that it does not have.
std::string_view name_of_option(std::string_view option) {
  struct Option {
    std::string_view of_programs;
    std::string_view here;
  };
  static constexpr Option kOptions[] = {{"air-below-hu", "air_below_hu"},
                                        {"aluminium-mm", "aluminium_mm"},
                                        {"calibration-error-px", "calibration_error_px"},
                                        {"chain", "chains"},
                                        {"correct", "correct"},
                                        {"field", "fields"},
                                        {"look-up", "look_up"},
                                        {"max-evaluations", "max_evaluations"},
                                        {"no-uncertainty", "no_uncertainty"},
                                        {"optimizer", "optimizer"},
                                        {"preset", "preset"},
                                        {"region", "region"},
                                        {"renderer", "renderer"},
                                        {"scatter-to-primary", "scatter_to_primary"},
                                        {"search-modes", "modes"},
                                        {"search-orientations", "orientations"},
                                        {"search-rotation-deg", "rotation_deg"},
                                        {"search-translation-mm", "translation_mm"},
                                        {"seed", "seed"},
                                        {"series", "series_uid"},
                                        {"similarity", "similarity"},
                                        {"skip-ct-check", "skip_ct_check"},
                                        {"step-mm", "step_mm"},
                                        {"threads", "threads"},
                                        {"tube-kvp", "tube_kvp"},
                                        {"water-mu-per-mm", "water_mu_per_mm"}};
  const auto* const found = std::find_if(std::begin(kOptions), std::end(kOptions), [&](auto& row) {
    return row.of_programs == option;
  });
  return found == std::end(kOptions) ? std::string_view() : found->here;
}

/// Takes ` LAT=FIELD.h5`, the value of --field, from the beginning of `text`, and returns it as
/// `={"LAT": "FIELD.h5"}`.
std::string map_value(std::string_view& text) {
  const std::size_t middle = text.find('=');
  const std::size_t end = std::min(text.find(','), text.size());
  if (!text.starts_with(' ') || middle >= end) return {};
  std::string value = "={\"" + std::string(text.substr(1, middle - 1)) + "\": \"" +
                      std::string(text.substr(middle + 1, end - middle - 1)) + "\"}";
  text.remove_prefix(end);
  return value;
}

/// The text with the library's names in place of "--option". Options that the library does not have
/// stay, because they are advice to use a program.
std::string in_names_of_library(std::string_view text) {
  constexpr std::string_view kLetters = "abcdefghijklmnopqrstuvwxyz-";
  std::string result;
  for (std::size_t at = text.find("--"); at != std::string_view::npos; at = text.find("--")) {
    const std::size_t end = std::min(text.find_first_not_of(kLetters, at), text.size());
    const std::string_view name = name_of_option(text.substr(at + 2, end - at - 2));
    result += text.substr(0, at);
    result += name.empty() ? text.substr(at, end - at) : name;
    text.remove_prefix(end);
    if (name == "fields") result += map_value(text);
  }
  return result += text;
}

}  // namespace

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
  RankFailure failure = failure_of(error);
  failure.message = in_names_of_library(failure.message);
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
