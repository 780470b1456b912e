# SPDX-License-Identifier: Apache-2.0
af_add_test(
  scan_test
  SOURCES unit/scan/simulated_scan.cpp
          unit/scan/fdk_test.cpp
          unit/scan/line_integrals_test.cpp
          unit/scan/scan_geometry_test.cpp
          unit/scan/self_calibration_test.cpp
  LIBS af_scan)
