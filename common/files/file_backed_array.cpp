// SPDX-License-Identifier: Apache-2.0
#include "files/file_backed_array.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <string>
#include <sys/mman.h>
#include <unistd.h>

#include "base/error.h"

namespace af {

namespace {

constexpr mode_t kOwnerOnly = 0600;

/// Opens a file in `folder` that has no name; -1 with errno. Network file systems cannot make a
/// file without a name: there this removes the name at once.
int open_nameless(const std::filesystem::path& folder) {
  const int file = open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, kOwnerOnly);
  if (file >= 0 || (errno != EOPNOTSUPP && errno != EISDIR)) return file;
  std::string name = (folder / "memory-XXXXXX").string();
  const int named = mkostemp(name.data(), O_CLOEXEC);
  if (named >= 0) unlink(name.c_str());
  return named;
}

}  // namespace

FileBackedMemory::~FileBackedMemory() {
  if (data_ != nullptr) munmap(data_, size_);
  if (file_ >= 0) close(file_);
}

void FileBackedMemory::grow(std::size_t bytes) {
  if (bytes <= size_) return;
  const auto refuse = [&](int error) {
    throw FileError(folder_.string(),
                    "no room for " + std::to_string(bytes) +
                        " bytes of the file that backs memory: " + std::strerror(error));
  };
  if (file_ < 0) file_ = open_nameless(folder_);
  if (file_ < 0) refuse(errno);
  // Writing to a page that has no place on the disk would end the program.
  int error = EINTR;
  while (error == EINTR)
    error = posix_fallocate(
        file_, static_cast<off_t>(size_), static_cast<off_t>(bytes) - static_cast<off_t>(size_));
  if (error != 0) refuse(error);
  void* const mapped = data_ == nullptr
                           ? mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file_, 0)
                           : mremap(data_, size_, bytes, MREMAP_MAYMOVE);
  if (mapped == MAP_FAILED) refuse(errno);
  data_ = static_cast<std::byte*>(mapped);
  size_ = bytes;
}

}  // namespace af
