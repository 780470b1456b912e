// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <type_traits>
#include <utility>

namespace af {

/// Memory backed by a file, to which the system writes what does not fit, so it can exceed the
/// memory of the machine or its batch job. The file has no name and disappears with the program.
class FileBackedMemory {
 public:
  /// `folder` must exist when resize() is called.
  explicit FileBackedMemory(std::filesystem::path folder) : folder_(std::move(folder)) {}
  ~FileBackedMemory();
  FileBackedMemory(const FileBackedMemory&) = delete;
  FileBackedMemory& operator=(const FileBackedMemory&) = delete;

  /// Existing content stays, perhaps at another address; new content is zero. FileError naming the
  /// folder when its disk has no room.
  void grow(std::size_t bytes);
  [[nodiscard]] std::byte* data() const { return data_; }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  std::filesystem::path folder_;
  int file_ = -1;
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

/// An array in file-backed memory. \test FileBackedArray.KeepsWhatItHoldsWhenItGrows
template <typename T>
class FileBackedArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  explicit FileBackedArray(std::filesystem::path folder) : memory_(std::move(folder)) {}

  /// Elements whose bytes are zero, for the caller to assign; valid until the next call. FileError.
  std::span<T> append(std::size_t count) {
    const std::size_t before = view().size();
    memory_.grow((before + count) * sizeof(T));
    return {reinterpret_cast<T*>(memory_.data()) + before, count};
  }
  [[nodiscard]] std::span<const T> view() const {
    return {reinterpret_cast<const T*>(memory_.data()), memory_.size() / sizeof(T)};
  }

 private:
  FileBackedMemory memory_;
};

}  // namespace af
