# SPDX-License-Identifier: Apache-2.0
af_add_test(
  gold_test
  SOURCES unit/gold_standard/fiducial_registration_test.cpp unit/gold_standard/gold_uncertainty_test.cpp unit/gold_standard/landmark_pose_test.cpp unit/gold_standard/point_distances_test.cpp unit/gold_standard/tre_test.cpp
  LIBS af_gold_standard)
