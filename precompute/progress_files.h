// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "parallel/communicator.h"
#include "precompute/unit_tiles.h"

namespace af {

/// What unfinished work is valid for: everything that decides the cast samples, and the plan it was
/// cut by.
struct ProgressManifest {
  std::map<std::string, std::string> decides;  ///< option or input -> value
  std::int64_t rays_per_unit = 0;
};

/// Unfinished work of one field, "NAME.progress/": manifest.json and one shard per rank and run,
/// to which finished units are appended, each with its size and CRC-32C. Whatever a killed run left
/// incomplete fails its CRC and is cast again.
class ProgressFolder {
 public:
  /// Collective. Opens or creates the folder. With work of an earlier run in it, `manifest` takes
  /// over that run's plan; InputError that names the difference when the run was about something
  /// else. `restart` throws earlier work away.
  ProgressFolder(const std::filesystem::path& path,
                 bool restart,
                 ProgressManifest& manifest,
                 const Communicator& communicator);

  /// Collective. The verified units of earlier runs, each on one rank, dealt out evenly.
  [[nodiscard]] std::vector<UnitTiles> read_finished(std::span<const WorkUnit> units) const;

  /// Appends a finished unit to this rank's shard. FileError when it cannot be written.
  void append(const UnitTiles& tiles);

  /// Makes sure that what was appended survives (fsync).
  void sync();

  /// Collective. Removes the folder: the field is complete.
  void remove();

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  Communicator communicator_;
  std::filesystem::path shard_path_;
  std::ofstream shard_;
};

/// CRC-32C (Castagnoli) of bytes, as in iSCSI (RFC 3720): "123456789" gives 0xE3069283.
std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t previous = 0);

}  // namespace af
