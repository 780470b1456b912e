// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "support/test_paths.h"

namespace af::test {

/// The message of the ErrorType that `action` throws. Anything else fails the test and returns "".
template <typename ErrorType, typename Action>
std::string message_of(const Action& action) {
  try {
    action();
  } catch (const ErrorType& error) {
    return error.what();
  } catch (const std::exception& error) {
    ADD_FAILURE() << "another kind of error: " << error.what();
    return {};
  }
  ADD_FAILURE() << "no error";
  return {};
}

/// Writes a small input file, without the syncing that outputs need. Removes the file first,
/// because file systems sync a file that is truncated and written anew.
inline void write_input(const std::filesystem::path& path, const std::string& text) {
  std::filesystem::remove(path);
  std::ofstream(path, std::ios::binary) << text;
}

/// `text` with its first `from` replaced. `from` must be there.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t place = text.find(from);
  EXPECT_NE(place, std::string::npos) << from;
  return text.replace(place, from.size(), to);
}

/// Feeds a reader with damaged copies of a good text: every `step`-th truncation and `count` copies
/// with a few bytes changed, removed or doubled. Each must be read or refused with an af::Error.
/// Returns how many were refused.
inline std::size_t refused_damaged_copies(const std::string& good,
                                          std::size_t step,
                                          std::size_t count,
                                          const std::function<void(const std::string&)>& read) {
  std::size_t refused = 0;
  const auto try_one = [&](const std::string& text) {
    try {
      read(text);
    } catch (const Error&) {
      ++refused;
    } catch (const std::exception& error) {
      ADD_FAILURE() << "not an af::Error: " << error.what() << "\nfor the text:\n" << text;
    }
  };
  for (std::size_t length = 0; length < good.size(); length += step)
    try_one(good.substr(0, length));
  for (std::size_t i = 0; i < count; ++i) {
    HashRandom random(1, i);
    std::string text = good;
    for (std::uint64_t edit = random.below(4) + 1; edit > 0 && text.size() > 1; --edit) {
      const std::size_t place = random.below(text.size());
      switch (random.below(3)) {
        case 0:
          text[place] = static_cast<char>(random.below(256));
          break;
        case 1:
          text.erase(place, random.below(10));
          break;
        default:
          text.insert(place, text.substr(random.below(text.size()), random.below(20)));
      }
    }
    try_one(text);
  }
  return refused;
}

}  // namespace af::test
