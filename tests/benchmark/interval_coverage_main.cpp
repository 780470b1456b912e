// SPDX-License-Identifier: Apache-2.0
// Prints the tables of docs/errors.md that say how often its intervals hold the truth.
#include <cstdio>

#include <CLI/CLI.hpp>

#include "support/interval_coverage.h"

namespace {

using af::test::IntervalCoverage;
using af::test::SimulatedStudies;

void print_independent(SimulatedStudies setting) {
  std::printf("| Independent runs | Rate 0.5 | 0.8 | 0.93 | 0.99 |\n|---|---|---|---|---|\n");
  setting.cases = 1;
  setting.half_spread = 0.0;
  for (const int starts : {30, 96, 240, 960}) {
    setting.starts_per_case = starts;
    std::printf("| %d", starts);
    for (const double rate : {0.5, 0.8, 0.93, 0.99}) {
      setting.mean_rate = rate;
      std::printf(" | %.1f %%", 100 * interval_coverage(setting).wilson_rate);
    }
    std::printf(" |\n");
  }
}

void print_cases(SimulatedStudies setting) {
  std::printf(
      "| Cases | Patients | Rate: Wilson over all starts | bootstrap over cases | Student over "
      "cases "
      "| Mean TRE: bootstrap over cases | Student over cases |\n|---|---|---|---|---|---|---|\n");
  for (const double half_spread : {0.2, 0.05, 0.0})
    for (const std::size_t cases : {4u, 10u, 30u}) {
      setting.cases = cases;
      setting.half_spread = half_spread;
      const IntervalCoverage found = interval_coverage(setting);
      std::printf("| %zu | 80 +- %.0f %% | %.1f %% | %.1f %% | %.1f %% | %.1f %% | %.1f %% |\n",
                  cases,
                  100 * half_spread,
                  100 * found.wilson_rate,
                  100 * found.bootstrap_rate,
                  100 * found.student_rate,
                  100 * found.bootstrap_tre,
                  100 * found.student_tre);
    }
}

void print_rare_failures(const SimulatedStudies& setting) {
  std::printf(
      "| Cases | Hard patients | Rate: bootstrap over cases | Student over cases | Patients that "
      "lost a start: Wilson |\n|---|---|---|---|---|\n");
  for (const std::size_t cases : {28u, 60u})
    for (const int one_in : {200, 90, 30, 10}) {
      const af::test::RareFailureCoverage found =
          af::test::rare_failure_coverage({.cases = cases,
                                           .hard_share = 1.0 / one_in,
                                           .studies = setting.studies,
                                           .seed = setting.seed,
                                           .replicates = setting.replicates});
      std::printf("| %zu | one in %d | %.1f %% | %.1f %% | %.1f %% |\n",
                  cases,
                  one_in,
                  100 * found.bootstrap_rate,
                  100 * found.student_rate,
                  100 * found.wilson_patients);
    }
}

void print_equivalence(const SimulatedStudies& setting) {
  std::printf("| Patients | SD of the logarithm 0.2 | 0.4 | 0.6 | 0.8 |\n|---|---|---|---|---|\n");
  for (const std::size_t cases : {10u, 20u, 30u, 60u}) {
    std::printf("| %zu", cases);
    for (const double log_sd : {0.2, 0.4, 0.6, 0.8})
      std::printf(" | %.1f %%",
                  100 * af::test::wrong_equivalence_claims({.cases = cases,
                                                            .log_sd = log_sd,
                                                            .studies = setting.studies,
                                                            .seed = setting.seed,
                                                            .replicates = setting.replicates}));
    std::printf(" |\n");
  }
}

}  // namespace

// Only a defect in the declaration of options can throw here, and it may end the program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  SimulatedStudies setting;
  CLI::App app{
      "Coverage of 95 % intervals in simulated studies with known truth, as tables in Markdown: "
      "Wilson's of independent runs; Wilson's, the bootstrap's and Student's where patients "
      "differ, and where few patients lose any start; and how often equivalence is claimed "
      "wrongly."};
  app.add_option("--studies", setting.studies, "Simulated studies of each setting")
      ->capture_default_str();
  app.add_option("--replicates", setting.replicates, "Of the bootstrap")->capture_default_str();
  app.add_option("--starts-per-case", setting.starts_per_case, "Where patients differ")
      ->capture_default_str();
  app.add_option("--seed", setting.seed, "Of everything random")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  print_independent(setting);
  std::printf("\n");
  print_cases(setting);
  std::printf("\n");
  print_rare_failures(setting);
  std::printf("\n");
  print_equivalence(setting);
  return 0;
}
