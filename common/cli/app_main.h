// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <set>
#include <string>

#include "cli/app_forward.h"
#include "ranks/communicator.h"

namespace af::cli {

/// The skeleton of every program. It parses the command line (on every rank; only rank 0 prints
/// help and usage errors), starts MPI where a launcher started the process (ranks/launcher.h), or
/// the processes that the user asks for (ranks/process_group.h), runs `run`, and turns every
/// exception into one message and the exit code of ExitCode. When only one rank fails inside MPI,
/// the whole job is ended.
///
///     int main(int argc, char** argv) {
///       Options options;
///       CLI::App app{"what the program does"};
///       bind_options(app, options);
///       return af::cli::app_main(app, argc, argv, [&](const Communicator& world) { return
///       run(options, world); });
///     }
///
/// `run` returns normally for exit code 0.
int app_main(CLI::App& app,
             int argc,
             char** argv,
             const std::function<void(const Communicator&)>& run);

/// The command line as typed, quoted for a shell. It goes into every output and reproduce.sh.
std::string command_line(int argc, char** argv);

/// The options given to a parsed (sub)command, except `left_out`, as words for a shell: " --seed 3
/// --field A=a.h5". \test GivenOptions.AreThoseTypedButTheOnesLeftOut
std::string given_options(const CLI::App& command, const std::set<std::string>& left_out);

}  // namespace af::cli
