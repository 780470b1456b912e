# SPDX-License-Identifier: Apache-2.0
af_add_test(picture_test SOURCES unit/figures/picture_test.cpp LIBS af_picture PkgConfig::cairo)
