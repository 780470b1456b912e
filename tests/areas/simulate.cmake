# SPDX-License-Identifier: Apache-2.0
af_add_test(
  simulation_test
  SOURCES unit/evaluate/simulate/anatomy_test.cpp
          unit/evaluate/simulate/automatic_target_test.cpp
          unit/evaluate/simulate/detector_model_test.cpp
          unit/evaluate/simulate/fiducials_test.cpp
          unit/evaluate/simulate/phantom_test.cpp
          unit/evaluate/simulate/siddon_projector_test.cpp
          unit/evaluate/simulate/solid_projector_test.cpp
          unit/evaluate/simulate/solid_test.cpp
          unit/evaluate/simulate/spine_phantom_test.cpp
          unit/evaluate/simulate/stress_test.cpp
          unit/evaluate/simulate/poisson_test.cpp
          unit/evaluate/simulate/xray_simulator_test.cpp
  LIBS af_evaluate_simulate)
af_add_test(
  af_simulate_test
  SOURCES unit/evaluate/simulate/af_simulate_test.cpp
  LIBS af_evaluate_simulate af_geometry af_study
  TIMEOUT 300)
target_compile_definitions(af_simulate_test PRIVATE AF_PROGRAM_FOLDER="${PROJECT_BINARY_DIR}/bin")
add_dependencies(af_simulate_test af-simulate)
af_add_test(
  simulated_scan_test
  SOURCES unit/evaluate/simulate/simulated_scan_test.cpp
  LIBS af_evaluate_simulate)
