// SPDX-License-Identifier: Apache-2.0
// Stands for mpi_environment.cpp in a build without MPI (AF_MPI=OFF).
#include "ranks/mpi_environment.h"

namespace af {

MpiEnvironment::MpiEnvironment(int& /*argc*/, char**& /*argv*/) {}

MpiEnvironment::~MpiEnvironment() = default;

void MpiEnvironment::require_threads() const {}

std::string mpi_version() {
  return "no MPI";
}

}  // namespace af
