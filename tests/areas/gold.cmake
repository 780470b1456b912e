# SPDX-License-Identifier: Apache-2.0
af_add_test(
  gold_test
  SOURCES unit/gold/fiducial_registration_test.cpp unit/gold/gold_uncertainty_test.cpp unit/gold/point_distances_test.cpp unit/gold/tre_test.cpp
  LIBS af_gold)
