# SPDX-License-Identifier: Apache-2.0
af_add_test(
  pose_files_test
  SOURCES unit/pose_files/pose_file_test.cpp unit/pose_files/other_poses_test.cpp unit/pose_files/poses_page_test.cpp
  LIBS af_pose_files)
target_compile_definitions(pose_files_test PRIVATE AF_POSES_PAGE="${PROJECT_SOURCE_DIR}/docs/poses.md")

# Against pydicom, h5py and scipy, where Debian's packages are installed.
add_test(NAME pose_peers COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/programs/pose_peers.py $<TARGET_FILE:af-inspect>)
set_tests_properties(pose_peers PROPERTIES LABELS programs SKIP_RETURN_CODE 77 ENVIRONMENT
                     "OMPI_ALLOW_RUN_AS_ROOT=1;OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1")
