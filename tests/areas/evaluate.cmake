# SPDX-License-Identifier: Apache-2.0
af_add_test(
  evaluate_test
  SOURCES unit/evaluate/fiducial_registration_test.cpp
          unit/evaluate/tre_test.cpp
          unit/evaluate/perturbed_starts_test.cpp
          unit/evaluate/success_rate_test.cpp
          unit/evaluate/statistics_test.cpp
          unit/evaluate/drr_comparison_test.cpp
  LIBS af_evaluation)

af_add_test(
  evaluate_figures_test
  SOURCES unit/evaluate/figure_files_test.cpp
  LIBS af_evaluation_figures af_io_figure af_io_basics)
