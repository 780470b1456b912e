// SPDX-License-Identifier: Apache-2.0
// What a build has measured, for people and for the field's provenance.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "field/field_file.h"
#include "precompute/build_phases.h"
#include "precompute/design_choice.h"
#include "precompute/phase_clock.h"
#include "ranks/provenance.h"

namespace af {

struct BuildRecord {
  const CastPhase& cast;
  const TrainedField& trained;
  const std::optional<DesignChoice>& design;
  const PhaseClock& clock;
  float step = 0.0F;                       ///< total attenuation of one level
  std::uint64_t squared_error = 0;         ///< over all tiles, in squared levels
  std::vector<double> encode_seconds;      ///< one value per rank
  std::uint64_t units_encoded_before = 0;  ///< by earlier runs
  std::uint64_t peak_bytes_per_rank = 0;   ///< besides the CT and its grid
  std::uint64_t volume_bytes = 0;          ///< of the CT and its grid, once per node

  /// Root mean square error of one element, total attenuation.
  [[nodiscard]] double rms_error() const;
};

/// Adds the record to a field's provenance.
void add_record(const BuildRecord& record, nlohmann::json& provenance);

/// Some lines for a person, once the file is complete. `stored_nodes`: over all slabs.
std::string record_text(const BuildRecord& record,
                        const FieldFileInfo& info,
                        std::int64_t stored_nodes);

}  // namespace af
