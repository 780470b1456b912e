// SPDX-License-Identifier: Apache-2.0
// Tiles per second of one core: the exact nearest-codeword search, plain brute force and Faiss, on
// tiles and codebooks of a real field.
#include <algorithm>
#include <numeric>
#include <random>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/vector_width.h"
#include "benchmark/alternating_rounds.h"
#include "benchmark/benchmark_case.h"
#include "benchmark/brute_force_kernel.h"
#include "benchmark/faiss_search.h"
#include "cli/app_main.h"
#include "precompute/casting/shear_warp_caster.h"
#include "precompute/codebook/codebook_training.h"
#include "precompute/codebook/nearest_codeword.h"

namespace af::benchmark {

namespace {

constexpr const char* kFast = "NearestCodeword";
constexpr const char* kBruteForce = "brute force";
constexpr const char* kFaiss = "faiss::IndexFlatL2";

/// Tiles of units spread evenly over the field, in the order in which they are encoded, none empty.
std::vector<Tile> field_tiles(const BenchmarkCase& benchmark_case, std::size_t units_taken) {
  const SlabAlignedVolume resampled(*benchmark_case.volume(),
                                    benchmark_case.light_slab().slab_from_ct);
  const ShearWarpFieldCaster caster(
      resampled, benchmark_case.light_slab(), benchmark_case.quantizer());
  std::vector<Tile> tiles;
  std::vector<std::uint16_t> samples;
  for (const WorkUnit& unit : evenly_spread(benchmark_case.units(), units_taken)) {
    samples.resize(unit.sample_count());
    caster.cast(unit, samples);
    const UnitTiles of_unit = make_unit_tiles(unit, samples);
    tiles.insert(tiles.end(), of_unit.tiles.begin(), of_unit.tiles.end());
  }
  return tiles;
}

Codebook train_on(const std::vector<Tile>& tiles, int codewords) {
  TrainingShare share;
  for (std::size_t i = 0; i < tiles.size(); i += 2)
    share.training.push_back({static_cast<std::int64_t>(i), tiles[i]});
  CodebookOptions options;
  options.codewords = codewords;
  options.max_iterations = 4;
  return train_codebook(share, options, serial_reduction()).codebook;
}

/// Some stretches of neighbouring tiles, for contenders that take long.
std::vector<Tile> stretches_of(const std::vector<Tile>& tiles, std::size_t count) {
  constexpr std::size_t kStretches = 8;
  std::vector<Tile> taken;
  const std::size_t length = std::min(count, tiles.size()) / kStretches;
  for (std::size_t i = 0; i < kStretches; ++i) {
    const auto first = tiles.begin() + static_cast<std::ptrdiff_t>(i * (tiles.size() / kStretches));
    taken.insert(taken.end(), first, first + static_cast<std::ptrdiff_t>(length));
  }
  return taken;
}

/// The codebook as the brute-force kernel wants it.
class BruteForce {
 public:
  explicit BruteForce(const Codebook& codebook) : codewords_(codebook.codewords) {
    constexpr std::size_t kLanes = 16;
    constexpr float kFarAway = 1e18f;
    const std::size_t blocks = (codewords_.size() + kLanes - 1) / kLanes;
    elements_.assign(blocks * kTileElements * kLanes, kFarAway);
    order_.resize(codewords_.size());
    std::iota(order_.begin(), order_.end(), 0u);
    std::shuffle(order_.begin(), order_.end(), std::mt19937(1));
    for (std::size_t i = 0; i < codewords_.size(); ++i)
      for (std::size_t element = 0; element < kTileElements; ++element)
        elements_[(i / kLanes * kTileElements + element) * kLanes + i % kLanes] =
            codewords_[order_[i]][element];
  }

  void search(const std::vector<Tile>& tiles, std::vector<std::uint32_t>& nearest) const {
    const BruteForceCodebook codebook{
        elements_.data(),
        codewords_.front().data(),
        order_.data(),
        static_cast<std::uint32_t>((codewords_.size() + kTileElements - 1) / kTileElements)};
    select_kernel<BruteForceFunction>(kernels_128::brute_force_nearest,
                                      kernels_256::brute_force_nearest,
                                      kernels_512::brute_force_nearest)(
        codebook, tiles.front().data(), tiles.size(), nearest.data());
  }

 private:
  std::vector<Tile> codewords_;
  std::vector<std::uint32_t> order_;
  std::vector<float> elements_;
};

std::size_t differing(const std::vector<std::uint32_t>& a, const std::vector<std::uint32_t>& b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (a[i] != b[i]) ++count;
  return count;
}

nlohmann::json measure(const std::vector<Tile>& tiles, int codewords, const CaseOptions& options) {
  const Codebook codebook = train_on(tiles, codewords);
  const NearestCodeword search(codebook);
  const BruteForce brute_force(codebook);
  const auto faiss = FaissSearch::make(codebook);
  const std::vector<Tile> some = stretches_of(tiles, options.is_quick ? 512 : 16384);

  std::vector<std::uint32_t> nearest(tiles.size());
  std::vector<std::uint64_t> errors(tiles.size());
  std::vector<std::uint32_t> by_brute_force(some.size());
  std::vector<std::uint32_t> by_faiss(some.size());
  const auto work = static_cast<double>(some.size());
  std::vector<Contender> contenders = {
      {kFast,
       static_cast<double>(tiles.size()),
       "tiles",
       [&] {
         return seconds_of([&] { search.search(tiles, SearchHint::None, nearest, errors); });
       }},
      {kBruteForce, work, "tiles", [&] {
         return seconds_of([&] { brute_force.search(some, by_brute_force); });
       }}};
  if (faiss)
    contenders.push_back({kFaiss, work, "tiles", [&] {
                            return seconds_of([&] { faiss->search(some, by_faiss); });
                          }});
  const std::vector<Timing> timings = alternate(contenders, options.rounds);

  std::vector<std::uint32_t> same_tiles(some.size());
  std::vector<std::uint64_t> same_errors(some.size());
  search.search(some, SearchHint::None, same_tiles, same_errors);
  if (differing(same_tiles, by_brute_force) != 0)
    throw NumericError("NearestCodeword and brute force give different answers");
  nlohmann::json json{{"codewords", codewords},
                      {"results", to_json(timings)},
                      {"answers_compared", some.size()},
                      {"answers_other_than_brute_force", differing(same_tiles, by_brute_force)},
                      {"ratios", nlohmann::json::array({speed_ratio(timings[0], timings[1])})}};
  if (faiss) {
    json["ratios"].push_back(speed_ratio(timings[0], timings[2]));
    json["faiss_answers_other_than_brute_force"] = differing(by_faiss, by_brute_force);
  }
  return json;
}

void run(const CaseOptions& options) {
  const BenchmarkCase benchmark_case(options);
  const std::vector<Tile> tiles = field_tiles(benchmark_case, options.is_quick ? 64 : 6);
  nlohmann::json sizes = nlohmann::json::array();
  for (const int codewords :
       options.is_quick ? std::vector<int>{64, 128} : std::vector<int>{16384, 65536})
    sizes.push_back(measure(tiles, codewords, options));
  write_section(options.output,
                "encoding",
                {{"case", benchmark_case.description_with_field()},
                 {"tiles_not_empty", tiles.size()},
                 {"blas", blas_description()},
                 {"codebooks", sizes}});
}

}  // namespace

}  // namespace af::benchmark

// Outside app_main only the declaration of options can throw, and that would be a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::benchmark::CaseOptions options;
  CLI::App app{"Tiles per second of one core: exact search, brute force, Faiss."};
  af::benchmark::bind_case(app, options);
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator&) { af::benchmark::run(options); });
}
