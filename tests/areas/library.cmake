# SPDX-License-Identifier: Apache-2.0
# Compares the shared library and the Python module with what the programs make of a small study.
set(af_library_study ${CMAKE_CURRENT_BINARY_DIR}/library_study)
add_executable(make_library_study library/make_library_study.cpp)
target_link_libraries(make_library_study PRIVATE af_compile_options af_test_support af_register)
af_compile_as(tests make_library_study)
add_dependencies(make_library_study af-drr af-precompute af-register)
add_test(NAME library_study COMMAND make_library_study ${af_library_study} ${PROJECT_BINARY_DIR}/bin)
set_tests_properties(library_study PROPERTIES LABELS programs TIMEOUT 300 FIXTURES_SETUP library_study)

add_executable(library_test library/library_test.cpp)
target_link_libraries(library_test PRIVATE af_compile_options attenuation_fields nlohmann_json::nlohmann_json GTest::gtest
                                           GTest::gmock GTest::gtest_main)
target_include_directories(library_test PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
target_compile_definitions(library_test PRIVATE AF_LIBRARY_STUDY="${af_library_study}")
af_compile_as(tests library_test)
add_test(NAME library_test COMMAND library_test)
set_tests_properties(library_test PROPERTIES LABELS programs TIMEOUT 300 FIXTURES_REQUIRED library_study)

# A program without sanitizers cannot load a library with them.
if(NOT AF_SANITIZE)
  add_test(NAME library_installed_example COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/library/installed_example.sh ${CMAKE_COMMAND}
                                                  ${CMAKE_CXX_COMPILER} ${PROJECT_BINARY_DIR} ${af_library_study})
  set_tests_properties(library_installed_example PROPERTIES LABELS programs TIMEOUT 300 FIXTURES_REQUIRED library_study)
endif()

# af_add_python_test(<name> <script> [ARGUMENTS...]): a script that imports the module from the build. Exit code 77: skipped.
function(af_add_python_test name script)
  add_test(NAME python.${name} COMMAND ${AF_PYTHON_EXECUTABLE} -B ${script} ${ARGN})
  set_tests_properties(
    python.${name}
    PROPERTIES LABELS programs TIMEOUT 300 FIXTURES_REQUIRED library_study SKIP_RETURN_CODE 77 ENVIRONMENT
               "PYTHONPATH=${PROJECT_BINARY_DIR}/python;AF_LIBRARY_STUDY=${af_library_study};AF_PROGRAMS=${PROJECT_BINARY_DIR}/bin")
endfunction()
if(AF_BUILD_PYTHON)
  af_add_python_test(module ${CMAKE_CURRENT_SOURCE_DIR}/python/test_module.py)
  af_add_python_test(processes ${CMAKE_CURRENT_SOURCE_DIR}/python/test_processes.py)
  af_add_python_test(torch ${CMAKE_CURRENT_SOURCE_DIR}/python/test_torch.py)
  af_add_python_test(field_format ${CMAKE_CURRENT_SOURCE_DIR}/python/test_field_format.py
                     ${PROJECT_SOURCE_DIR}/docs/reference/field-format.md)
  foreach(example 01_register 02_look_up 03_starts 04_success 05_patients decode_viewpoint register_with_torch)
    af_add_python_test(example_${example} ${CMAKE_CURRENT_SOURCE_DIR}/python/test_examples.py ${PROJECT_SOURCE_DIR}/examples
                       ${example})
  endforeach()
  add_test(NAME python.wheel COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/python/test_wheel.sh ${CMAKE_COMMAND} ${PROJECT_BINARY_DIR}
                                     ${AF_PYTHON_EXECUTABLE} ${af_library_study})
  set_tests_properties(python.wheel PROPERTIES LABELS programs TIMEOUT 300 FIXTURES_REQUIRED library_study SKIP_RETURN_CODE 77)
endif()
