# SPDX-License-Identifier: Apache-2.0
af_add_test(
  run_test
  SOURCES unit/run/progress_journal_test.cpp unit/run/provenance_test.cpp
  LIBS af_run)
