# SPDX-License-Identifier: Apache-2.0
af_add_test(
  camera_files_test
  SOURCES unit/camera_files/camera_formats_test.cpp unit/camera_files/camera_conventions_test.cpp
          unit/camera_files/stated_rig_test.cpp
  LIBS af_camera_files af_hdf5_files af_study)
af_add_test(
  hdf5_files_test
  SOURCES unit/hdf5_files/hdf5_input_test.cpp
  LIBS af_hdf5_files PkgConfig::hdf5_openmpi)
