# SPDX-License-Identifier: Apache-2.0
af_add_test(
  simulation_test
  SOURCES unit/simulation/anatomy_test.cpp
          unit/simulation/automatic_target_test.cpp
          unit/simulation/detector_model_test.cpp
          unit/simulation/fiducials_test.cpp
          unit/simulation/phantom_test.cpp
          unit/simulation/siddon_projector_test.cpp
          unit/simulation/solid_projector_test.cpp
          unit/simulation/solid_test.cpp
          unit/simulation/spine_phantom_test.cpp
          unit/simulation/stress_test.cpp
          unit/simulation/poisson_test.cpp
          unit/simulation/xray_simulator_test.cpp
  LIBS af_simulation)
af_add_test(
  af_simulate_test
  SOURCES unit/simulation/af_simulate_test.cpp
  LIBS af_simulation af_gold_standard af_study_contents
  TIMEOUT 300)
target_compile_definitions(af_simulate_test PRIVATE AF_PROGRAM_FOLDER="${PROJECT_BINARY_DIR}/bin")
add_dependencies(af_simulate_test af-simulate)
af_add_test(
  simulated_scan_test
  SOURCES unit/simulation/simulated_scan_test.cpp
  LIBS af_simulated_study)
