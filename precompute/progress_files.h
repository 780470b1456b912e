// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/progress_manifest.h"
#include "parallel/communicator.h"
#include "precompute/unit_tiles.h"

namespace af {

/// What unfinished work is valid for: everything that decides the cast samples, and the plan it was
/// cut by.
struct ProgressManifest {
  DecidingValues decides;
  std::int64_t rays_per_unit = 0;
};

/// Where a unit lies: "RUN-RANK.shard" and the offset of its record.
struct UnitPlace {
  std::uint64_t run = 0;
  std::uint64_t rank = 0;
  std::uint64_t offset = 0;
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

  using Visit = std::function<void(UnitTiles)>;
  /// Collective. Calls `visit` with the verified units of earlier runs, one at a time, each on one
  /// rank, dealt out evenly.
  void visit_finished(std::span<const WorkUnit> units, const Visit& visit);

  /// Appends a finished unit to this rank's shard. FileError when it cannot be written.
  void append(const UnitTiles& tiles);

  /// Collective. Tells every rank where each unit lies, so that any can read it.
  void share_places();

  /// A unit that this rank has appended or visited, or any after share_places(); nothing when it is
  /// not there or is damaged.
  [[nodiscard]] std::optional<UnitTiles> read(const WorkUnit& unit) const;

  /// Asks the system to drop this rank's shard from its file cache, so that reading shows what it
  /// costs.
  void forget_cached() const;

  /// Makes sure that what was appended survives (fsync).
  void sync();

  /// Collective. Removes the folder: the field is complete.
  void remove();

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  [[nodiscard]] std::filesystem::path path_of(const UnitPlace& place) const;

  std::filesystem::path path_;
  Communicator communicator_;
  UnitPlace shard_;  ///< this rank's, and where its next unit will lie
  std::ofstream file_;
  std::map<std::uint32_t, UnitPlace> places_;
};

}  // namespace af
