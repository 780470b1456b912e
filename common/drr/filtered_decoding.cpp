// SPDX-License-Identifier: Apache-2.0
#include "drr/filtered_decoding.h"

#include <algorithm>
#include <array>

#include "base/error.h"
#include "base/vector_width.h"
#include "drr/tile_filter_kernel.h"

namespace af {

namespace {

/// Rows of tiles along t that are decoded together; those before and after them are needed, too.
constexpr int kRowsTogether = 4;
constexpr int kRowsHeld = kRowsTogether + 2;

struct TileCounts {
  int u, v, s, t;
};

/// Coefficients of the rows in work, of three rows of viewpoint tiles along u and all along v:
/// [u modulo 3][v][row][coefficient][s], and the levels of one row of tiles.
class Window {
 public:
  explicit Window(const TileCounts& tiles)
      : v_tiles_(static_cast<std::size_t>(tiles.v)),
        row_(1 + static_cast<std::size_t>(tiles.s + kFilterRowPadding)),
        coefficients_(3 * v_tiles_ * kRowsHeld * kTileElements * row_, 0.0f),
        row_of_levels_(2 * row_),
        levels_(8 * row_of_levels_) {
    for (std::size_t i = 0; i < 8; ++i) rows_[i] = levels_.data() + i * row_of_levels_;
  }

  [[nodiscard]] std::size_t coefficient_stride() const { return row_; }
  [[nodiscard]] std::size_t row_stride() const { return kTileElements * row_; }
  /// Coefficient 0 of the first tile of the first row that is held.
  [[nodiscard]] float* tiles(int u, int v) {
    const auto slot = static_cast<std::size_t>(u % 3) * v_tiles_ + static_cast<std::size_t>(v);
    return coefficients_.data() + slot * kRowsHeld * row_stride() + 1;
  }
  [[nodiscard]] std::uint16_t* const* rows() const { return rows_.data(); }

 private:
  std::size_t v_tiles_;
  std::size_t row_;  ///< with one tile before it, which is 0, as those behind it
  std::vector<float> coefficients_;
  std::size_t row_of_levels_;
  std::vector<std::uint16_t> levels_;
  std::array<std::uint16_t*, 8> rows_{};
};

/// One slab, and the window that moves over it.
class SlabDecoding {
 public:
  SlabDecoding(const CompressedAttenuationField& field,
               const std::vector<TileCoefficients>& codewords,
               std::size_t slab,
               std::span<std::uint16_t> samples)
      : codebook_(field.codebook),
        codewords_(codewords),
        values_(field.slabs[slab].indices.view()),
        lattice_(field.lattice(slab)),
        tiles_{lattice_.u.stored.tiles(),
               lattice_.v.stored.tiles(),
               lattice_.s.stored.tiles(),
               lattice_.t.stored.tiles()},
        samples_(samples),
        window_(tiles_) {}

  /// At most kRowsTogether.
  void decode_rows(int begin, int end);

 private:
  void fill(int u, int v, int first_row, int rows);
  void store(int u, int v, int row) const;

  const Codebook& codebook_;
  const std::vector<TileCoefficients>& codewords_;
  std::span<const std::uint16_t> values_;
  SlabLattice lattice_;
  TileCounts tiles_;
  std::span<std::uint16_t> samples_;
  Window window_;
};

void SlabDecoding::decode_rows(int begin, int end) {
  const auto filter_tile_row = select_kernel<FilterTileRow>(
      kernels_128::filter_tile_row, kernels_256::filter_tile_row, kernels_512::filter_tile_row);
  static_assert(kTileElements == 16 && kFilterInputs == 33 && axis_input(4) == 9,
                "the kernel's numbers");
  const auto* weights =
      reinterpret_cast<const float(*)[kFilterInputs]>(codebook_.filter->weights.data());
  const auto fill_all = [&](int u) {
    for (int v = 0; v < tiles_.v; ++v) fill(u, v, begin - 1, end - begin + 2);
  };
  fill_all(0);
  for (int u = 0; u < tiles_.u; ++u) {
    if (u + 1 < tiles_.u) fill_all(u + 1);
    for (int v = 0; v < tiles_.v; ++v)
      for (int row = begin; row < end; ++row) {
        FilterRow tiles{{},
                        static_cast<std::int64_t>(window_.row_stride()),
                        static_cast<std::int64_t>(window_.coefficient_stride()),
                        tiles_.s};
        for (int i = 0; i < 9; ++i)
          tiles.tiles[i] = window_.tiles(std::clamp(u + i / 3 - 1, 0, tiles_.u - 1),
                                         std::clamp(v + i % 3 - 1, 0, tiles_.v - 1)) +
                           (row - begin + 1) * tiles.row_stride;
        filter_tile_row(tiles, weights, window_.rows());
        store(u, v, row);
      }
  }
}

void SlabDecoding::fill(int u, int v, int first_row, int rows) {
  const std::size_t stride = window_.coefficient_stride();
  const std::size_t values_per_row =
      codebook_.values_per_tile() * static_cast<std::size_t>(tiles_.t);
  const std::size_t first_value =
      (static_cast<std::size_t>(u) * static_cast<std::size_t>(tiles_.v) +
       static_cast<std::size_t>(v)) *
      static_cast<std::size_t>(tiles_.s) * values_per_row;
  for (int s = 0; s < tiles_.s; ++s)
    for (int r = 0; r < rows; ++r) {
      float* tile = window_.tiles(u, v) + static_cast<std::size_t>(r) * window_.row_stride() + s;
      const int t = first_row + r;
      // Codeword 0, an empty tile, stands for tiles that are not stored, too.
      const std::uint16_t* value = nullptr;
      if (t >= 0 && t < tiles_.t)
        value = values_.data() + first_value + static_cast<std::size_t>(s) * values_per_row + t;
      const std::uint16_t index = value != nullptr ? *value : std::uint16_t{0};
      const TileCoefficients& codeword = codewords_[index];
      for (std::size_t k = 0; k < kTileElements; ++k) tile[k * stride] = codeword[k];
      if (index != 0 && codebook_.has_means())
        tile[0] += static_cast<float>(kTileElements) * static_cast<float>(value[tiles_.t]);
    }
}

void SlabDecoding::store(int u, int v, int row) const {
  const auto columns = static_cast<std::size_t>(lattice_.s.stored.count);
  const auto nodes_t = static_cast<std::size_t>(lattice_.t.stored.count);
  for (int i = 0; i < 8; ++i) {
    const int node_u = 2 * u + i / 4;
    const int node_v = 2 * v + i / 2 % 2;
    const int node_t = 2 * row + i % 2;
    if (node_u >= lattice_.u.nodes || node_v >= lattice_.v.nodes ||
        node_t >= lattice_.t.stored.count)
      continue;
    const auto viewpoint =
        static_cast<std::size_t>(node_u) * static_cast<std::size_t>(lattice_.v.nodes) +
        static_cast<std::size_t>(node_v);
    std::copy_n(
        window_.rows()[i],
        columns,
        samples_.data() + (viewpoint * nodes_t + static_cast<std::size_t>(node_t)) * columns);
  }
}

}  // namespace

FilteredDecoding::FilteredDecoding(const CompressedAttenuationField& field) : field_(field) {
  const Codebook& codebook = field.codebook;
  check(codebook.filter.has_value(), "a codebook with a filter");
  codewords_.reserve(codebook.size());
  for (std::size_t i = 0; i < codebook.size(); ++i)
    codewords_.push_back(decoded_coefficients(codebook, static_cast<std::uint16_t>(i), 0));
}

void FilteredDecoding::decode(std::size_t slab,
                              int begin,
                              int end,
                              std::span<std::uint16_t> samples) const {
  SlabDecoding decoding(field_, codewords_, slab, samples);
  for (int row = begin; row < end; row += kRowsTogether)
    decoding.decode_rows(row, std::min(row + kRowsTogether, end));
}

}  // namespace af
