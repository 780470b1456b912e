# SPDX-License-Identifier: Apache-2.0
# One Debian package per component: cmake --build build/release --target package. After all that is installed.
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

# mpirun is how the programs share work; af-convert and af-report are Python, as is a script of jobs/.
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME attenuation-fields)
set(af_launcher_package "")
if(AF_MPI)
  string(REPLACE openmpi openmpi-bin af_launcher_package "${af_mpi_name}, ") # mpich is a package, too
endif()
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_DEPENDS "${af_launcher_package}python3, python3-h5py, python3-jinja2, python3-matplotlib, python3-numpy, python3-pydicom, python3-yaml")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SUGGESTS invesalius-examples)
set(CPACK_COMPONENT_PROGRAMS_DESCRIPTION "The programs af-precompute, af-drr, af-simulate, af-register, af-evaluate,
af-inspect and af-scan make compressed attenuation fields from CTs, look
digitally reconstructed radiographs up in them, find the pose of a CT from
calibrated X-rays, make studies of scans and of simulated X-rays, and measure
how well that works. Research software: not a medical device.")

# af_add_package(<component> <package> <section> <what it is> [DEPENDS ...]): a package of the library or of what is built on
# it, with a copyright and a changelog of its own.
function(af_add_package component package section text)
  cmake_parse_arguments(arg "" "" "DEPENDS" ${ARGN})
  string(TOUPPER ${component} upper)
  list(JOIN arg_DEPENDS ", " depends)
  install(FILES ${PROJECT_SOURCE_DIR}/packaging/copyright DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/${package}
          COMPONENT ${component})
  af_install_changelog(${package} ${component})
  set(CPACK_COMPONENTS_ALL ${CPACK_COMPONENTS_ALL} ${component} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${package} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_PACKAGE_DEPENDS "${depends}" PARENT_SCOPE)
  set(CPACK_COMPONENT_${upper}_DESCRIPTION "${text}" PARENT_SCOPE)
endfunction()
if(TARGET attenuation_fields)
  set(af_same_version "= ${PROJECT_VERSION}")
  set(af_library_package libattenuation-fields${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  # The other packages find the library in the build tree, and name its package by hand.
  set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR}/lib)
  set(CPACK_DEBIAN_LIBRARY_PACKAGE_GENERATE_SHLIBS ON) # and ldconfig when it is installed
  af_add_package(library ${af_library_package} libs "The shared library of attenuation fields: DRRs looked up or cast,
their derivatives, registration, measures.")
  af_add_package(
    development libattenuation-fields-dev libdevel "Headers and CMake package of the library of attenuation fields:
find_package(AttenuationFields)." DEPENDS "${af_library_package} (${af_same_version})")
endif()
if(TARGET attenuation_fields_python)
  af_add_package(
    python python3-attenuation-fields python "The Python module attenuation_fields: DRRs and their derivatives as NumPy
arrays, registration, results."
    DEPENDS "python3 (>= ${Python_VERSION_MAJOR}.${Python_VERSION_MINOR})" "python3 (<< ${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}.99)" python3-numpy "${af_library_package} (${af_same_version})")
endif()
include(CPack)
