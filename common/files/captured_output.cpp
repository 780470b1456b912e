// SPDX-License-Identifier: Apache-2.0
#include "files/captured_output.h"

#include <array>
#include <cerrno>
#include <fcntl.h>
#include <system_error>
#include <thread>
#include <unistd.h>

#include "base/error.h"

namespace af {

namespace {

/// Reads until no descriptor for writing is open any more.
void read_all(int descriptor, std::string& bytes) {
  std::array<char, 1 << 16> buffer{};
  for (;;) {
    const ssize_t count = ::read(descriptor, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return;
    bytes.append(buffer.data(), static_cast<std::size_t>(count));
  }
}

}  // namespace

std::string captured_output(const std::string& what, const std::function<void(int)>& write) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0)
    throw FileError(what, "cannot be written: " + std::generic_category().message(errno));
  std::string bytes;
  std::thread reader([&] { read_all(ends[0], bytes); });
  const auto finish = [&] {
    ::close(ends[1]);
    reader.join();
    ::close(ends[0]);
  };
  try {
    write(ends[1]);
  } catch (...) {
    finish();
    throw;
  }
  finish();
  return bytes;
}

}  // namespace af
