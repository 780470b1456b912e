// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "field/codebook.h"
#include "precompute/codebook/tile_selection.h"

namespace af {

struct CodebookOptions {
  int codewords = 16384;  ///< including the zero tile
  int max_iterations = 12;
  double min_relative_improvement = 0.005;  ///< in the training tiles' squared error
  std::uint64_t seed = 1;
  int mean_step = 0;  ///< for a field whose tiles have means (mean_removal.h); 0: plain tiles
};

std::vector<std::string> problems(const CodebookOptions& options);

/// What one iteration measured with the codebook it began with, over all ranks, in squared levels.
struct TrainingIteration {
  std::uint64_t training_squared_error = 0;
  std::uint64_t held_out_squared_error = 0;
  std::uint64_t codewords_repaired =
      0;  ///< unused or equal ones, replaced by the worst-coded tiles

  auto members() {
    return std::tie(training_squared_error, held_out_squared_error, codewords_repaired);
  }
};

enum class TrainingStop { ImprovementBelowLimit, MaxIterations };

const char* to_string(TrainingStop stop);

struct TrainedCodebook {
  Codebook codebook;  ///< of the requested size, sorted, codeword 0 is the zero tile
  std::uint64_t training_tiles = 0;
  std::uint64_t held_out_tiles = 0;
  std::vector<TrainingIteration> iterations;
  TrainingStop stop = TrainingStop::MaxIterations;

  auto members() {
    return std::tie(
        training_tiles, held_out_tiles, iterations, codebook.codewords, codebook.mean_step);
  }
};

/// Where an interrupted training continues.
struct TrainingCheckpoints {
  /// The last state that an earlier run, on any number of ranks, gave to on_iteration(). None: from
  /// the start. The same tiles and options give the same codebook as a training without a stop.
  std::optional<TrainedCodebook> begun;
  /// Called on every rank after every iteration. When it throws, it must throw on all ranks.
  std::function<void(const TrainedCodebook& so_far)> on_iteration;
};

/// Collective. Trains a codebook by the generalised Lloyd algorithm (Sec. II-D) on the shares of
/// all ranks: plain tiles, or folded shapes (remove_means()) where the options have a step. Sums,
/// counts and errors are exact integers, and centroids are rounded to levels, so the codebook is
/// the same on any number of ranks and for any vector width.
/// Codeword 0 is and stays the zero tile. Initial codewords are distinct tiles drawn by
/// weighted_sampling_key(). Codewords that end up unused or equal to another are replaced by the
/// worst-coded training tiles. Equal codewords remain only when no such tiles are left (the higher
/// ones are then never used), so the size is always the requested one. Throws InputError when there
/// are fewer distinct training tiles than codewords to draw. \test
/// CodebookTraining.IsBitIdenticalOnAnyRankCount
TrainedCodebook train_codebook(const TrainingShare& mine,
                               const CodebookOptions& options,
                               const CodebookReduction& reduction,
                               const ProgressCallback& on_progress = {},
                               const TrainingCheckpoints& checkpoints = {});

}  // namespace af
