// SPDX-License-Identifier: Apache-2.0
// What the fuzzers share. Each fuzz_*.cpp is one libFuzzer target; tests/fuzz/replay_main.cpp gives
// the same functions stored inputs instead.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace af::fuzz {

/// A folder of this process, emptied when it ends; in memory when TMPDIR is.
const std::filesystem::path& scratch_folder();

/// Writes an input under a name within scratch_folder(); returns its path.
std::filesystem::path written(const std::string& name, std::string_view bytes);

/// Ends the process with a message unless the condition holds, which every accepted input must
/// meet.
void require(bool condition, const char* what);

inline std::string_view as_text(std::span<const std::uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Runs `read`; false when it refused the input with one of the project's errors. Any other
/// exception ends the process and is a finding: out of memory, broken promises, other libraries'
/// exceptions, even when all_or_none() has turned them into errors.
template <typename Read>
bool is_accepted(Read&& read) {
  try {
    read();
    return true;
  } catch (const Error& error) {
    require(error.exit_code() != ExitCode::Internal, error.what());
    return false;
  }
}

/// Takes values from the front of an input. After its end come zeros.
class InputBytes {
 public:
  InputBytes(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}

  [[nodiscard]] bool empty() const { return rest_.empty(); }
  [[nodiscard]] std::span<const std::uint8_t> rest() const { return rest_; }

  std::span<const std::uint8_t> take_bytes(std::size_t count) {
    const auto taken = rest_.first(std::min(count, rest_.size()));
    rest_ = rest_.subspan(taken.size());
    return taken;
  }
  template <typename T>
  T take() {
    static_assert(std::is_trivially_copyable_v<T>);
    T value{};
    const auto bytes = take_bytes(sizeof(T));
    if (!bytes.empty()) std::memcpy(&value, bytes.data(), bytes.size());
    return value;
  }
  /// 0 ... count - 1.
  std::size_t take_below(std::size_t count) { return take<std::uint16_t>() % count; }

 private:
  std::span<const std::uint8_t> rest_;
};

}  // namespace af::fuzz
