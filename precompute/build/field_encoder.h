// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "field/field_writing.h"
#include "precompute/build/field_build.h"
#include "precompute/codebook/nearest_codeword.h"
#include "precompute/codebook/unit_encoding.h"

namespace af {

/// Encodes units in rounds, for write_field(). Every rank encodes the units whose tiles it has
/// kept. The others are dealt out so that all ranks encode about the same number of tiles.
class FieldEncoder {
 public:
  /// Collective. `cast` is emptied while encoding; it and `codebook` must outlive the encoder.
  FieldEncoder(const FieldBuild& build,
               CastPhase& cast,
               const Codebook& codebook,
               TileOverflow overflow);
  FieldEncoder(const FieldBuild& build,
               CastPhase& cast,
               Codebook&& codebook,
               TileOverflow overflow) = delete;

  /// This rank's next units, about kRoundBytes of indices. None when it has no more. Units that an
  /// earlier run encoded with the same codebook are read. Throws StoppedError, with what is encoded
  /// saved, when `stop_requested` says so.
  std::vector<IndexBlock> next_blocks(const ProgressCallback& on_progress = {},
                                      const StopRequested& stop_requested = {});

  /// Collective. Sum over all ranks, in squared levels. Valid once all blocks are made.
  [[nodiscard]] std::uint64_t squared_error() const;
  /// Collective. Seconds that every rank spent in next_blocks().
  [[nodiscard]] std::vector<double> busy_seconds() const;
  /// How many of this rank's units were damaged when read back, and were cast again.
  [[nodiscard]] std::uint64_t units_damaged() const { return units_damaged_; }
  /// Collective. How many units an earlier run had encoded, over all ranks.
  [[nodiscard]] std::uint64_t units_resumed() const;

  static constexpr std::size_t kRoundBytes = std::size_t{8} << 20;

 private:
  void deal_out_others();
  [[nodiscard]] UnitTiles tiles_again(const WorkUnit& unit);
  IndexBlock next_block();
  /// Encodes the tiles in memory, or makes the tiles again where `kept` is null.
  EncodedUnit encoded(const WorkUnit& unit, const UnitTiles* kept);
  /// Whether the indices fit our codebook. A checksum only proves that a record is whole.
  [[nodiscard]] bool is_ours(const EncodedUnit& before, const WorkUnit& unit) const;

  const FieldBuild& build_;
  CastPhase& cast_;
  const Codebook& codebook_;
  NearestCodeword search_;
  std::uint32_t codebook_crc_;
  TileOverflow overflow_;
  std::vector<std::uint32_t> others_;  ///< this rank's units that are not in memory
  double tiles_in_all_ = 0.0;
  double tiles_done_ = 0.0;
  double busy_seconds_ = 0.0;
  std::uint64_t squared_error_ = 0;
  std::uint64_t units_damaged_ = 0;
  std::uint64_t units_resumed_ = 0;
  std::vector<std::uint16_t> samples_;
};

}  // namespace af
