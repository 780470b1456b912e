# SPDX-License-Identifier: Apache-2.0
af_add_test(
  slab_sizing_test
  SOURCES unit/geometry/slab_sizing_test.cpp unit/geometry/ray_coverage_test.cpp unit/geometry/source_region_test.cpp
  LIBS af_geometry)
af_add_test(
  geometry_test
  SOURCES unit/geometry/camera_geometry_test.cpp unit/geometry/field_lattice_test.cpp
          unit/geometry/lens_distortion_test.cpp unit/geometry/pinhole_camera_test.cpp
          unit/geometry/rigid_transform_test.cpp
  LIBS af_geometry)

af_add_test(
  gold_test
  SOURCES unit/geometry/fiducial_registration_test.cpp unit/geometry/gold_uncertainty_test.cpp
          unit/geometry/landmark_pose_test.cpp unit/geometry/point_distances_test.cpp unit/geometry/tre_test.cpp
  LIBS af_geometry)
