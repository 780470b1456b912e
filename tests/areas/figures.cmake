# SPDX-License-Identifier: Apache-2.0
af_add_test(picture_test SOURCES unit/figures/picture_test.cpp LIBS af_figures PkgConfig::cairo)

af_add_test(study_pictures_test SOURCES unit/figures/study_pictures_test.cpp LIBS af_figures)
