// SPDX-License-Identifier: Apache-2.0
#include "spectrum/polychromatic_attenuation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace af {

namespace {

/// Nodes stand at (i / kNodesPerRoot)^2: dense where the beam is soft and hardens fast.
constexpr int kNodesPerRoot = 24;
constexpr int kCells = 96;
constexpr double kReach =
    (static_cast<double>(kCells) / kNodesPerRoot) * (static_cast<double>(kCells) / kNodesPerRoot);

double node_position(int i) {
  const double root = static_cast<double>(i) / kNodesPerRoot;
  return root * root;
}

/// The cell of a position on one axis: weights of values and slopes at its two nodes, and what
/// these are differentiated by the position.
struct CellWeights {
  int first = 0;
  std::array<double, 2> of_value, of_slope;
  std::array<double, 2> of_value_slope, of_slope_slope;

  explicit CellWeights(double position) {
    first = std::min(static_cast<int>(std::sqrt(position) * kNodesPerRoot), kCells - 1);
    const double low = node_position(first);
    const double width = node_position(first + 1) - low;
    const double t = (position - low) / width;
    of_value = {(1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t), t * t * (3.0 - 2.0 * t)};
    of_slope = {width * t * (1.0 - t) * (1.0 - t), width * t * t * (t - 1.0)};
    of_value_slope = {6.0 * t * (t - 1.0) / width, 6.0 * t * (1.0 - t) / width};
    of_slope_slope = {(1.0 - t) * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)};
  }
};

}  // namespace

PolychromaticAttenuation::PolychromaticAttenuation(const SpectrumOptions& options,
                                                   const TissueModel& tissue) {
  const double mu_water = tissue.attenuation_model().mu_water_per_mm;
  for (const SpectrumBin& bin : tube_spectrum(options, tissue.effective_energy_kev()))
    bins_.push_back({bin.weight,
                     tissue.water_mu_per_mm(bin.energy_kev) / mu_water,
                     tissue.bone_mu_per_mm(bin.energy_kev) / mu_water});
  for (int w = 0; w <= kCells; ++w)
    for (int b = 0; b <= kCells; ++b)
      nodes_.push_back(rounded(summed(node_position(w), node_position(b))));
}

PolychromaticAttenuation::Node PolychromaticAttenuation::rounded(const Node& node) {
  const auto in_single = [](double value) {
    return static_cast<double>(static_cast<float>(value));
  };
  return {in_single(node.u),
          in_single(node.by_water),
          in_single(node.by_bone),
          in_single(node.by_both)};
}

PolychromaticAttenuation::Node PolychromaticAttenuation::summed(double water, double bone) const {
  // The bin that comes through best is taken out, so that no ray is too long for the sum.
  double least = std::numeric_limits<double>::infinity();
  for (const Bin& bin : bins_) least = std::min(least, water * bin.water + bone * bin.bone);
  double sum = 0.0;
  Node mean;
  for (const Bin& bin : bins_) {
    const double signal = bin.weight * std::exp(least - (water * bin.water + bone * bin.bone));
    sum += signal;
    mean.by_water += signal * bin.water;
    mean.by_bone += signal * bin.bone;
    mean.by_both += signal * bin.water * bin.bone;
  }
  mean.by_water /= sum;
  mean.by_bone /= sum;
  // Minus the covariance of the two coefficients over what comes through.
  mean.by_both = mean.by_water * mean.by_bone - mean.by_both / sum;
  mean.u = least - std::log(sum);
  return mean;
}

PolychromaticAttenuation::Node PolychromaticAttenuation::interpolated(double water,
                                                                      double bone) const {
  if (!(water <= kReach && bone <= kReach)) return summed(water, bone);
  const CellWeights w(water);
  const CellWeights b(bone);
  Node result;
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t j = 0; j < 2; ++j) {
      const Node& node = nodes_[(static_cast<std::size_t>(w.first) + i) * (kCells + 1) +
                                static_cast<std::size_t>(b.first) + j];
      const double across_value = node.u * b.of_value[j] + node.by_bone * b.of_slope[j];
      const double across_slope = node.by_water * b.of_value[j] + node.by_both * b.of_slope[j];
      result.u += w.of_value[i] * across_value + w.of_slope[i] * across_slope;
      result.by_water += w.of_value_slope[i] * across_value + w.of_slope_slope[i] * across_slope;
      result.by_bone +=
          w.of_value[i] * (node.u * b.of_value_slope[j] + node.by_bone * b.of_slope_slope[j]) +
          w.of_slope[i] *
              (node.by_water * b.of_value_slope[j] + node.by_both * b.of_slope_slope[j]);
    }
  return result;
}

template <typename Function>
PolychromaticAttenuation::Value PolychromaticAttenuation::within_limits(
    double all, double bone, const Function& node_at) const {
  if (!(all > 0.0)) {  // much of a DRR is air
    const double by_all = nodes_.front().by_water;
    return {by_all * all, by_all, 0.0};
  }
  if (bone < 0.0) {
    const Node water = node_at(all, 0.0);
    return {water.u, water.by_water, 0.0};
  }
  if (bone > all) {
    const Node only_bone = node_at(0.0, all);
    return {only_bone.u, only_bone.by_bone, 0.0};
  }
  const Node node = node_at(all - bone, bone);
  return {node.u, node.by_water, node.by_bone - node.by_water};
}

PolychromaticAttenuation::Value PolychromaticAttenuation::at(double all, double bone) const {
  return within_limits(
      all, bone, [this](double water, double of_bone) { return interpolated(water, of_bone); });
}

PolychromaticAttenuation::Value PolychromaticAttenuation::exactly(double all, double bone) const {
  return within_limits(
      all, bone, [this](double water, double of_bone) { return summed(water, of_bone); });
}

}  // namespace af
