# SPDX-License-Identifier: Apache-2.0
# Every third party is found here, once. None is put on a global include path: a target that does not name MPI, HDF5 or
# ITK cannot include their headers.

find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
if(AF_MPI STREQUAL "mpich")
  set(af_mpi_name mpich)
elseif(AF_MPI MATCHES "^(ON|TRUE|1)$")
  set(af_mpi_name openmpi)
elseif(AF_MPI)
  message(FATAL_ERROR "AF_MPI = ${AF_MPI}: must be ON (Open MPI), mpich or OFF")
endif()
if(AF_MPI)
  # Debian's names, by which several MPIs can be installed.
  find_program(AF_MPI_COMPILER mpicc.${af_mpi_name})
  mark_as_advanced(AF_MPI_COMPILER)
  if(AF_MPI_COMPILER)
    set(MPI_EXECUTABLE_SUFFIX .${af_mpi_name})
  endif()
  find_package(MPI REQUIRED COMPONENTS C)
  # The C interface only: mpi.h would otherwise pull in the removed C++ bindings and their library.
  set_property(TARGET MPI::MPI_C APPEND PROPERTY INTERFACE_COMPILE_DEFINITIONS OMPI_SKIP_MPICXX MPICH_SKIP_MPICXX)
else()
  add_library(MPI::MPI_C INTERFACE IMPORTED) # of nothing
endif()
if(AF_BUILD_TESTS AND NOT AF_BUILD_FUZZERS)
  find_package(GTest REQUIRED)
endif()
find_package(Boost 1.74 REQUIRED) # Boost.Math, headers only
find_package(OpenSSL REQUIRED COMPONENTS Crypto)
find_package(PkgConfig REQUIRED)
find_package(ZLIB REQUIRED)
find_package(PNG 1.6 REQUIRED)
find_package(TIFF 4.5 REQUIRED)
pkg_check_modules(tomlplusplus REQUIRED IMPORTED_TARGET tomlplusplus)
pkg_check_modules(nlopt REQUIRED IMPORTED_TARGET nlopt)
pkg_check_modules(cairo REQUIRED IMPORTED_TARGET cairo)

# HDF5 strictly by its own pkg-config file, so that ITK's serial HDF5 can never take the parallel one's place.
if(AF_MPI)
  pkg_check_modules(hdf5 REQUIRED IMPORTED_TARGET hdf5-${af_mpi_name})
else()
  pkg_check_modules(hdf5 REQUIRED IMPORTED_TARGET hdf5-serial)
endif()

# ITK's package file walks all its modules even when components are named; these three would fetch serial HDF5 and other
# libraries into global variables. The names are ITK's own include guards (ITK internals, tried with 5.2 and 5.3).
set(ITKHDF5_LOADED 1)
set(ITKDCMTK_LOADED 1)
set(ITKMINC_LOADED 1)
find_package(
  ITK 5.2 REQUIRED
  COMPONENTS ITKCommon
             ITKIOImageBase
             ITKImageIntensity
             ITKImageGrid
             ITKIOGDCM
             ITKIONIFTI
             ITKIONRRD
             ITKIOMeta
             ITKIOPNG
             ITKIOTIFF
             ITKIOTransformInsightLegacy)

# For AF_BUILD_PYTHON. pybind11's package file fails where Python is not found, so that is looked for first.
set(Python_EXECUTABLE ${AF_PYTHON_EXECUTABLE})
find_package(Python 3.9 QUIET COMPONENTS Interpreter Development.Module NumPy OPTIONAL_COMPONENTS Development.Embed)
if(Python_FOUND)
  set(PYBIND11_FINDPYTHON ON)
  find_package(pybind11 2.10 QUIET)
endif()
