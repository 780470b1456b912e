# SPDX-License-Identifier: Apache-2.0
# The contract's exit codes as one table: bad input in, code and message out, nothing left behind.
add_executable(make_bad_inputs programs/make_bad_inputs.cpp unit/ct/ct_test_data.cpp)
target_link_libraries(make_bad_inputs PRIVATE af_compile_options af_test_support af_register af_study ZLIB::ZLIB)
af_compile_as(quick make_bad_inputs)
add_test(NAME bad_inputs COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/programs/bad_inputs.sh ${PROJECT_BINARY_DIR}/bin
                                 $<TARGET_FILE:make_bad_inputs>)
set_tests_properties(bad_inputs PROPERTIES LABELS programs TIMEOUT 300)
