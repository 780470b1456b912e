# SPDX-License-Identifier: Apache-2.0
# The commands of our pages: one CTest entry per page that has some (tests/pages/page_commands.py).
set(af_page_commands ${CMAKE_CURRENT_SOURCE_DIR}/pages/page_commands.py)
add_test(NAME checks.pages COMMAND ${af_page_commands} --check ${PROJECT_SOURCE_DIR})
set_tests_properties(checks.pages PROPERTIES LABELS checks TIMEOUT 60)
set(af_page_data ${CMAKE_CURRENT_BINARY_DIR}/page_data)
add_test(NAME Pages.small_data COMMAND ${af_page_commands} --data ${af_page_data} ${PROJECT_BINARY_DIR}/bin)
set_tests_properties(Pages.small_data PROPERTIES LABELS programs TIMEOUT 120 FIXTURES_SETUP page_data)
file(GLOB af_pages CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/*.md ${PROJECT_SOURCE_DIR}/*/*.md
     ${PROJECT_SOURCE_DIR}/*/*/*.md)
list(FILTER af_pages EXCLUDE REGEX "^build/")
foreach(page ${af_pages})
  file(STRINGS ${PROJECT_SOURCE_DIR}/${page} af_blocks REGEX "^```sh$")
  if(af_blocks)
    string(REGEX REPLACE "[/.]" "_" name ${page})
    add_test(NAME Pages.${name} COMMAND ${af_page_commands} --run ${PROJECT_SOURCE_DIR}/${page} ${PROJECT_BINARY_DIR}/bin
                                        ${af_page_data})
    set_tests_properties(Pages.${name} PROPERTIES LABELS programs TIMEOUT 300 FIXTURES_REQUIRED page_data)
  endif()
  # A page may get its first command, or lose its last, so a change of a page configures anew.
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${page})
endforeach()
