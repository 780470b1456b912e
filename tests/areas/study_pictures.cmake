# SPDX-License-Identifier: Apache-2.0
af_add_test(
  study_pictures_test
  SOURCES unit/study_pictures/study_pictures_test.cpp
  LIBS af_study_pictures af_picture)
