# SPDX-License-Identifier: Apache-2.0
af_add_test(field_test SOURCES unit/field/index_coding_test.cpp LIBS af_field)
