# SPDX-License-Identifier: Apache-2.0
af_add_test(
  spectrum_test
  SOURCES unit/spectrum/bone_volume_test.cpp unit/spectrum/polychromatic_attenuation_test.cpp
          unit/spectrum/xray_physics_test.cpp
  LIBS af_spectrum)
