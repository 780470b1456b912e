# SPDX-License-Identifier: Apache-2.0
af_add_test(study_test SOURCES unit/study/rig_file_test.cpp unit/study/study_file_test.cpp LIBS af_study)
af_add_test(xray_reader_test SOURCES unit/study/xray_reader_test.cpp unit/ct/ct_test_data.cpp LIBS af_study)

af_add_test(pose_files_test SOURCES unit/study/pose_file_test.cpp LIBS af_study)
