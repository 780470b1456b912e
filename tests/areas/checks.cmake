# SPDX-License-Identifier: Apache-2.0
# Checks of the tree itself. Exit code 77: skipped, because the tool is not installed.
function(af_add_check name)
  add_test(NAME checks.${name} COMMAND ${ARGN})
  set_tests_properties(checks.${name} PROPERTIES LABELS checks TIMEOUT 120 SKIP_RETURN_CODE 77)
endfunction()

set(af_checks ${CMAKE_CURRENT_SOURCE_DIR}/checks)
af_add_check(layering ${af_checks}/layering.sh ${PROJECT_SOURCE_DIR})
af_add_check(layering_self_test ${af_checks}/layering.sh --self-test)
af_add_check(format ${af_checks}/format.sh ${PROJECT_SOURCE_DIR})
af_add_check(scripts ${af_checks}/scripts.sh ${PROJECT_SOURCE_DIR})
af_add_check(stages ${af_checks}/stages.sh ${PROJECT_SOURCE_DIR})
af_add_check(tree ${af_checks}/tree.sh ${PROJECT_SOURCE_DIR})

set(af_program_files)
foreach(program af-precompute af-drr af-simulate af-scan af-register af-evaluate af-inspect)
  if(TARGET ${program})
    list(APPEND af_program_files $<TARGET_FILE:${program}>)
  endif()
endforeach()
if(af_program_files)
  af_add_check(one_hdf5 ${af_checks}/one_hdf5.sh ${af_program_files})
endif()
