// SPDX-License-Identifier: Apache-2.0
// What can be made again at any time, kept for one user between runs: a file for each key, in
// attenuation-fields/ of $XDG_CACHE_HOME or else of $HOME/.cache. Where there is no such folder, it
// cannot be written, or others may enter it, nothing is kept and nobody is told: only time is lost.
#pragma once

#include <cstddef>
#include <exception>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/stored_bytes.h"

namespace af {

namespace user_cache {

/// What was kept under a key. FileError when there is nothing, or it is damaged.
std::vector<std::byte> read(const std::string& key);
/// Errors as make_folder() and write_text_file().
void write(const std::string& key, std::span<const std::byte> bytes);

}  // namespace user_cache

/// The value that was kept under a key, which is the name of a file; none when there is none whole.
template <typename T>
std::optional<T> cached(const std::string& key) {
  try {
    return value_of<T>(user_cache::read(key), key);
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

/// Keeps a value if that is possible. Its bytes are of this build (stored_bytes.h): the key must
/// name what they depend on.
template <typename T>
void keep_in_cache(const std::string& key, const T& value) {
  try {
    user_cache::write(key, bytes_of(value));
  } catch (const std::exception&) {  // it is made again
  }
}

}  // namespace af
