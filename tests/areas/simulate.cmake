# SPDX-License-Identifier: Apache-2.0
af_add_test(
  simulation_test
  SOURCES unit/evaluate/simulate/anatomy_test.cpp unit/evaluate/simulate/automatic_target_test.cpp
          unit/evaluate/simulate/detector_model_test.cpp unit/evaluate/simulate/fiducials_test.cpp
          unit/evaluate/simulate/moved_bone_test.cpp unit/evaluate/simulate/phantom_test.cpp unit/evaluate/simulate/siddon_projector_test.cpp
          unit/evaluate/simulate/solid_projector_test.cpp unit/evaluate/simulate/solid_test.cpp
          unit/evaluate/simulate/spine_phantom_test.cpp unit/evaluate/simulate/stress_test.cpp
          unit/evaluate/simulate/poisson_test.cpp unit/evaluate/simulate/xray_simulator_test.cpp
  LIBS af_evaluate_simulate)
af_add_program_tests(
  simulate_program_tests EACH_TEST
  SOURCES programs/simulate_program_test.cpp
  LIBS af_evaluate_simulate af_geometry af_study
  PROGRAMS af-simulate
  TIMEOUT 300)
af_add_test(simulated_scan_test SOURCES unit/evaluate/simulate/simulated_scan_test.cpp LIBS af_evaluate_simulate)
