// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/bootstrap.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "base/error.h"
#include "base/hash_random.h"
#include "evaluate/statistics/statistics.h"

namespace af::evaluation {
namespace {

constexpr std::uint64_t kBootstrapStream = 0x626F6F74;  // "boot"

}  // namespace

CaseBootstrap bootstrap_over_cases(
    std::size_t cases,
    const std::function<double(std::span<const std::size_t> drawn)>& statistic,
    std::uint64_t seed,
    std::size_t replicates) {
  check(replicates > 0, "a bootstrap has replicates");
  CaseBootstrap result{cases, 0, 0, kNan, kNan};
  if (cases < 2) return result;
  result.replicates = replicates;
  std::vector<std::size_t> drawn(cases);
  std::vector<double> values;
  for (std::size_t replicate = 0; replicate < replicates; ++replicate) {
    HashRandom random(seed, kBootstrapStream, replicate);
    for (std::size_t& index : drawn) index = static_cast<std::size_t>(random.below(cases));
    const double value = statistic(drawn);
    if (std::isnan(value))
      ++result.undefined;
    else
      values.push_back(value);
  }
  if (values.empty()) return result;
  std::sort(values.begin(), values.end());
  result.low = quantile(values, 0.025);
  result.high = quantile(values, 0.975);
  return result;
}

MeanOverCases mean_over_cases(const std::vector<CaseMean>& cases, std::uint64_t seed) {
  const auto mean_of = [&](std::span<const std::size_t> drawn) {
    CaseMean all;
    for (const std::size_t index : drawn) {
      all.sum += cases[index].sum;
      all.count += cases[index].count;
    }
    return all.sum / all.count;
  };
  std::vector<std::size_t> each(cases.size());
  std::iota(each.begin(), each.end(), 0);
  std::vector<double> means;
  for (const CaseMean& mean : cases)
    if (mean.count > 0.0) means.push_back(mean.sum / mean.count);
  return {
      mean_of(each), bootstrap_over_cases(cases.size(), mean_of, seed), student_interval(means)};
}

}  // namespace af::evaluation
