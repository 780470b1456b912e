// SPDX-License-Identifier: Apache-2.0
#include "precompute/codebook/codebook_training.h"

#include <algorithm>
#include <numeric>
#include <set>

#include "base/error.h"
#include "precompute/codebook/nearest_codeword.h"
#include "precompute/codebook/tile_drawing.h"

namespace af {

namespace {

/// One rank's share of an iteration; adding shares is exact. It is one array, so that one reduction
/// is enough.
class CentroidSums {
 public:
  explicit CentroidSums(std::size_t codewords)
      : codewords_(codewords), values_(codewords * (kTileElements + 1) + 2, 0) {}

  void add(std::uint32_t codeword, const Tile& tile) {
    std::uint64_t* sums = &values_[codeword * (kTileElements + 1)];
    for (std::size_t i = 0; i < kTileElements; ++i) sums[i] += tile[i];
    ++sums[kTileElements];
  }
  [[nodiscard]] std::uint64_t count(std::size_t codeword) const {
    return values_[codeword * (kTileElements + 1) + kTileElements];
  }
  [[nodiscard]] Tile centroid(std::size_t codeword) const {
    const std::uint64_t* sums = &values_[codeword * (kTileElements + 1)];
    const std::uint64_t tiles = count(codeword);
    Tile rounded{};
    for (std::size_t i = 0; i < kTileElements; ++i)
      rounded[i] = static_cast<std::uint16_t>((sums[i] + tiles / 2) / tiles);
    return rounded;
  }
  std::uint64_t& training_error() { return values_[codewords_ * (kTileElements + 1)]; }
  std::uint64_t& held_out_error() { return values_[codewords_ * (kTileElements + 1) + 1]; }
  std::span<std::uint64_t> values() { return values_; }

 private:
  std::size_t codewords_;
  std::vector<std::uint64_t> values_;
};

/// Tiles of one kind, with the codeword that codes each.
struct CodedTiles {
  const std::vector<NumberedTile>& tiles;
  std::vector<std::uint32_t> nearest;
  std::vector<std::uint64_t> squared_errors;

  explicit CodedTiles(const std::vector<NumberedTile>& numbered)
      : tiles(numbered), nearest(numbered.size(), 0), squared_errors(numbered.size(), 0) {}

  /// Encodes piece by piece: the search takes tiles only, and a copy of all tiles would cost
  /// memory.
  void encode(const NearestCodeword& search, SearchHint hint) {
    constexpr std::size_t kPiece = 4096;
    std::vector<Tile> piece;
    for (std::size_t first = 0; first < tiles.size(); first += kPiece) {
      const std::size_t count = std::min(kPiece, tiles.size() - first);
      piece.clear();
      for (std::size_t i = 0; i < count; ++i) piece.push_back(tiles[first + i].tile);
      search.search(piece,
                    hint,
                    std::span(nearest).subspan(first, count),
                    std::span(squared_errors).subspan(first, count));
    }
  }
  [[nodiscard]] std::uint64_t squared_error() const {
    return std::accumulate(squared_errors.begin(), squared_errors.end(), std::uint64_t{0});
  }
  void renumber(const std::vector<std::uint32_t>& new_of_old) {
    for (std::uint32_t& index : nearest) index = new_of_old[index];
  }
};

/// The zero tile and the first distinct, non-zero tiles in the order of their sampling keys.
std::vector<Tile> initial_codewords(const TrainingShare& mine,
                                    std::uint64_t training_tiles,
                                    const CodebookOptions& options,
                                    const CodebookReduction& reduction) {
  const auto wanted = static_cast<std::uint64_t>(options.codewords) - 1;
  std::vector<std::uint64_t> keys;
  keys.reserve(mine.training.size());
  for (const NumberedTile& tile : mine.training)
    keys.push_back(weighted_sampling_key(options.seed, tile));
  for (std::uint64_t count = wanted + wanted / 8 + 1;; count *= 2) {
    const auto drawn =
        smallest_keyed_tiles(keys, mine.training, std::min(count, training_tiles), reduction);
    std::set<Tile> distinct;
    for (const KeyedTile& tile : drawn) {
      distinct.insert(tile.numbered.tile);
      if (distinct.size() == wanted) break;
    }
    if (distinct.size() == wanted) {
      std::vector<Tile> codewords{Tile{}};
      codewords.insert(codewords.end(), distinct.begin(), distinct.end());
      std::sort(codewords.begin(), codewords.end(), codeword_less);
      return codewords;
    }
    if (count >= training_tiles)
      throw InputError("codewords",
                       std::to_string(options.codewords),
                       "more codewords than training tiles: there are only " +
                           std::to_string(distinct.size()) +
                           " distinct training tiles that are not empty; ask for fewer codewords "
                           "or raise --training-fraction");
  }
}

/// A codeword and the index it had before the sort.
struct TrackedCodeword {
  Tile tile{};
  std::uint32_t old_index = 0;
};

bool tracked_less(const TrackedCodeword& a, const TrackedCodeword& b) {
  if (codeword_less(a.tile, b.tile)) return true;
  if (codeword_less(b.tile, a.tile)) return false;
  return a.old_index < b.old_index;
}

/// The centroids of an iteration as its new codewords, in order.
class CodebookUpdate {
 public:
  CodebookUpdate(const std::vector<Tile>& old, const CentroidSums& sums) {
    codewords_.push_back({Tile{}, 0});
    for (std::uint32_t i = 1; i < old.size(); ++i) {
      if (sums.count(i) > 0)
        codewords_.push_back({sums.centroid(i), i});
      else
        free_.push_back({old[i], i});
    }
    std::sort(codewords_.begin(), codewords_.end(), tracked_less);
    const auto is_same = [](const TrackedCodeword& a, const TrackedCodeword& b) {
      return a.tile == b.tile;
    };
    std::vector<TrackedCodeword> distinct;
    for (const TrackedCodeword& codeword : codewords_) {
      if (distinct.empty() || !is_same(distinct.back(), codeword))
        distinct.push_back(codeword);
      else
        free_.push_back(codeword);
    }
    codewords_ = std::move(distinct);
  }

  /// Collective. Replaces codewords that are unused or equal to a lower one by the worst-coded
  /// training tiles. Returns how many.
  std::uint64_t repair(const CodedTiles& coded, const CodebookReduction& reduction) {
    if (free_.empty()) return 0;
    std::vector<std::uint64_t> keys;
    keys.reserve(coded.squared_errors.size());
    for (const std::uint64_t error : coded.squared_errors) keys.push_back(~error);
    static_assert(kNeverPicked == ~std::uint64_t{0}, "a tile without error repairs nothing");
    // Some are spare, because a tile may equal another one or a centroid.
    const auto worst = smallest_keyed_tiles(keys, coded.tiles, 2 * free_.size() + 16, reduction);
    std::set<Tile> taken;
    for (const TrackedCodeword& codeword : codewords_) taken.insert(codeword.tile);
    std::sort(free_.begin(), free_.end(), [](const TrackedCodeword& a, const TrackedCodeword& b) {
      return a.old_index < b.old_index;
    });
    std::uint64_t repaired = 0;
    auto candidate = worst.begin();
    for (TrackedCodeword& codeword : free_) {
      while (candidate != worst.end() && !taken.insert(candidate->numbered.tile).second)
        ++candidate;
      if (candidate != worst.end()) {
        codeword.tile = candidate->numbered.tile;
        ++repaired;
      }
      codewords_.push_back(codeword);
    }
    std::sort(codewords_.begin(), codewords_.end(), tracked_less);
    return repaired;
  }

  [[nodiscard]] std::vector<Tile> codewords() const {
    std::vector<Tile> sorted;
    sorted.reserve(codewords_.size());
    for (const TrackedCodeword& codeword : codewords_) sorted.push_back(codeword.tile);
    return sorted;
  }
  [[nodiscard]] std::vector<std::uint32_t> new_of_old() const {
    std::vector<std::uint32_t> positions(codewords_.size());
    for (std::uint32_t i = 0; i < codewords_.size(); ++i) positions[codewords_[i].old_index] = i;
    return positions;
  }

 private:
  std::vector<TrackedCodeword> codewords_;  ///< distinct and in use
  std::vector<TrackedCodeword> free_;
};

/// Iterations on one rank's share of the tiles.
class CodebookIterations {
 public:
  CodebookIterations(const TrainingShare& mine, const CodebookReduction& reduction)
      : training_(mine.training), held_out_(mine.held_out), reduction_(reduction) {}

  /// Collective. Replaces the codebook by a better one.
  TrainingIteration improve(Codebook& codebook) {
    const NearestCodeword search(codebook);
    training_.encode(search, hint_);
    held_out_.encode(search, hint_);
    hint_ = SearchHint::PerTile;
    CentroidSums sums(codebook.size());
    for (std::size_t tile = 0; tile < training_.tiles.size(); ++tile)
      sums.add(training_.nearest[tile], training_.tiles[tile].tile);
    sums.training_error() = training_.squared_error();
    sums.held_out_error() = held_out_.squared_error();
    reduction_.sum(sums.values());

    CodebookUpdate update(searched_codewords(codebook), sums);
    const std::uint64_t repaired = update.repair(training_, reduction_);
    codebook = codebook_of_searched(update.codewords(), codebook.mean_step);
    const auto new_of_old = update.new_of_old();
    training_.renumber(new_of_old);
    held_out_.renumber(new_of_old);
    return {sums.training_error(), sums.held_out_error(), repaired};
  }

 private:
  CodedTiles training_;
  CodedTiles held_out_;
  SearchHint hint_ = SearchHint::None;
  const CodebookReduction& reduction_;
};

/// Why to stop: another iteration would not pay, or is not allowed. None: continue.
std::optional<TrainingStop> reason_to_stop(const TrainedCodebook& training,
                                           const CodebookOptions& options) {
  const std::size_t done = training.iterations.size();
  if (done >= 2) {
    const auto before = static_cast<double>(training.iterations[done - 2].training_squared_error);
    const auto now = static_cast<double>(training.iterations[done - 1].training_squared_error);
    if (!(before - now > options.min_relative_improvement * before))
      return TrainingStop::ImprovementBelowLimit;
  }
  if (done >= static_cast<std::size_t>(options.max_iterations)) return TrainingStop::MaxIterations;
  return std::nullopt;
}

}  // namespace

std::vector<std::string> problems(const CodebookOptions& options) {
  std::vector<std::string> found;
  if (options.codewords < 2 || options.codewords > static_cast<int>(kMaxCodewords))
    found.push_back("codewords = " + std::to_string(options.codewords) +
                    ": must be between 2 and 65536");
  if (options.max_iterations < 1)
    found.push_back("max_iterations = " + std::to_string(options.max_iterations) +
                    ": must be at least 1");
  if (!(options.min_relative_improvement >= 0.0 && options.min_relative_improvement < 1.0))
    found.push_back("min_relative_improvement = " +
                    std::to_string(options.min_relative_improvement) + ": must be between 0 and 1");
  return found;
}

const char* to_string(TrainingStop stop) {
  return stop == TrainingStop::ImprovementBelowLimit ? "improvement below the limit"
                                                     : "maximum number of iterations";
}

TrainedCodebook train_codebook(const TrainingShare& mine,
                               const CodebookOptions& options,
                               const CodebookReduction& reduction,
                               const ProgressCallback& on_progress,
                               const TrainingCheckpoints& checkpoints) {
  throw_if_any(problems(options));
  std::array<std::uint64_t, 2> totals{mine.training.size(), mine.held_out.size()};
  reduction.sum(totals);
  TrainedCodebook result;
  if (checkpoints.begun) {
    result = *checkpoints.begun;
    check(result.codebook.mean_step == options.mean_step, "a training goes on with its options");
  } else {
    result.codebook = codebook_of_searched(initial_codewords(mine, totals[0], options, reduction),
                                           options.mean_step);
  }
  result.training_tiles = totals[0];
  result.held_out_tiles = totals[1];
  CodebookIterations iterations(mine, reduction);
  std::optional<TrainingStop> stop;
  while (!(stop = reason_to_stop(result, options))) {
    result.iterations.push_back(iterations.improve(result.codebook));
    if (on_progress)
      on_progress(static_cast<double>(result.iterations.size()), options.max_iterations);
    if (checkpoints.on_iteration) checkpoints.on_iteration(result);
  }
  result.stop = *stop;
  return result;
}

}  // namespace af
