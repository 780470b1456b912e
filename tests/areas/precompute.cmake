# SPDX-License-Identifier: Apache-2.0
af_add_test(
  precompute_test
  SOURCES unit/precompute/planner_test.cpp unit/precompute/unit_tiles_test.cpp unit/precompute/nearest_codeword_test.cpp
          unit/precompute/field_caster_test.cpp unit/precompute/codebook_training_test.cpp
  LIBS af_precompute)
