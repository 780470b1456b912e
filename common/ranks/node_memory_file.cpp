// SPDX-License-Identifier: Apache-2.0
#include "ranks/node_memory_file.h"

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <new>
#include <sys/mman.h>
#include <sys/statvfs.h>
#include <system_error>
#include <unistd.h>

#include "base/error.h"

namespace af {

namespace {

constexpr mode_t kMode = 0600;

FileError failure(const std::string& name, const std::string& what) {
  return {"/dev/shm" + name, what + ": " + std::generic_category().message(errno)};
}

InputError no_room(int descriptor, std::size_t bytes) {
  struct statvfs found {};
  std::string room;
  constexpr std::size_t kMegabyte = 1000000;
  if (fstatvfs(descriptor, &found) == 0)
    room =
        ", which has " + std::to_string(found.f_bavail * found.f_frsize / kMegabyte) + " MB left";
  return {"memory that the ranks of a node share",
          std::to_string(bytes / kMegabyte + 1) + " MB",
          "must fit in /dev/shm" + room + ": enlarge it, or use one rank per node"};
}

}  // namespace

NodeMemoryFile::~NodeMemoryFile() {
  if (!created_.empty()) ::shm_unlink(created_.c_str());
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::string NodeMemoryFile::create(std::size_t bytes) {
  std::string name;
  // A killed process with this number may have left a file.
  for (int turn = 0; descriptor_ < 0; ++turn) {
    name = "/af-" + std::to_string(::getpid()) + "-" + std::to_string(turn);
    descriptor_ = ::shm_open(name.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, kMode);
    if (descriptor_ < 0 && errno != EEXIST) throw failure(name, "cannot be made");
  }
  created_ = name;
  // Reserves all of the memory at once: touching a page for which there is no room ends the
  // process.
  do errno = ::posix_fallocate(descriptor_, 0, static_cast<off_t>(std::max<std::size_t>(bytes, 1)));
  while (errno == EINTR);
  if (errno == ENOSPC || errno == EFBIG || errno == ENOMEM) throw no_room(descriptor_, bytes);
  if (errno != 0) throw failure(name, "cannot be enlarged");
  return name;
}

void NodeMemoryFile::open(const std::string& name) {
  descriptor_ = ::shm_open(name.c_str(), O_RDWR | O_CLOEXEC, kMode);
  if (descriptor_ < 0) throw failure(name, "cannot be opened");
}

std::shared_ptr<std::byte> NodeMemoryFile::map(std::size_t bytes) const {
  const std::size_t mapped = std::max<std::size_t>(bytes, 1);
  void* const start = ::mmap(nullptr, mapped, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, 0);
  if (start == MAP_FAILED) throw std::bad_alloc();
  return {static_cast<std::byte*>(start),
          [mapped](std::byte* memory) { ::munmap(memory, mapped); }};
}

}  // namespace af
