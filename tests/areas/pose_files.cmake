# SPDX-License-Identifier: Apache-2.0
af_add_test(
  pose_files_test
  SOURCES unit/pose_files/pose_file_test.cpp
  LIBS af_pose_files)
