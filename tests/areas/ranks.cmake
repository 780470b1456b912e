# SPDX-License-Identifier: Apache-2.0
af_add_mpi_test(parallel_test SOURCES mpi/communicator_test.cpp mpi/root_only_test.cpp mpi/work_queue_test.cpp
                              mpi/work_watch_test.cpp RANKS 1 2 3 4)
# The stall watch cannot tell a stall from a busy machine, so CTest runs its tests with as little else as it can.
foreach(ranks 2 3 4)
  set_tests_properties(parallel_test.ranks_${ranks} PROPERTIES PROCESSORS ${ranks})
endforeach()
# These are programs of their own, because their last tests ask for a stop, which cannot be taken back.
af_add_mpi_test(run_folder_test SOURCES mpi/run_folder_test.cpp LIBS af_ranks RANKS 1 2 4)
af_add_mpi_test(resumable_items_test SOURCES mpi/resumable_items_test.cpp LIBS af_ranks RANKS 1 2 3 4)
af_add_mpi_test(shared_inputs_test SOURCES mpi/shared_inputs_test.cpp LIBS af_study RANKS 1 2 3 4)

af_add_test(run_test SOURCES unit/ranks/alone_test.cpp unit/ranks/progress_journal_test.cpp unit/ranks/provenance_test.cpp
            LIBS af_ranks)
if(AF_MPI)
  target_sources(run_test PRIVATE unit/ranks/mpi_environment_test.cpp)
endif()
