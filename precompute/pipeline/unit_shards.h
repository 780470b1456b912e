// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "parallel/communicator.h"
#include "precompute/codebook/field_encoder.h"
#include "precompute/units/unit_tiles.h"
#include "run/progress_manifest.h"

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

  bool operator==(const UnitPlace&) const = default;
};

/// The indices of a unit in a shard, and the codebook that they are of.
struct EncodedPlace {
  UnitPlace place;
  std::uint32_t codebook_crc = 0;
};

/// Unfinished work of one field, "NAME.progress/": manifest.json and one shard per rank and run,
/// to which finished units are appended, each with its size and CRC-32C: first as tiles, then, when
/// there is a codebook, as indices. Whatever a killed run left incomplete fails its CRC and is done
/// again.
class ProgressFolder {
 public:
  /// Collective. Opens or creates the folder. With work of an earlier run in it, `manifest` takes
  /// over that run's plan; InputError that names the difference when the run was about something
  /// else. `restart` throws earlier work away.
  ProgressFolder(const std::filesystem::path& path,
                 bool restart,
                 ProgressManifest& manifest,
                 const Communicator& communicator);

  /// Rank 0: whether unfinished work was thrown away because its options had been refused, and
  /// these are others.
  [[nodiscard]] bool has_replaced_refused() const { return has_replaced_refused_; }

  using Visit = std::function<void(UnitTiles)>;
  /// Collective. Calls `visit` with the verified units of earlier runs, one at a time, each on one
  /// rank, dealt out evenly.
  void visit_finished(std::span<const WorkUnit> units, const Visit& visit);

  /// Appends a finished unit to this rank's shard. FileError when it cannot be written.
  void append(const UnitTiles& tiles);

  /// Appends the indices of a unit, by the codebook of this CRC-32C. FileError as above.
  void append(const WorkUnit& unit, const EncodedUnit& encoded, std::uint32_t codebook_crc);

  /// The indices of a unit that an earlier run encoded with the codebook of this CRC-32C; nothing
  /// when there are none, or damaged ones.
  [[nodiscard]] std::optional<EncodedUnit> read_encoded(const WorkUnit& unit,
                                                        std::uint32_t codebook_crc) const;

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

  /// The options of this work have been refused: the next run may replace it by work of other
  /// options, and goes on with it when only those differ that do not decide what is kept.
  void give_way() const;

  /// Collective. Removes the folder: the field is complete.
  void remove();

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  [[nodiscard]] std::filesystem::path path_of(const UnitPlace& place) const;
  void append(std::initializer_list<std::span<const std::byte>> parts);

  bool has_replaced_refused_ = false;
  std::filesystem::path path_;
  Communicator communicator_;
  UnitPlace shard_;  ///< this rank's, and where its next unit will lie
  std::ofstream file_;
  std::chrono::steady_clock::time_point last_sync_ = std::chrono::steady_clock::now();
  std::map<std::uint32_t, UnitPlace> places_;
  std::map<std::uint32_t, EncodedPlace> encoded_places_;  ///< of earlier runs
};

}  // namespace af
