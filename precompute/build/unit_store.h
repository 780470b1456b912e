// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "precompute/casting/unit_tiles.h"
#include "precompute/codebook/unit_encoding.h"
#include "ranks/communicator.h"
#include "ranks/progress_store.h"

namespace af {

/// The finished units of an unfinished field: first as tiles, then, once there is a codebook, as
/// indices. What is damaged is done again. \test FieldBuildTest.DamagedAndTornShardsAreCastAgain
class UnitStore {
 public:
  /// Collective. `work.unit_size`: rays per unit. Throws InputError, naming the difference, when an
  /// earlier run did other work.
  UnitStore(const UnfinishedWork& work, const Communicator& communicator);

  /// The value of the run that began the work.
  [[nodiscard]] std::int64_t rays_per_unit() const { return store_.unit_size(); }
  /// Whether unfinished work was discarded because its options, which differ from these, were
  /// refused.
  [[nodiscard]] bool has_replaced_refused() const { return store_.has_replaced(); }

  using Visit = std::function<void(UnitTiles)>;
  /// Collective. Calls `visit` with the verified units of earlier runs, one at a time. Each is
  /// visited on one rank, dealt out evenly.
  void visit_finished(std::span<const WorkUnit> units, const Visit& visit);

  /// Appends a finished unit to this rank's shard. Throws FileError when it cannot be written.
  void append(const UnitTiles& tiles);

  /// Appends the indices of a unit, encoded with the codebook of this CRC-32C. Throws FileError as
  /// above.
  void append(const WorkUnit& unit, const EncodedUnit& encoded, std::uint32_t codebook_crc);

  /// The indices of a unit that an earlier run encoded with the codebook of this CRC-32C. Nothing
  /// when there are none, or damaged ones. `values_per_tile`: 2 with means.
  [[nodiscard]] std::optional<EncodedUnit> read_encoded(const WorkUnit& unit,
                                                        std::size_t values_per_tile,
                                                        std::uint32_t codebook_crc) const;

  /// Collective. Tells every rank where each unit lies, so that any can read it.
  void share_places();

  /// Reads a unit that this rank appended or visited, or any unit after share_places(). Nothing
  /// when it is missing or damaged.
  [[nodiscard]] std::optional<UnitTiles> read(const WorkUnit& unit) const;

  /// See ProgressShard and ProgressStore.
  void forget_cached() const { store_.shard().forget_cached(); }
  void sync() { store_.shard().sync(); }
  void close() { store_.shard().close(); }
  void give_way() const { store_.give_way(); }

  [[nodiscard]] const std::filesystem::path& path() const { return store_.folder(); }

 private:
  Communicator communicator_;
  ProgressStore store_;
  std::map<std::uint32_t, RecordPlace> tiles_;
  std::map<std::uint32_t, RecordPlace> indices_;  ///< from earlier runs
};

}  // namespace af
