// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <string>

namespace af {

/// Memory that the processes of one node share, by a file in the system's shared memory (/dev/shm).
/// One process creates it, and the others open it by name. Each keeps what it has mapped for as
/// long as it likes, and lets go of it alone. The file's name vanishes with the creator's object,
/// so nothing remains of a killed job.
class NodeMemoryFile {
 public:
  NodeMemoryFile() = default;
  ~NodeMemoryFile();
  NodeMemoryFile(const NodeMemoryFile&) = delete;
  NodeMemoryFile& operator=(const NodeMemoryFile&) = delete;

  /// The name under which others open it. Throws InputError when the node's shared memory has no
  /// room for `bytes`, FileError when there is no shared memory.
  std::string create(std::size_t bytes);
  void open(const std::string& name);
  /// Aligned to a page. Throws std::bad_alloc.
  [[nodiscard]] std::shared_ptr<std::byte> map(std::size_t bytes) const;

 private:
  int descriptor_ = -1;
  std::string created_;
};

}  // namespace af
