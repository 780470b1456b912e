// SPDX-License-Identifier: Apache-2.0
#include "drr/hardening_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Dense>

namespace af {

namespace {

constexpr double kWaterReach = 12.0;
constexpr double kBoneReach = 8.0;
constexpr int kStraight = 2;
constexpr int kUnknowns = kStraight + HardeningPolynomial::kAllTerms;

/// Coordinates are rounded to single precision as in the kernel, so that their rounding is no error
/// of the fit.
void place_coordinates(const Eigen::Vector2d& hardest, double knee, HardeningPolynomial& fit) {
  fit.reach[0] = static_cast<float>(kWaterReach);
  fit.reach[1] = static_cast<float>(kBoneReach);
  for (int i = 0; i < 2; ++i) {
    fit.hard[i] = static_cast<float>(hardest[i] / knee);
    fit.tilt[i] = static_cast<float>((i == 0 ? hardest[1] : -hardest[0]) / kWaterReach);
  }
  const double most = 1.0 + static_cast<double>(fit.hard[0]) * kWaterReach +
                      static_cast<double>(fit.hard[1]) * kBoneReach;
  fit.log_scale = static_cast<float>(1.0 / std::log2(most));
}

/// The factors of U's coefficients: the two straight ones, then the terms in their order.
Eigen::RowVectorXd basis_at(const HardeningPolynomial& fit, double water, double bone) {
  const auto weighted = [&](const float(&factors)[2]) {
    return static_cast<double>(factors[0]) * water + static_cast<double>(factors[1]) * bone;
  };
  const double x = static_cast<double>(fit.log_scale) * std::log2(1.0 + weighted(fit.hard));
  Eigen::RowVectorXd basis(kUnknowns);
  basis[0] = water;
  basis[1] = bone;
  double power_of_a = 1.0;
  for (int j = 0; j < HardeningPolynomial::kPowers; ++j) {
    double term = x * power_of_a;
    for (int i = 0; i < HardeningPolynomial::kTerms[j]; ++i) {
      basis[kStraight + HardeningPolynomial::kFirst[j] + i] = term;
      term *= 2.0 * x - 1.0;
    }
    power_of_a *= weighted(fit.tilt);
  }
  return basis;
}

/// Rounds to a grid. Where exp() and log() differ in the last bit, least squares do too; on a grid
/// this coarse they agree. kAllTerms halves of it are below 4e-5 of U.
float on_grid(double value) {
  constexpr double kGrid = 1.0 / (1 << 18);
  return static_cast<float>(std::round(value / kGrid) * kGrid);
}

struct Nodes {
  std::vector<std::array<double, 2>> at;
  Eigen::VectorXd attenuation;
  Eigen::VectorXd weight;
};

Nodes nodes_of(const std::function<double(double, double)>& attenuation) {
  constexpr int kPerAxis = 33;
  std::vector<double> shares;
  for (int i = 0; i < kPerAxis; ++i) {
    const double chebyshev = 0.5 - 0.5 * std::cos(M_PI * i / (kPerAxis - 1));
    shares.push_back(chebyshev * chebyshev * chebyshev * chebyshev);
  }
  Nodes nodes;
  for (const double water : shares)
    for (const double bone : shares) nodes.at.push_back({kWaterReach * water, kBoneReach * bone});
  const auto count = static_cast<Eigen::Index>(nodes.at.size());
  nodes.attenuation.resize(count);
  nodes.weight.resize(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto& [water, bone] = nodes.at[static_cast<std::size_t>(i)];
    nodes.attenuation[i] = attenuation(water, bone);
    nodes.weight[i] = 1.0 / std::max(1.0, nodes.attenuation[i] / 8.0);
  }
  return nodes;
}

/// Finds the straight part and the terms. Returns the largest weighted residual.
double solve(const Nodes& nodes, HardeningPolynomial& fit) {
  const Eigen::Index count = nodes.attenuation.size();
  Eigen::MatrixXd basis(count, kUnknowns);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto& [water, bone] = nodes.at[static_cast<std::size_t>(i)];
    basis.row(i) = nodes.weight[i] * basis_at(fit, water, bone);
  }
  const Eigen::VectorXd wanted = nodes.weight.cwiseProduct(nodes.attenuation);
  const Eigen::VectorXd found = basis.householderQr().solve(wanted);
  for (int i = 0; i < kStraight; ++i) fit.straight[i] = on_grid(found[i]);
  for (int i = 0; i < HardeningPolynomial::kAllTerms; ++i)
    fit.terms[i] = on_grid(found[kStraight + i]);
  return (basis * found - wanted).cwiseAbs().maxCoeff();
}

/// The unit direction along which the coefficients of both materials spread most over the energies.
Eigen::Vector2d hardest_direction(const std::vector<HardeningBin>& spectrum) {
  double sum = 0.0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const HardeningBin& bin : spectrum) {
    sum += bin.weight;
    mean += bin.weight * Eigen::Vector2d(bin.water, bin.bone);
  }
  mean /= sum;
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const HardeningBin& bin : spectrum) {
    const Eigen::Vector2d from_mean = Eigen::Vector2d(bin.water, bin.bone) - mean;
    spread += bin.weight / sum * from_mean * from_mean.transpose();
  }
  const double angle = 0.5 * std::atan2(2.0 * spread(0, 1), spread(0, 0) - spread(1, 1));
  return {std::abs(std::cos(angle)), std::abs(std::sin(angle))};
}

}  // namespace

HardeningPolynomial fitted_hardening(const std::vector<HardeningBin>& spectrum,
                                     const std::function<double(double, double)>& attenuation,
                                     double slope_of_air) {
  const Eigen::Vector2d hardest = hardest_direction(spectrum);
  const Nodes nodes = nodes_of(attenuation);
  HardeningPolynomial best{};
  double least = std::numeric_limits<double>::infinity();
  // The knee depends on the filter of the beam, so the best of several is taken.
  for (const double knee : {0.03, 0.1, 0.3}) {
    HardeningPolynomial fit{};
    fit.slope_of_air = static_cast<float>(slope_of_air);
    place_coordinates(hardest, knee, fit);
    const double residual = solve(nodes, fit);
    if (!(residual < least)) continue;
    least = residual;
    best = fit;
  }
  return best;
}

}  // namespace af
