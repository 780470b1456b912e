# SPDX-License-Identifier: Apache-2.0
af_add_test(drr_test SOURCES unit/drr/af_drr_test.cpp LIBS af_drr_core)
