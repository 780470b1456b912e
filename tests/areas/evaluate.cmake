# SPDX-License-Identifier: Apache-2.0
af_add_test(
  evaluate_test
  SOURCES unit/evaluate/fiducial_registration_test.cpp
  LIBS af_evaluation)
