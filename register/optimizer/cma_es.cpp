// SPDX-License-Identifier: Apache-2.0
#include "register/optimizer/cma_es.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Eigenvalues>

#include "base/hash_random.h"
#include "register/optimizer/search_run.h"

namespace af::registration {
namespace {

constexpr double kDimensions = 6.0;

/// Constants of the tutorial's Table 1 for a population.
struct Constants {
  std::vector<double> weights;  ///< of the better half, best first; their sum is 1
  double effective = 0.0;       ///< mu_eff
  double c_sigma = 0.0, d_sigma = 0.0, c_c = 0.0, c_1 = 0.0, c_mu = 0.0;
  double expected_length = 0.0;  ///< of a standard normal vector
};

Constants constants_of(int population) {
  Constants constants;
  const int better = population / 2;
  for (int i = 0; i < better; ++i)
    constants.weights.push_back(std::log((population + 1) / 2.0) - std::log(i + 1.0));
  const double sum = std::accumulate(constants.weights.begin(), constants.weights.end(), 0.0);
  double squares = 0.0;
  for (double& weight : constants.weights) {
    weight /= sum;
    squares += weight * weight;
  }
  const double n = kDimensions;
  const double effective = 1.0 / squares;
  constants.effective = effective;
  constants.c_sigma = (effective + 2.0) / (n + effective + 5.0);
  constants.d_sigma =
      1.0 + 2.0 * std::max(0.0, std::sqrt((effective - 1.0) / (n + 1.0)) - 1.0) + constants.c_sigma;
  constants.c_c = (4.0 + effective / n) / (n + 4.0 + 2.0 * effective / n);
  constants.c_1 = 2.0 / ((n + 1.3) * (n + 1.3) + effective);
  constants.c_mu =
      std::min(1.0 - constants.c_1,
               2.0 * (effective - 2.0 + 1.0 / effective) / ((n + 2.0) * (n + 2.0) + effective));
  constants.expected_length = std::sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));
  return constants;
}

/// One drawn point; `step` is in units of sigma.
struct Sample {
  ScaledParameters step = ScaledParameters::Zero();
  double value = -std::numeric_limits<double>::infinity();
};

/// The distribution from which points are drawn.
struct Distribution {
  ScaledParameters mean = ScaledParameters::Zero();
  double sigma = 1.0;
  ScaledMatrix covariance = ScaledMatrix::Identity();
  ScaledParameters path_sigma = ScaledParameters::Zero();
  ScaledParameters path_c = ScaledParameters::Zero();
  ScaledMatrix axes = ScaledMatrix::Identity();
  ScaledParameters lengths = ScaledParameters::Ones();

  void decompose() {
    const Eigen::SelfAdjointEigenSolver<ScaledMatrix> solver(covariance);
    axes = solver.eigenvectors();
    lengths = solver.eigenvalues().cwiseMax(1e-20).cwiseSqrt();
  }
  [[nodiscard]] double largest_deviation() const { return sigma * lengths.maxCoeff(); }
};

void adapt(const Constants& constants,
           const std::vector<Sample>& samples,
           int generation,
           Distribution& d) {
  ScaledParameters mean_step = ScaledParameters::Zero();
  ScaledMatrix rank_mu = ScaledMatrix::Zero();
  for (std::size_t i = 0; i < constants.weights.size(); ++i) {
    mean_step += constants.weights[i] * samples[i].step;
    rank_mu += constants.weights[i] * samples[i].step * samples[i].step.transpose();
  }
  d.mean += d.sigma * mean_step;
  const ScaledParameters whitened =
      d.axes * (d.axes.transpose() * mean_step).cwiseQuotient(d.lengths);
  d.path_sigma =
      (1.0 - constants.c_sigma) * d.path_sigma +
      std::sqrt(constants.c_sigma * (2.0 - constants.c_sigma) * constants.effective) * whitened;
  const double warmed = std::sqrt(1.0 - std::pow(1.0 - constants.c_sigma, 2 * (generation + 1)));
  const double length = d.path_sigma.norm();
  const bool is_stalled =
      length / warmed >= (1.4 + 2.0 / (kDimensions + 1.0)) * constants.expected_length;
  d.path_c = (1.0 - constants.c_c) * d.path_c;
  if (!is_stalled)
    d.path_c += std::sqrt(constants.c_c * (2.0 - constants.c_c) * constants.effective) * mean_step;
  const double lost = is_stalled ? constants.c_1 * constants.c_c * (2.0 - constants.c_c) : 0.0;
  d.covariance = (1.0 - constants.c_1 - constants.c_mu + lost) * d.covariance +
                 constants.c_1 * d.path_c * d.path_c.transpose() + constants.c_mu * rank_mu;
  d.sigma *=
      std::exp(constants.c_sigma / constants.d_sigma * (length / constants.expected_length - 1.0));
  d.decompose();
}

}  // namespace

void cma_es(OptimizationTarget& target,
            const OptimizerOptions& options,
            const SearchBudget& budget,
            OptimizerResult& result) {
  SearchRun run(target, budget, result);
  if (!run.begin()) return;
  const Constants constants = constants_of(options.population);
  HashRandom random(budget.random_key);
  Distribution distribution;
  distribution.sigma = options.initial_step_mm;
  std::vector<Sample> samples(static_cast<std::size_t>(options.population));
  std::vector<ScaledParameters> points(samples.size());
  for (int generation = 0;; ++generation) {
    for (std::size_t i = 0; i < samples.size(); ++i) {
      ScaledParameters normal;
      for (int axis = 0; axis < 6; ++axis) normal[axis] = random.normal();
      samples[i].step = distribution.axes * distribution.lengths.cwiseProduct(normal);
      points[i] = distribution.mean + distribution.sigma * samples[i].step;
    }
    bool met_limit = true;
    const std::span<const SearchRun::Evaluation> evaluations = run.evaluate_all(points);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (evaluations[i].outcome == SearchRun::Outcome::Ended) {
        run.trace(distribution.largest_deviation());
        return;
      }
      const bool is_admissible = evaluations[i].outcome == SearchRun::Outcome::Value;
      met_limit = met_limit && !is_admissible;
      samples[i].value =
          is_admissible ? evaluations[i].target.value : -std::numeric_limits<double>::infinity();
      if (is_admissible) run.offer(points[i], samples[i].value);
    }
    // A stable sort keeps equal values in the order of drawing.
    std::stable_sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) {
      return a.value > b.value;
    });
    if (met_limit)
      distribution.sigma /= 2.0;  // there is nothing to learn from, so draw nearer
    else
      adapt(constants, samples, generation, distribution);
    run.trace(distribution.largest_deviation());
    if (distribution.largest_deviation() < options.final_step_mm) {
      run.converge(met_limit, options.final_step_mm);
      return;
    }
  }
}

}  // namespace af::registration
