# SPDX-License-Identifier: Apache-2.0
af_add_mpi_test(parallel_test SOURCES mpi/communicator_test.cpp mpi/work_queue_test.cpp mpi/work_watch_test.cpp RANKS 1 2 3 4)
