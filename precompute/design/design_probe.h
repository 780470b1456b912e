// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "precompute/codebook/codebook_reduction.h"
#include "precompute/design/design_model.h"
#include "precompute/design/probe_rays.h"
#include "precompute/design/quantisation_probe.h"

namespace af {

/// Mean squared differences from ray casting at one pose over the foreground, divided by the
/// squared maximum of the DRR. [0] is linear, [1] cubic look-up.
struct PoseLoss {
  std::array<double, 2> interpolation{};
  std::array<double, 2> quantisation{};  ///< with the largest small codebook
  /// Loss of both together beyond the sum of the two, which arises because both blur.
  std::array<double, 2> common{};
};

/// What a probe measured for one design, for any look-up and size of the codebook.
struct DesignMeasurement {
  FieldDesign design;
  std::vector<PoseLoss> poses;
  double occupied_tiles = 0.0;
  std::array<double, kProbeCodewords.size()> tile_errors{};  ///< for unseen tiles, small codebooks
  double drr_pixels = 0.0;
  double footprint_nodes = 0.0;          ///< per slab
  std::map<int, double> bytes_per_tile;  ///< by codewords
  std::map<int, double> training_tiles;  ///< likewise
  /// Largest number of codewords for which the tiles suffice.
  int most_codewords = 0;

  /// Forecast for a number of codewords that was measured.
  [[nodiscard]] DesignForecast forecast(int codewords, const std::string& look_up) const;
  [[nodiscard]] DesignPoint point(int codewords, const std::string& look_up) const;
};

struct ProbeOptions {
  int viewpoints = 3;  ///< per slab, whose whole planes are cast
  /// The tiles on which a field's codebook of this size is trained.
  std::function<TrainingSelection(int codewords)> selection_for = [](int /*codewords*/) {
    return TrainingSelection{};
  };
  std::uint64_t seed = 1;
};

/// Measures designs of a field without making them. Collective over the ranks of `reduction`, which
/// share the work. The results are the same on any number of ranks.
class DesignProbe {
 public:
  /// `rays`: this rank's share, from draw_probe_rays().
  DesignProbe(const ProbeScene& scene,
              const ProbeOptions& options,
              ProbeRays rays,
              const CodebookReduction& reduction,
              std::size_t ranks);

  /// Measures interpolation, quantisation and size. `codewords`: sizes of codebooks that matter.
  [[nodiscard]] DesignMeasurement measure(const FieldDesign& design,
                                          std::span<const int> codewords) const;

 private:
  [[nodiscard]] std::vector<NumberedTile> shuffled_tiles(const FieldSample& sample,
                                                         const FieldLattice& lattice,
                                                         std::size_t wanted) const;
  [[nodiscard]] std::vector<Codebook> small_codebooks(std::span<const NumberedTile> tiles,
                                                      int mean_step) const;
  [[nodiscard]] std::vector<PoseLoss> losses(const FieldCaster& caster,
                                             const LightSlab& planes,
                                             const Codebook& codebook) const;

  const ProbeScene& scene_;
  ProbeOptions options_;
  const CodebookReduction& reduction_;
  ProbeShare share_;
  ProbeRays rays_;
};

}  // namespace af
