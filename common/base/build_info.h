// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace af {

/// Project version, for example "0.1.0"; written into every output.
std::string_view program_version();

/// The last commit that changed the programs, followed by "+" if they were built with other
/// changes. "unknown" where a program was not built from a repository, or is not one of ours.
/// Written into every output.
std::string_view program_commit();

/// Called before main() by each program's build_commit.cpp (common/cmake/WriteCommit.cmake), so
/// that a commit only links programs again and compiles nothing. `commit` must live as long as the
/// program.
void set_program_commit(std::string_view commit);

/// Compiler and version, for example "GNU 12.2.0"; written into benchmark results.
std::string_view compiler_description();

}  // namespace af
