# SPDX-License-Identifier: Apache-2.0
af_add_test(image_test SOURCES unit/image/image_test.cpp unit/image/bilinear_test.cpp unit/image/xray_borders_test.cpp LIBS af_image)
