// SPDX-License-Identifier: Apache-2.0
// What can be made again at any time, kept for one user between runs. There is a file for each key,
// in attenuation-fields/ of $XDG_CACHE_HOME or else of $HOME/.cache. Where that folder does not
// exist, cannot be written, or may be entered by others, nothing is kept and no message appears:
// only time is lost.
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

/// What was kept under a key. Throws FileError when there is nothing, or it is damaged.
std::vector<std::byte> read(const std::string& key);
/// Throws as make_folder() and write_text_file() do.
void write(const std::string& key, std::span<const std::byte> bytes);

}  // namespace user_cache

/// The value that was kept under a key, which is the name of a file. None when there is no whole
/// one.
template <typename T>
std::optional<T> cached(const std::string& key) {
  try {
    return value_of<T>(user_cache::read(key), key);
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

/// Keeps a value if that is possible. Its bytes belong to this build (stored_bytes.h), so the key
/// must name what they depend on.
template <typename T>
void keep_in_cache(const std::string& key, const T& value) {
  try {
    user_cache::write(key, bytes_of(value));
  } catch (const std::exception&) {  // it will be made again
  }
}

}  // namespace af
