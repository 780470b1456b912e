// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/signed_rank_test.h"

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "base/error.h"

namespace af::evaluation {
namespace {

constexpr std::size_t kMostExactPairs = 200;

struct SignedRanks {
  std::vector<std::size_t> doubled;  ///< twice the mean rank, a whole number even with ties
  std::size_t doubled_positive = 0;
  double tie_correction = 0.0;  ///< sum of t^3 - t over groups of t equal sizes
};

SignedRanks ranks_of(std::vector<double> differences) {
  std::sort(differences.begin(), differences.end(), [](double a, double b) {
    return std::abs(a) < std::abs(b);
  });
  SignedRanks ranks;
  for (std::size_t first = 0; first < differences.size();) {
    std::size_t end = first;
    while (end < differences.size() && std::abs(differences[end]) == std::abs(differences[first]))
      ++end;
    const auto ties = static_cast<double>(end - first);
    ranks.tie_correction += ties * ties * ties - ties;
    for (; first < end; ++first) {
      // The ranks from `end - ties` + 1 to `end` share their mean. Twice that is the sum of the
      // first and the last.
      ranks.doubled.push_back(2 * end - static_cast<std::size_t>(ties) + 1);
      if (differences[first] > 0.0) ranks.doubled_positive += ranks.doubled.back();
    }
  }
  return ranks;
}

/// P(sum of positive ranks <= the smaller tail's end), from the number of signs per sum.
double exact_p(const SignedRanks& ranks) {
  std::size_t total = 0;
  for (const std::size_t rank : ranks.doubled) total += rank;
  std::vector<double> probability(total + 1, 0.0);
  probability[0] = 1.0;
  std::size_t reached = 0;
  for (const std::size_t rank : ranks.doubled) {
    reached += rank;
    for (std::size_t sum = reached + 1; sum-- > 0;)
      probability[sum] = 0.5 * (probability[sum] + (sum >= rank ? probability[sum - rank] : 0.0));
  }
  const std::size_t tail = std::min(ranks.doubled_positive, total - ranks.doubled_positive);
  double p = 0.0;
  for (std::size_t sum = 0; sum <= tail; ++sum) p += probability[sum];
  return std::min(1.0, 2.0 * p);
}

double normal_p(const SignedRanks& ranks) {
  const auto n = static_cast<double>(ranks.doubled.size());
  const double mean = n * (n + 1) / 4;
  const double variance = n * (n + 1) * (2 * n + 1) / 24 - ranks.tie_correction / 48;
  const double distance =
      std::max(0.0, std::abs(static_cast<double>(ranks.doubled_positive) / 2 - mean) - 0.5);
  return 2.0 * cdf(complement(boost::math::normal(), distance / std::sqrt(variance)));
}

}  // namespace

SignedRankTest signed_rank_test(std::span<const double> differences) {
  std::vector<double> used;
  for (const double difference : differences) {
    if (!std::isfinite(difference))
      throw InputError("signed-rank test", std::to_string(difference), "differences are finite");
    if (difference != 0.0) used.push_back(difference);
  }
  SignedRankTest result;
  result.pairs_used = used.size();
  result.zeros = differences.size() - used.size();
  if (used.empty()) return result;
  const SignedRanks ranks = ranks_of(std::move(used));
  result.positive_ranks = static_cast<double>(ranks.doubled_positive) / 2;
  result.is_exact = result.pairs_used <= kMostExactPairs;
  result.p = result.is_exact ? exact_p(ranks) : normal_p(ranks);
  return result;
}

double mcnemar_exact_p(std::int64_t only_first, std::int64_t only_second) {
  check(only_first >= 0 && only_second >= 0, "counts of discordant pairs are not negative");
  if (only_first + only_second == 0) return 1.0;
  const boost::math::binomial split(static_cast<double>(only_first + only_second), 0.5);
  return std::min(1.0, 2.0 * cdf(split, static_cast<double>(std::min(only_first, only_second))));
}

}  // namespace af::evaluation
