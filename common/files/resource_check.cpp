// SPDX-License-Identifier: Apache-2.0
#include "files/resource_check.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <locale>
#include <sstream>
#include <sys/resource.h>

#include "base/error.h"

namespace af {

namespace {

namespace fs = std::filesystem;

std::string size_text(double bytes) {
  constexpr double kSmall = 1e7;
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text << std::fixed;
  text.precision(0);
  if (bytes < kSmall)
    text << bytes << " bytes";
  else
    text << std::ceil(bytes / 1e6) << " MB";
  return text.str();
}

/// Memory without paging. Infinite where the system does not tell.
double available_memory_bytes() {
  double available = std::numeric_limits<double>::infinity();
  std::ifstream file("/proc/meminfo");
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string name;
    double kibibytes = 0.0;
    if (words >> name >> kibibytes && name == "MemAvailable:") available = kibibytes * 1024.0;
  }
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY)
    available = std::min(available, static_cast<double>(limit.rlim_cur));
  return available;
}

}  // namespace

void require_disk_space(const fs::path& path, double bytes) {
  std::error_code error;
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  const fs::space_info space = fs::space(folder, error);
  if (error || bytes <= static_cast<double>(space.available)) return;
  throw InputError("output",
                   "'" + path.string() + "' of " + size_text(bytes),
                   "must fit on its disk, which has " +
                       size_text(static_cast<double>(space.available)) + " left");
}

void require_memory(const std::string& what, double bytes) {
  const double available = available_memory_bytes();
  if (bytes <= available) return;
  throw InputError(what,
                   size_text(bytes) + " of memory",
                   "must fit into the " + size_text(available) + " that are available");
}

}  // namespace af
