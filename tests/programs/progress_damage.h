// SPDX-License-Identifier: Apache-2.0
// Ways in which the files of unfinished work may be damaged between two runs.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ostream>
#include <random>
#include <string>
#include <sys/stat.h>
#include <vector>

namespace af::test {

enum class Damage { FlippedBytes, CutOff, Swapped, Deleted, Folder, Pipe, Link };
constexpr std::array kDamages = {Damage::FlippedBytes,
                                 Damage::CutOff,
                                 Damage::Swapped,
                                 Damage::Deleted,
                                 Damage::Folder,
                                 Damage::Pipe,
                                 Damage::Link};

inline const char* name_of(Damage damage) {
  constexpr std::array names = {
      "flipped bytes", "cut off", "swapped", "deleted", "a folder", "a pipe", "a link"};
  return names[static_cast<std::size_t>(damage)];
}

inline void PrintTo(Damage damage, std::ostream* out) {
  *out << name_of(damage);
}

/// The files of a folder, sorted by name, so that the same draw finds the same file.
inline std::vector<std::filesystem::path> files_of(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

inline void flip_bytes(const std::filesystem::path& file, std::mt19937_64& random) {
  const std::uintmax_t size = std::filesystem::file_size(file);
  std::fstream bytes(file, std::ios::binary | std::ios::in | std::ios::out);
  constexpr int kFlips = 3;
  for (int i = 0; i < kFlips && size > 0; ++i) {
    const auto at = static_cast<std::streamoff>(random() % size);
    bytes.seekg(at);
    const auto flipped = static_cast<char>(bytes.get() ^ (1 << random() % 8));
    bytes.seekp(at);
    bytes.put(flipped);
  }
}

/// Damages a file of a folder, and returns which. A swap exchanges it with any other.
inline std::string damage_a_file(const std::filesystem::path& folder,
                                 Damage damage,
                                 std::mt19937_64& random) {
  namespace fs = std::filesystem;
  const std::vector<fs::path> files = files_of(folder);
  if (files.empty()) return "no file";
  const auto drawn = [&] { return files[random() % files.size()]; };
  const fs::path file = drawn();
  const fs::path other = drawn();
  if (damage == Damage::FlippedBytes) flip_bytes(file, random);
  if (damage == Damage::CutOff) fs::resize_file(file, random() % (fs::file_size(file) + 1));
  if (damage == Damage::Swapped) {
    fs::rename(file, folder / "aside");
    if (file != other) fs::rename(other, file);
    fs::rename(folder / "aside", other);
  }
  if (damage >= Damage::Deleted) fs::remove(file);
  if (damage == Damage::Folder) fs::create_directories(file / "full");
  if (damage == Damage::Pipe && mkfifo(file.c_str(), 0600) != 0) return "no pipe";
  if (damage == Damage::Link) {
    const std::array<fs::path, 4> targets = {"nowhere", file, other, "/dev/zero"};
    fs::create_symlink(targets[random() % targets.size()], file);
  }
  return file.filename().string() + ": " + name_of(damage) +
         (damage == Damage::Swapped ? " with " + other.filename().string() : "");
}

}  // namespace af::test
