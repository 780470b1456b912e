# SPDX-License-Identifier: Apache-2.0
# What is installed beside the programs, and the Debian package that holds it: cmake --build build/release --target package.
# What names no component of its own is of the component "programs", which is the package attenuation-fields.
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME programs)
# Debian looks for copyright and changelog in a folder of the package's name.
set(CMAKE_INSTALL_DOCDIR ${CMAKE_INSTALL_DATAROOTDIR}/doc/attenuation-fields)
set(AF_PACKAGE_CONTACT "The authors of attenuation_fields <nobody@localhost>" CACHE STRING "Maintainer of the package")
set(af_programs af-precompute af-drr af-simulate af-register af-evaluate af-inspect)

# Manual pages and completions are asked of the programs when they are installed, so that they cannot differ from them.
# The file's destination is relative to the prefix, and DESTDIR stands before it, as with everything that is installed.
function(af_install_help program format destination)
  install(
    CODE "
      set(file \"${CMAKE_CURRENT_BINARY_DIR}/help/${destination}\")
      get_filename_component(folder \"\${file}\" DIRECTORY)
      file(MAKE_DIRECTORY \"\${folder}\")
      execute_process(COMMAND \"$<TARGET_FILE:${program}>\" --help-as ${format} OUTPUT_FILE \"\${file}\"
                      COMMAND_ERROR_IS_FATAL ANY)
      if(\"${format}\" STREQUAL man)
        execute_process(COMMAND gzip -9nf \"\${file}\" COMMAND_ERROR_IS_FATAL ANY)
        string(APPEND file .gz)
      endif()
      get_filename_component(folder \"${destination}\" DIRECTORY)
      file(INSTALL \"\${file}\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/\${folder}\")")
endfunction()
foreach(program ${af_programs})
  af_install_help(${program} man ${CMAKE_INSTALL_MANDIR}/man1/${program}.1)
  af_install_help(${program} bash ${CMAKE_INSTALL_DATADIR}/bash-completion/completions/${program})
  af_install_help(${program} zsh ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions/_${program})
endforeach()

# A folder for Slicer, which starts every program of the folders that it searches for modules.
foreach(program af-drr af-register)
  install(PROGRAMS packaging/slicer/run-outside-slicer DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/attenuation-fields/slicer
          RENAME ${program})
endforeach()

install(FILES packaging/copyright DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(FILES packaging/lintian-overrides DESTINATION ${CMAKE_INSTALL_DATADIR}/lintian/overrides RENAME attenuation-fields)
install(CODE "
  set(log \"${CMAKE_CURRENT_BINARY_DIR}/changelog\")
  file(WRITE \"\${log}\" \"attenuation-fields (${PROJECT_VERSION}) bookworm; urgency=medium\\n\\n  * Built from source by CPack.\\n\\n -- ${AF_PACKAGE_CONTACT}  Thu, 01 Jan 1970 00:00:00 +0000\\n\")
  execute_process(COMMAND gzip -9nf \"\${log}\" COMMAND_ERROR_IS_FATAL ANY)
  file(INSTALL \"\${log}.gz\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DOCDIR}\")")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME attenuation-fields)
set(CPACK_PACKAGE_CONTACT "${AF_PACKAGE_CONTACT}")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "2D-3D registration of CTs and X-rays with attenuation fields")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL programs)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
                                                WORLD_EXECUTE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME attenuation-fields)
# mpirun is how the programs share work; gnuplot draws the figures of reports.
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_DEPENDS "openmpi-bin")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_RECOMMENDS "gnuplot-nox")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SUGGESTS "invesalius-examples")
set(CPACK_COMPONENT_PROGRAMS_DESCRIPTION "The programs af-precompute, af-drr, af-simulate, af-register, af-evaluate
and af-inspect make compressed attenuation fields from CTs, look digitally
reconstructed radiographs up in them, find the pose of a CT from calibrated
X-rays, and measure how well that works. Research software: not a medical
device.")
include(CPack)
