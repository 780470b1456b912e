// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace af::evaluation {

/// A test of a hypothesis says nothing with fewer pairs.
inline constexpr std::size_t kLeastPairsOfATest = 10;

/// Result of Wilcoxon's signed-rank test.
struct SignedRankTest {
  std::size_t pairs_used = 0;   ///< differences other than zero
  std::size_t zeros = 0;        ///< left out of the ranking, as Wilcoxon did
  double positive_ranks = 0.0;  ///< sum of the ranks of the positive differences
  double p = 1.0;               ///< two-sided
  bool is_exact = true;         ///< p from the distribution itself, otherwise from a normal one
};

/// Wilcoxon's signed-rank test of paired differences (Biometrics Bulletin 1945): whether they lie
/// symmetrically about zero, whatever their distribution. Equal sizes share their mean rank. For up
/// to 200 differences p is exact, given these ranks (all 2^n signs equally probable). Beyond that
/// it is the normal approximation with corrections for ties and continuity. Throws InputError when
/// a difference is not finite. \test SignedRankTest.EqualsPublishedValues
SignedRankTest signed_rank_test(std::span<const double> differences);

/// Exact two-sided p of McNemar's test: the probability of a split at least as uneven as
/// (`only_first`, `only_second`) when both sides of a discordant pair are equally probable.
double mcnemar_exact_p(std::int64_t only_first, std::int64_t only_second);

}  // namespace af::evaluation
