// SPDX-License-Identifier: Apache-2.0
#include "drr/filtered_decoding.h"

#include <algorithm>
#include <array>
#include <utility>

#include "base/error.h"
#include "base/vector_width.h"
#include "drr/tile_filter_kernel.h"

namespace af {

namespace {

/// Rows of tiles along t that are decoded together, while their coefficients stay in cache. The
/// rows before and after them are needed, too.
constexpr int kRowsTogether = 8;
constexpr int kRowsHeld = kRowsTogether + 2;

struct TileCounts {
  int u, v, s, t;
};

/// Coefficients of the rows in work, [3 (du + 1) + dv + 1][row][coefficient][s], for a tile of
/// viewpoints and its eight neighbours; and the levels of one row of tiles.
class Window {
 public:
  explicit Window(int s_tiles)
      : row_(1 + static_cast<std::size_t>(s_tiles + kFilterRowPadding)),
        coefficients_(9 * kRowsHeld * kTileElements * row_, 0.0f),
        row_of_levels_(2 * row_),
        levels_(8 * row_of_levels_) {
    for (std::size_t i = 0; i < 8; ++i) rows_[i] = levels_.data() + i * row_of_levels_;
  }

  [[nodiscard]] std::size_t coefficient_stride() const { return row_; }
  [[nodiscard]] std::size_t row_stride() const { return kTileElements * row_; }
  /// Coefficient 0 of the first tile of the first row that is held.
  [[nodiscard]] float* tiles(int neighbour) {
    // One tile before it is 0, like those behind it.
    return coefficients_.data() + static_cast<std::size_t>(neighbour) * kRowsHeld * row_stride() +
           1;
  }
  [[nodiscard]] std::uint16_t* const* rows() const { return rows_.data(); }

 private:
  std::size_t row_;
  std::vector<float> coefficients_;
  std::size_t row_of_levels_;
  std::vector<std::uint16_t> levels_;
  std::array<std::uint16_t*, 8> rows_{};
};

/// One tile of viewpoints of a slab, and the window that moves over its rows along t.
class ViewpointTileDecoding {
 public:
  ViewpointTileDecoding(const CompressedAttenuationField& field,
                        const std::vector<TileCoefficients>& codewords,
                        std::size_t slab,
                        std::array<int, 2> tile,
                        std::span<std::uint16_t> samples)
      : codebook_(field.codebook),
        codewords_(codewords),
        values_(field.slabs[slab].indices.view()),
        lattice_(field.lattice(slab)),
        tiles_{lattice_.u.stored.tiles(),
               lattice_.v.stored.tiles(),
               lattice_.s.stored.tiles(),
               lattice_.t.stored.tiles()},
        tile_(tile),
        samples_(samples),
        window_(tiles_.s) {}

  void decode() {
    for (int row = 0; row < tiles_.t; row += kRowsTogether)
      decode_rows(row, std::min(row + kRowsTogether, tiles_.t));
  }

 private:
  void decode_rows(int begin, int end);
  void fill(int neighbour, int first_row, int rows);
  void store(int row) const;

  const Codebook& codebook_;
  const std::vector<TileCoefficients>& codewords_;
  std::span<const std::uint16_t> values_;
  SlabLattice lattice_;
  TileCounts tiles_;
  std::array<int, 2> tile_;
  std::span<std::uint16_t> samples_;
  Window window_;
};

void ViewpointTileDecoding::decode_rows(int begin, int end) {
  const auto filter_tile_row = select_kernel<FilterTileRow>(
      kernels_128::filter_tile_row, kernels_256::filter_tile_row, kernels_512::filter_tile_row);
  static_assert(kTileElements == 16 && kFilterInputs == 33 && axis_input(4) == 9,
                "the kernel's numbers");
  const auto* weights =
      reinterpret_cast<const float(*)[kFilterInputs]>(codebook_.filter->weights.data());
  for (int i = 0; i < 9; ++i) fill(i, begin - 1, end - begin + 2);
  for (int row = begin; row < end; ++row) {
    FilterRow tiles{{},
                    static_cast<std::int64_t>(window_.row_stride()),
                    static_cast<std::int64_t>(window_.coefficient_stride()),
                    tiles_.s};
    for (int i = 0; i < 9; ++i)
      tiles.tiles[i] = window_.tiles(i) + (row - begin + 1) * tiles.row_stride;
    filter_tile_row(tiles, weights, window_.rows());
    store(row);
  }
}

void ViewpointTileDecoding::fill(int neighbour, int first_row, int rows) {
  const int u = std::clamp(tile_[0] + neighbour / 3 - 1, 0, tiles_.u - 1);
  const int v = std::clamp(tile_[1] + neighbour % 3 - 1, 0, tiles_.v - 1);
  const std::size_t stride = window_.coefficient_stride();
  const std::size_t values_per_row =
      codebook_.values_per_tile() * static_cast<std::size_t>(tiles_.t);
  const std::size_t first_value = static_cast<std::size_t>(u * tiles_.v + v) *
                                  static_cast<std::size_t>(tiles_.s) * values_per_row;
  for (int s = 0; s < tiles_.s; ++s)
    for (int r = 0; r < rows; ++r) {
      float* tile =
          window_.tiles(neighbour) + static_cast<std::size_t>(r) * window_.row_stride() + s;
      const int t = first_row + r;
      // Codeword 0, an empty tile, also stands for tiles that are not stored.
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

void ViewpointTileDecoding::store(int row) const {
  const auto columns = static_cast<std::size_t>(lattice_.s.stored.count);
  const auto nodes_t = static_cast<std::size_t>(lattice_.t.stored.count);
  for (int i = 0; i < 8; ++i) {
    const int node_u = 2 * tile_[0] + i / 4;
    const int node_v = 2 * tile_[1] + i / 2 % 2;
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

FilteredDecoding::FilteredDecoding(std::shared_ptr<const CompressedAttenuationField> field)
    : field_(std::move(field)) {
  const Codebook& codebook = field_->codebook;
  check(codebook.filter.has_value(), "a codebook with a filter");
  codewords_.reserve(codebook.size());
  for (std::size_t i = 0; i < codebook.size(); ++i)
    codewords_.push_back(decoded_coefficients(codebook, static_cast<std::uint16_t>(i), 0));
}

void FilteredDecoding::decode(std::size_t slab,
                              int a,
                              int b,
                              std::span<std::uint16_t> samples) const {
  ViewpointTileDecoding(*field_, codewords_, slab, {a, b}, samples).decode();
}

}  // namespace af
