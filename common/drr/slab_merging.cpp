// SPDX-License-Identifier: Apache-2.0
#include "drr/slab_merging.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"

namespace af {

namespace {

/// Nodes around a slab's stored ones that taps may reach. Taps further out reach only zeros.
constexpr int kBorder = MergingTaps::kCount;

/// (1 3 3 1)/8 centred at a node coordinate.
MergingTaps halving_taps(double coordinate) {
  constexpr std::array<double, 4> kBinomial{0.125, 0.375, 0.375, 0.125};
  const double leftmost = coordinate - 1.5;
  const double lower = std::floor(leftmost);
  const double x = leftmost - lower;
  const std::array<double, 4> lagrange{-x * (x - 1.0) * (x - 2.0) / 6.0,
                                       (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0,
                                       -(x + 1.0) * x * (x - 2.0) / 2.0,
                                       (x + 1.0) * x * (x - 1.0) / 6.0};
  std::array<double, MergingTaps::kCount> weights{};
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < 4; ++j) weights[i + j] += kBinomial[i] * lagrange[j];
  MergingTaps taps;
  taps.first = static_cast<int>(lower) - 1;
  for (std::size_t i = 0; i < weights.size(); ++i) taps.weights[i] = static_cast<float>(weights[i]);
  return taps;
}

/// Where lines from a viewpoint through a node of the merged plane meet a slab's plane, along one
/// axis, in the slab's node coordinates.
class NodeMap {
 public:
  NodeMap(const GridAxis& merged, const GridAxis& slab, double reach_ratio)
      : merged_(merged), slab_(slab), reach_ratio_(reach_ratio) {}

  [[nodiscard]] double coordinate(int merged_node, double viewpoint_mm) const {
    const double position_mm = merged_.position_mm(merged_node);
    return slab_.node_coordinate(viewpoint_mm + reach_ratio_ * (position_mm - viewpoint_mm));
  }

 private:
  GridAxis merged_;
  GridAxis slab_;
  double reach_ratio_;
};

/// The distance of the slab's plane from the viewpoints, divided by that of the merged plane.
double reach_ratio(const LightSlab& field_geometry,
                   const SlabGeometry& slab,
                   const SlabGeometry& merged) {
  return (field_geometry.uv_plane_y_mm - slab.st_plane_y_mm) /
         (field_geometry.uv_plane_y_mm - merged.st_plane_y_mm);
}

/// The halved axis of a plane at a weighted mean depth. A ray's positions on the planes are an
/// affine function of depth, so the edges are too.
GridAxis mean_halved_axis(std::span<const FieldLevelSlab> slabs,
                          std::span<const double> weights,
                          GridAxis SlabGeometry::*axis,
                          const char* name) {
  GridAxis mean{0.0, 0.0, 2};
  for (std::size_t k = 0; k < slabs.size(); ++k) {
    const GridAxis halved = halved_axis(slabs[k].geometry.*axis, name);
    mean.first_mm += weights[k] * halved.first_mm;
    mean.last_mm += weights[k] * halved.last_mm;
    mean.nodes = std::max(mean.nodes, halved.nodes);
  }
  return mean;
}

/// The merged nodes that see a stored node of any slab from any viewpoint.
class SeenNodes {
 public:
  explicit SeenNodes(int nodes) : begin_(nodes), end_(0) {}

  void add(const NodeMap& map, const GridAxis& viewpoints, const NodeRange& stored, int nodes) {
    for (int node = 0; node < nodes; ++node) {
      const double from_first = map.coordinate(node, viewpoints.first_mm);
      const double from_last = map.coordinate(node, viewpoints.last_mm);
      const double low = std::min(from_first, from_last);
      const double high = std::max(from_first, from_last);
      if (high + kBorder < stored.begin || low - kBorder >= stored.end()) continue;
      begin_ = std::min(begin_, node);
      end_ = std::max(end_, node + 1);
    }
  }
  [[nodiscard]] NodeRange range() const {
    return begin_ < end_ ? NodeRange{begin_, end_ - begin_} : NodeRange{0, 1};
  }

 private:
  int begin_;
  int end_;
};

std::vector<std::vector<MergingTaps>> taps_of(const NodeMap& map,
                                              const GridAxis& viewpoints,
                                              const NodeRange& nodes) {
  std::vector<std::vector<MergingTaps>> taps;
  for (int viewpoint = 0; viewpoint < viewpoints.nodes; ++viewpoint) {
    auto& row = taps.emplace_back();
    for (int node = nodes.begin; node < nodes.end(); ++node)
      row.push_back(halving_taps(map.coordinate(node, viewpoints.position_mm(viewpoint))));
  }
  return taps;
}

/// One viewpoint's samples of a slab with a border. The outermost nodes of the lattice are
/// replicated; nodes that are not stored are 0.
class BorderedImage {
 public:
  explicit BorderedImage(const SlabGeometry& slab)
      : slab_(slab),
        stride_(slab.stored_s.count + 2 * kBorder),
        rows_(slab.stored_t.count + 2 * kBorder),
        values_(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(rows_)) {}

  [[nodiscard]] int stride() const { return stride_; }
  /// The first row that taps weight.
  [[nodiscard]] const float* rows(const MergingTaps& taps) const {
    return row(offset(taps.first, slab_.stored_t));
  }
  /// The column where taps begin within a row.
  [[nodiscard]] int column(const MergingTaps& taps) const {
    return offset(taps.first, slab_.stored_s);
  }

  void fill(const std::uint16_t* samples) {
    for (int t = 0; t < slab_.stored_t.count; ++t, samples += slab_.stored_s.count) {
      float* to = row(kBorder + t);
      std::copy_n(samples, slab_.stored_s.count, to + kBorder);
      if (slab_.stored_s.begin == 0) std::fill_n(to, kBorder, to[kBorder]);
      if (slab_.stored_s.end() == slab_.s.nodes)
        std::fill_n(to + stride_ - kBorder, kBorder, to[stride_ - kBorder - 1]);
    }
    for (int i = 0; i < kBorder; ++i) {
      if (slab_.stored_t.begin == 0) std::copy_n(row(kBorder), stride_, row(i));
      if (slab_.stored_t.end() == slab_.t.nodes)
        std::copy_n(row(rows_ - kBorder - 1), stride_, row(rows_ - 1 - i));
    }
  }

 private:
  [[nodiscard]] static int offset(int first, const NodeRange& stored) {
    return std::clamp(first - stored.begin + kBorder, 0, stored.count + kBorder);
  }
  [[nodiscard]] float* row(int i) { return values_.data() + std::ptrdiff_t{i} * stride_; }
  [[nodiscard]] const float* row(int i) const {
    return values_.data() + std::ptrdiff_t{i} * stride_;
  }

  SlabGeometry slab_;
  int stride_;
  int rows_;
  std::vector<float> values_;
};

/// Adds the weighted nodes of one viewpoint's image to the merged sums, [t][s].
void add_weighted(const BorderedImage& image,
                  const std::vector<MergingTaps>& s_taps,
                  const std::vector<MergingTaps>& t_taps,
                  std::vector<float>& row,
                  float* sums) {
  row.resize(static_cast<std::size_t>(image.stride()));
  for (const MergingTaps& t : t_taps) {
    const float* from = image.rows(t);
    std::ranges::fill(row, 0.0f);
    for (const float weight : t.weights) {
      for (int c = 0; c < image.stride(); ++c) row[static_cast<std::size_t>(c)] += weight * from[c];
      from += image.stride();
    }
    for (const MergingTaps& s : s_taps) {
      const float* values = row.data() + image.column(s);
      float sum = 0.0f;
      for (int i = 0; i < MergingTaps::kCount; ++i) sum += s.weights[i] * values[i];
      *sums++ += sum;
    }
  }
}

std::uint16_t rounded_sample(float sum) {
  return static_cast<std::uint16_t>(std::clamp(sum + 0.5f, 0.0f, 65535.0f));
}

}  // namespace

SlabMerging::SlabMerging(const LightSlab& field_geometry, std::span<const FieldLevelSlab> slabs) {
  check(!slabs.empty(), "slabs to merge");
  std::vector<double> weights;
  for (const FieldLevelSlab& slab : slabs) weights.push_back(slab.weight + 1.0);
  const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (double& weight : weights) weight /= total;

  merged_.st_plane_y_mm = 0.0;
  for (std::size_t k = 0; k < slabs.size(); ++k)
    merged_.st_plane_y_mm += weights[k] * slabs[k].geometry.st_plane_y_mm;
  merged_.y_low_mm = slabs.front().geometry.y_low_mm;
  merged_.y_high_mm = slabs.back().geometry.y_high_mm;
  merged_.s = mean_halved_axis(slabs, weights, &SlabGeometry::s, "s");
  merged_.t = mean_halved_axis(slabs, weights, &SlabGeometry::t, "t");

  std::vector<NodeMap> s_maps, t_maps;
  SeenNodes seen_s(merged_.s.nodes), seen_t(merged_.t.nodes);
  for (const FieldLevelSlab& slab : slabs) {
    const double ratio = reach_ratio(field_geometry, slab.geometry, merged_);
    s_maps.emplace_back(merged_.s, slab.geometry.s, ratio);
    t_maps.emplace_back(merged_.t, slab.geometry.t, ratio);
    seen_s.add(s_maps.back(), field_geometry.u, slab.geometry.stored_s, merged_.s.nodes);
    seen_t.add(t_maps.back(), field_geometry.v, slab.geometry.stored_t, merged_.t.nodes);
  }
  merged_.stored_s = seen_s.range();
  merged_.stored_t = seen_t.range();
  for (std::size_t k = 0; k < slabs.size(); ++k)
    sources_.push_back({&slabs[k],
                        taps_of(s_maps[k], field_geometry.u, merged_.stored_s),
                        taps_of(t_maps[k], field_geometry.v, merged_.stored_t)});
}

void SlabMerging::merge(int u, int v, std::span<std::uint16_t> samples) const {
  std::vector<float> sums(samples.size());
  std::vector<float> row;
  for (const Source& source : sources_) {
    BorderedImage image(source.slab->geometry);
    image.fill(source.slab->samples.viewpoints(u, v));
    add_weighted(image,
                 source.s[static_cast<std::size_t>(u)],
                 source.t[static_cast<std::size_t>(v)],
                 row,
                 sums.data());
  }
  std::ranges::transform(sums, samples.begin(), rounded_sample);
}

}  // namespace af
