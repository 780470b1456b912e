# SPDX-License-Identifier: Apache-2.0
# Run as a script (-P) at every build: writes OUTPUT, which tells a program the last commit of SOURCE that changed the
# programs, with "+" behind it where they differ from it now. Commits of pages alone leave programs as they are.
set(folders CMakeLists.txt common precompute register evaluate)
find_program(git git)
set(commit "unknown")
if(git)
  execute_process(COMMAND ${git} -C ${SOURCE} log -1 --abbrev=12 --format=%h -- ${folders}
                  OUTPUT_VARIABLE found OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  execute_process(COMMAND ${git} -C ${SOURCE} status --porcelain --untracked-files=no -- ${folders}
                  OUTPUT_VARIABLE changes ERROR_QUIET)
  if(found)
    set(commit "${found}")
  endif()
  if(found AND changes)
    string(APPEND commit "+")
  endif()
endif()
set(text "// Written by WriteCommit.cmake.\n#include \"base/build_info.h\"\nnamespace {\n[[maybe_unused]] const bool is_set = (af::set_program_commit(\"${commit}\"), true);\n}\n")
set(before "")
if(EXISTS ${OUTPUT})
  file(READ ${OUTPUT} before)
endif()
if(NOT before STREQUAL text)
  file(WRITE ${OUTPUT} "${text}")
endif()
