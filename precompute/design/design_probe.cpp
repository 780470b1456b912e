// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/design_probe.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "base/error.h"
#include "base/hash_random.h"
#include "precompute/codebook/mean_removal.h"
#include "precompute/codebook/tile_drawing.h"
#include "precompute/design/drr_time.h"
#include "precompute/design/patch_nodes.h"

namespace af {

namespace {

constexpr std::uint64_t kTileStream = 0x74696C65;  // "tile"

/// Every rank's values, in rank order.
template <typename T>
std::vector<std::vector<T>> gathered(const CodebookReduction& reduction, std::span<const T> mine) {
  std::vector<std::vector<T>> all;
  for (const std::vector<std::byte>& bytes : reduction.all_gather(std::as_bytes(mine))) {
    std::vector<T> values(bytes.size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
    all.push_back(std::move(values));
  }
  return all;
}

/// Values of tasks of which each rank did its share.
template <typename T>
void share_out(const CodebookReduction& reduction, std::span<T> of_task) {
  const auto all = gathered<T>(reduction, of_task);
  for (std::size_t task = 0; task < of_task.size(); ++task)
    of_task[task] = all[task % all.size()][task];
}

double decibels(double mean_square) {
  return -10.0 * std::log10(std::max(mean_square, 1e-30));
}

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

/// Sums of the squared differences of two look-ups of a patch over its foreground.
template <typename Value>
double sum_of_squares(const RayPatch& patch, const Value& value) {
  double sum = 0.0;
  for (std::size_t i = 0; i < patch.reference.size(); ++i)
    if (patch.reference[i] > 0.0f) sum += value(i) * value(i);
  return sum;
}

void add_losses(const RayPatch& patch,
                double weight,
                const PatchValues& cast,
                const PatchValues& quantised,
                PoseLoss& loss) {
  for (std::size_t which = 0; which < 2; ++which) {
    const auto& plain = which == 0 ? cast.linear : cast.cubic;
    const auto& coded = which == 0 ? quantised.linear : quantised.cubic;
    const auto reference = [&](std::size_t i) { return static_cast<double>(patch.reference[i]); };
    const double interpolation =
        sum_of_squares(patch, [&](std::size_t i) { return plain[i] - reference(i); });
    const double quantisation =
        sum_of_squares(patch, [&](std::size_t i) { return coded[i] - plain[i]; });
    const double all =
        sum_of_squares(patch, [&](std::size_t i) { return coded[i] - reference(i); });
    loss.interpolation[which] += weight * interpolation;
    loss.quantisation[which] += weight * quantisation;
    loss.common[which] += weight * (all - interpolation - quantisation);
  }
}

}  // namespace

DesignPoint DesignMeasurement::point(int codewords, const std::string& look_up) const {
  return {forecast(codewords, look_up), occupied_tiles, drr_pixels, footprint_nodes};
}

DesignForecast DesignMeasurement::forecast(int codewords, const std::string& look_up) const {
  DesignForecast forecast;
  forecast.design = design;
  forecast.design.codewords = codewords;
  forecast.design.look_up = look_up;
  const std::size_t which = look_up == "linear" ? 0 : 1;
  const TrainingTiles tiles{training_tiles.at(codewords), occupied_tiles};
  const double ratio = error_ratio(tile_errors, codewords, tiles);
  // Both errors blur, so they are alike to some degree.
  double common = 0.0;
  double geometric = 0.0;
  for (const PoseLoss& pose : poses) {
    common += pose.common[which];
    geometric += 2.0 * std::sqrt(pose.interpolation[which] * pose.quantisation[which]);
  }
  const double likeness = geometric > 0.0 ? std::clamp(common / geometric, -0.5, 1.0) : 0.0;
  std::vector<double> total;
  std::vector<double> interpolation;
  std::vector<double> quantisation;
  for (const PoseLoss& pose : poses) {
    interpolation.push_back(decibels(pose.interpolation[which]));
    quantisation.push_back(decibels(pose.quantisation[which] * ratio));
    const double quantised = pose.quantisation[which] * ratio;
    total.push_back(decibels(pose.interpolation[which] + quantised +
                             2.0 * likeness * std::sqrt(pose.interpolation[which] * quantised)));
  }
  forecast.psnr_db = median_of(total);
  forecast.interpolation_db = median_of(interpolation);
  forecast.quantisation_db = median_of(quantisation);
  constexpr double kOtherBytes = 30e3;
  const auto bytes = bytes_per_tile.find(codewords);
  forecast.file_bytes = kOtherBytes + kFileBytesPerCodeword * codewords +
                        (bytes == bytes_per_tile.end() ? 2.0 : bytes->second) * occupied_tiles;
  forecast.drr_ms = estimated_drr_ms(forecast.design, drr_pixels, footprint_nodes);
  return forecast;
}

DesignProbe::DesignProbe(const ProbeScene& scene,
                         const ProbeOptions& options,
                         ProbeRays rays,
                         const CodebookReduction& reduction,
                         std::size_t ranks)
    : scene_(scene),
      options_(options),
      reduction_(reduction),
      share_{reduction.rank, ranks},
      rays_(std::move(rays)) {
  share_out<ProbePose>(reduction_, rays_.of_pose);
}

std::vector<NumberedTile> DesignProbe::shuffled_tiles(const FieldSample& sample,
                                                      const FieldLattice& lattice,
                                                      std::size_t wanted) const {
  std::array<std::uint64_t, 1> count{};
  for (const FieldSample::Chunk& chunk : sample.chunks) count[0] += chunk.tiles.tiles.size();
  reduction_.sum(count);
  const double share = static_cast<double>(wanted) / static_cast<double>(count[0] + 1);
  const std::uint64_t last =
      share >= 1.0 ? ~std::uint64_t{0} : static_cast<std::uint64_t>(share * 0x1p64);
  // The order is random, but depends on the tiles alone.
  std::vector<KeyedTile> mine;
  for (const FieldSample::Chunk& chunk : sample.chunks) {
    const TilePlaces places(lattice, chunk.unit);
    chunk.tiles.for_each([&](std::size_t local, const Tile& tile) {
      const std::int64_t index = places.global_index(local);
      const std::uint64_t key =
          hash64(options_.seed, kTileStream, static_cast<std::uint64_t>(index));
      if (key <= last) mine.push_back({key, {index, tile}});
    });
  }
  std::vector<KeyedTile> all;
  for (const auto& of_rank : gathered<KeyedTile>(reduction_, mine))
    all.insert(all.end(), of_rank.begin(), of_rank.end());
  std::ranges::sort(all, {}, [](const KeyedTile& tile) {
    return std::pair(tile.key, tile.numbered.global_index);
  });
  std::vector<NumberedTile> shuffled;
  shuffled.reserve(all.size());
  for (const KeyedTile& tile : all) shuffled.push_back(tile.numbered);
  return shuffled;
}

std::vector<Codebook> DesignProbe::small_codebooks(std::span<const NumberedTile> tiles,
                                                   int mean_step) const {
  // The largest takes longer than the others together.
  std::vector<Codebook> codebooks(kProbeCodewords.size(), Codebook{{}, mean_step});
  for (std::size_t i = 0; i < kProbeCodewords.size(); ++i) {
    const std::size_t trainer = (i + 1 == kProbeCodewords.size() ? 0 : 1) % share_.ranks;
    if (trainer == share_.rank)
      codebooks[i] = small_codebook(tiles, {kProbeCodewords[i], mean_step, options_.seed});
  }
  for (std::size_t i = 0; i < kProbeCodewords.size(); ++i) {
    const std::size_t trainer = (i + 1 == kProbeCodewords.size() ? 0 : 1) % share_.ranks;
    codebooks[i].codewords = gathered<Tile>(reduction_, codebooks[i].codewords)[trainer];
  }
  return codebooks;
}

std::vector<PoseLoss> DesignProbe::losses(const FieldCaster& caster,
                                          const LightSlab& planes,
                                          const Codebook& codebook) const {
  const NearestCodeword search(codebook);
  std::vector<PoseLoss> losses(rays_.poses);
  for (const RayPatch& patch : rays_.patches) {
    const PatchNodes nodes(caster, planes, scene_.quantizer.step(), patch);
    const ProbePose& pose = rays_.of_pose[patch.pose];
    const double weight =
        patch.weight / (std::max(pose.foreground, 1e-12) * pose.maximum * pose.maximum);
    add_losses(patch, weight, nodes.values(), nodes.values(search, codebook), losses[patch.pose]);
  }
  share_out<PoseLoss>(reduction_, losses);
  return losses;
}

DesignMeasurement DesignProbe::measure(const FieldDesign& design,
                                       std::span<const int> codewords) const {
  const LightSlab planes = scene_.planes(design);
  const FieldLattice lattice = planes.lattice();
  const auto caster = scene_.make_caster(planes);
  DesignMeasurement measured;
  measured.design = design;
  FieldSample sample = sample_field(*caster, lattice, options_.viewpoints, share_);
  share_out<double>(reduction_, sample.occupied_share);
  for (std::size_t i = 0; i < sample.occupied_share.size(); ++i)
    measured.occupied_tiles += sample.occupied_share[i] * sample.tiles_meant[i];
  std::vector<NumberedTile> tiles =
      shuffled_tiles(sample, lattice, probe_tiles(*std::ranges::max_element(codewords)));
  remove_means(tiles, design.mean_step);
  const std::vector<Codebook> codebooks = small_codebooks(tiles, design.mean_step);
  const auto unseen = std::span(tiles).last(std::min(tiles.size(), kProbeUnseenTiles));
  for (std::size_t i = 0; i < codebooks.size(); ++i)
    measured.tile_errors[i] = squared_error(unseen, codebooks[i]);
  measured.poses = losses(*caster, planes, codebooks.back());
  for (const int count : codewords) {
    const TrainingSelection selection = options_.selection_for(count);
    measured.training_tiles[count] = std::min(static_cast<double>(selection.max_training_tiles),
                                              selection.fraction * measured.occupied_tiles);
    const Codebook codebook = drawn_codebook(tiles, {count, design.mean_step, options_.seed});
    std::array<std::uint64_t, 2> sums{};
    // A trained codebook's indices are coded in fewer bytes than a drawn one's.
    constexpr double kTrainedCodebook = 0.92;
    // A few chunks suffice for the estimate.
    constexpr std::size_t kChunks = 8;
    const NearestCodeword search(codebook);
    const std::size_t stride = 1 + sample.occupied_share.size() / kChunks;
    std::size_t at = 0;
    for (std::size_t number = 0; number < sample.occupied_share.size(); ++number) {
      if (!share_.has(number)) continue;
      const FieldSample::Chunk& chunk = sample.chunks[at++];
      if (number % stride != 0) continue;
      const IndexBytes bytes = index_bytes(chunk, search, design.mean_step > 0);
      sums[0] += static_cast<std::uint64_t>(bytes.bytes);
      sums[1] += static_cast<std::uint64_t>(bytes.tiles);
    }
    reduction_.sum(sums);
    // This extrapolates from a smaller codebook to the wanted one.
    const double missing_bits = std::log2(1.0 * count / static_cast<double>(codebook.size()));
    measured.bytes_per_tile[count] =
        kTrainedCodebook *
        (static_cast<double>(sums[0]) / std::max(1.0, static_cast<double>(sums[1])) +
         missing_bits / 8.0);
  }
  const CameraGeometry& camera = scene_.camera;
  measured.drr_pixels = 1.0 * camera.size_px.x() * camera.size_px.y();
  const double shrink =
      camera.depth_mm(scene_.frame.center_room_mm) / camera.source_detector_distance_mm();
  const SlabGeometry& slab = planes.slabs.front();
  measured.footprint_nodes =
      camera.size_px.x() * camera.pixel_spacing_mm.x() * shrink / slab.s.spacing_mm() *
      (camera.size_px.y() * camera.pixel_spacing_mm.y() * shrink / slab.t.spacing_mm());
  measured.most_codewords =
      static_cast<int>(std::min<double>(kMaxCodewords, measured.occupied_tiles / 8.0));
  return measured;
}

}  // namespace af
