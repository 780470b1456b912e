# SPDX-License-Identifier: Apache-2.0
# What is installed beside the programs. What names no component of its own is of the component "programs".
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME programs)
# Debian looks for copyright and changelog in a folder of the package's name.
set(CMAKE_INSTALL_DOCDIR ${CMAKE_INSTALL_DATAROOTDIR}/doc/attenuation-fields)
set(AF_PACKAGE_CONTACT "The authors of attenuation_fields <nobody@localhost>" CACHE STRING "Maintainer of the package")
set(af_programs af-precompute af-drr af-simulate af-scan af-register af-evaluate af-inspect)

# Manual pages and completions are asked of the programs when they are installed, so that they cannot differ from them.
# The file's destination is relative to the prefix, and DESTDIR stands before it, as with everything that is installed.
function(af_install_help command format destination)
  install(
    CODE "
      set(file \"${CMAKE_CURRENT_BINARY_DIR}/help/${destination}\")
      get_filename_component(folder \"\${file}\" DIRECTORY)
      file(MAKE_DIRECTORY \"\${folder}\")
      execute_process(COMMAND \"${command}\" --help-as ${format} OUTPUT_FILE \"\${file}\"
                      COMMAND_ERROR_IS_FATAL ANY)
      if(\"${format}\" STREQUAL man)
        execute_process(COMMAND gzip -9nf \"\${file}\" COMMAND_ERROR_IS_FATAL ANY)
        string(APPEND file .gz)
      endif()
      get_filename_component(folder \"${destination}\" DIRECTORY)
      file(INSTALL \"\${file}\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/\${folder}\")")
endfunction()
function(af_install_helps program command)
  af_install_help(${command} man ${CMAKE_INSTALL_MANDIR}/man1/${program}.1)
  af_install_help(${command} bash ${CMAKE_INSTALL_DATADIR}/bash-completion/completions/${program})
  af_install_help(${command} zsh ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions/_${program})
endfunction()
foreach(program ${af_programs})
  af_install_helps(${program} $<TARGET_FILE:${program}>)
endforeach()

# Programs in Python: python/NAME and a folder of its modules. In the build tree they stand beside the other programs, too.
function(af_add_python_program program modules)
  file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
  file(CREATE_LINK ${PROJECT_SOURCE_DIR}/python/${program} ${PROJECT_BINARY_DIR}/bin/${program} SYMBOLIC)
  install(PROGRAMS python/${program} DESTINATION ${CMAKE_INSTALL_BINDIR})
  install(DIRECTORY python/${modules} python/af_programs DESTINATION ${CMAKE_INSTALL_DATADIR}/attenuation-fields
          PATTERN "__pycache__" EXCLUDE)
  af_install_helps(${program} ${PROJECT_SOURCE_DIR}/python/${program})
endfunction()
af_add_python_program(af-convert af_convert)
af_add_python_program(af-report af_report)

# A folder for Slicer, which starts every program of the folders that it searches for modules.
foreach(program af-drr af-register)
  install(PROGRAMS packaging/slicer/run-outside-slicer DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/attenuation-fields/slicer
          RENAME ${program})
endforeach()

install(FILES packaging/copyright DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(FILES packaging/lintian-overrides DESTINATION ${CMAKE_INSTALL_DATADIR}/lintian/overrides RENAME attenuation-fields)
# Empty where there is no /etc/os-release.
cmake_host_system_information(RESULT af_release_name QUERY DISTRIB_VERSION_CODENAME)
# af_install_changelog(<package> <component>): what Debian wants of a package beside its copyright.
function(af_install_changelog package component)
  install(
    CODE "
      set(log \"${CMAKE_CURRENT_BINARY_DIR}/help/${package}/changelog\")
      file(WRITE \"\${log}\" \"${package} (${PROJECT_VERSION}) ${af_release_name}; urgency=medium\\n\\n  * Built from source by CPack.\\n\\n -- ${AF_PACKAGE_CONTACT}  Thu, 01 Jan 1970 00:00:00 +0000\\n\")
      execute_process(COMMAND gzip -9nf \"\${log}\" COMMAND_ERROR_IS_FATAL ANY)
      file(INSTALL \"\${log}.gz\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATAROOTDIR}/doc/${package}\")"
    COMPONENT ${component})
endfunction()
af_install_changelog(attenuation-fields programs)
