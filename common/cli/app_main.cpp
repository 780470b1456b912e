// SPDX-License-Identifier: Apache-2.0
#include "cli/app_main.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <optional>
#include <sstream>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/build_info.h"
#include "base/error.h"
#include "base/host_name.h"
#include "cli/command_help.h"
#include "cli/help_pages.h"
#include "cli/option_values.h"
#include "cli/shell_completion.h"
#include "cli/slicer_module.h"
#include "cli/usage_message.h"
#include "files/output_lock.h"
#include "files/shell_words.h"
#include "ranks/job_end.h"
#include "ranks/launcher.h"
#include "ranks/mpi_environment.h"
#include "ranks/process_group.h"
#include "ranks/stop_request.h"
#include "ranks/work_watch.h"

namespace af::cli {

namespace {

std::string program_name(const std::string& path) {
  return path.substr(path.find_last_of('/') + 1);
}

std::string help_as(const CLI::App& app, const std::string& format) {
  const CommandHelp help = command_help(app);
  if (format == "markdown") return markdown_page(help);
  if (format == "man") return man_page(help, std::string(program_version()));
  return format == "bash" ? bash_completion(help) : zsh_completion(help);
}

/// Adds --help for other readers than people at a terminal.
void add_help_formats(CLI::App& app) {
  app.add_option_function<std::string>(
         "--help-as",
         // CLI11 prints the text of this "error" and ends the line, on one rank, with exit code 0.
         [&app](const std::string& format) {
           const std::string text = help_as(app, format);
           throw CLI::CallForVersion(text.substr(0, text.find_last_not_of('\n') + 1), 0);
         },
         "Print this help as Markdown, a manual page or a shell completion, and exit")
      ->check(CLI::IsMember({"markdown", "man", "bash", "zsh"}))
      ->trigger_on_parse();
}

/// Adds an option that every command has.
void add_no_lock(CLI::App& app) {
  app.add_flag_callback(
      "--no-lock",
      write_without_locks,
      "Neither take nor heed locks of outputs (OUTPUT.lock), for file systems that have none");
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; }))
    if (!command->get_name().empty()) add_no_lock(*command);
}

/// The arguments in reverse order, as CLI11 takes them.
std::vector<std::string> arguments_for(const CLI::App& app, int argc, char** argv) {
  std::vector<std::string> arguments;
  for (int i = argc - 1; i > 0; --i) arguments.push_back(with_dashes(app, argv[i]));
  return arguments;
}

/// Results that could not be written to standard output are a failure: a full disk must not look
/// like a success.
int with_output_written(const CLI::App& app, int exit_code) {
  errno = 0;
  if (std::cout.flush()) return exit_code;
  const std::string reason = errno == 0 ? "" : ": " + std::generic_category().message(errno);
  std::cerr << app.get_name() << ": standard output: cannot be written" << reason << std::endl;
  return exit_code == static_cast<int>(ExitCode::Done) ? static_cast<int>(ExitCode::File)
                                                       : exit_code;
}

/// Help and version need no MPI.
bool asks_for_help(const CLI::ParseError& error) {
  return error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success);
}

int print_help(const CLI::App& app, const CLI::ParseError& error) {
  if (is_first_process()) app.exit(error, std::cout, std::cerr);
  return with_output_written(app, static_cast<int>(ExitCode::Done));
}

int refuse_usage(const CLI::App& app, const CLI::ParseError& error, const Communicator& world) {
  if (world.is_root())
    std::cerr << app.get_name() << ": " << usage_message(app, error)
              << "\nRun with --help for more information.\n";
  return static_cast<int>(ExitCode::Usage);
}

/// What asked for the stop.
std::string reason_text(const RankFailure& failure) {
  const bool is_stop = failure.exit_code == static_cast<int>(ExitCode::Stopped);
  return is_stop && !stop_reason().empty() ? " (" + stop_reason() + ")" : "";
}

/// Ends the job. A rank that is not the first to report leaves that to the first for a while.
[[noreturn]] void end_after_report(int exit_code, bool has_reported) {
  constexpr std::chrono::seconds kPatience{5};
  if (!has_reported) std::this_thread::sleep_for(kPatience);
  abort_job(exit_code);
}

/// Ends a process that would repeat the work of others.
void refuse_if_any(const CLI::App& app, const std::string& problem) {
  if (problem.empty()) return;
  const bool is_reporting = is_first_process();
  if (is_reporting) std::cerr << app.get_name() << ": " << problem << std::endl;
  end_after_report(static_cast<int>(ExitCode::Usage), is_reporting);
}

/// Runs in a watching thread.
void end_job(const CLI::App& app, const std::string& reason) {
  std::ostringstream text;
  text << app.get_name() << ": " << reason
       << ": the job is ended; run the same command again to go on\n";
  std::cerr << text.str() << std::flush;
  // Open MPI 5 loses what its launcher has not read yet.
  constexpr std::chrono::milliseconds kUntilRead{200};
  std::this_thread::sleep_for(kUntilRead);
  abort_job(static_cast<int>(ExitCode::Stopped));
}

/// Ends this process without MPI, which would itself wait for the other ranks. Whatever a program
/// has made by then is complete or kept.
void end_alone(const CLI::App& app, const std::string& when) {
  std::ostringstream text;
  text << app.get_name() << ": other ranks of the job hang or are stopped while " << when
       << " (--stall-minutes): the job is ended; run the same command again\n";
  std::cerr << text.str() << std::flush;
  std::_Exit(static_cast<int>(ExitCode::Stopped));
}

/// Runs a function first of all when a scope is left.
class OnLeaving {
 public:
  explicit OnLeaving(std::function<void()> action) : action_(std::move(action)) {}
  ~OnLeaving() { action_(); }
  OnLeaving(const OnLeaving&) = delete;
  OnLeaving& operator=(const OnLeaving&) = delete;

 private:
  std::function<void()> action_;
};

}  // namespace

int app_main(CLI::App& app,
             int argc,
             char** argv,
             const std::function<void(const Communicator&)>& run) {
  // A write beyond a limit of file sizes must be an error to report, not a signal to die from. MPI
  // itself writes files.
  std::signal(SIGXFSZ, SIG_IGN);
  std::optional<WaitAlarm> alarm;  // outlives MPI
  std::optional<MpiEnvironment> environment;
  std::optional<ProcessGroup> processes;
  const auto join_job = [&](int process_count) {
    refuse_if_any(app, lone_task_problem());
    if (is_launched() && process_count > 1)
      refuse_if_any(app,
                    "--processes is for a program without a launcher: leave it out, or start the "
                    "program without mpirun (with srun: --mpi=none)");
    if (is_launched()) environment.emplace(argc, argv);
    refuse_if_any(app, split_job_problem(Communicator::world().size()));
    try {
      processes.emplace(process_count, [&app](const std::string& loss) { end_job(app, loss); });
    } catch (const std::system_error& error) {
      std::cerr << app.get_name() << ": --processes " << process_count << ": " << error.what()
                << std::endl;
      std::_Exit(static_cast<int>(ExitCode::Internal));
    }
    return Communicator::world();
  };
  app.name(program_name(argv[0]));
  app.set_version_flag("--version", app.get_name() + " " + std::string(program_version()));
  add_help_formats(app);
  add_no_lock(app);
  try {
    app.parse(arguments_for(app, argc, argv));
    check_option_values(app);
  } catch (const CLI::ParseError& error) {
    if (asks_for_help(error)) return print_help(app, error);
    return refuse_usage(app, error, join_job(1));
  }
  const Communicator world = join_job(local_processes().count);
  std::optional<StallWatch> watch;
  const double stall_minutes = run_limits().stall_minutes;
  const OnLeaving begin_to_end([&] {
    if (watch.has_value() && world.size() > 1)
      alarm.emplace(stall_minutes, [&app] { end_alone(app, "it ends"); });
  });
  RankFailure failure;
  bool is_known_everywhere = false;
  try {
    if (stall_minutes > 0.0) {
      if (world.size() > 1) alarm.emplace(stall_minutes, [&app] { end_alone(app, "it begins"); });
      watch.emplace(world, stall_minutes, [&app](const std::string& stall) {
        end_job(app, stall + " (--stall-minutes)");
      });
      alarm.reset();
    }
    if (environment) environment->require_threads();
    run(world);
    return with_output_written(app, static_cast<int>(ExitCode::Done));
  } catch (const RemoteError& error) {
    failure = {static_cast<int>(error.exit_code()), error.what()};
    is_known_everywhere = true;
  } catch (...) {
    failure = failure_of(std::current_exception());
  }
  // An error that all ranks throw is printed once. One that only this rank met ends the job,
  // because the others would wait for it in their next collective call.
  if (is_known_everywhere || world.size() == 1) {
    if (world.is_root())
      std::cerr << app.get_name() << ": " << failure.message << reason_text(failure) << std::endl;
    if (!is_abort_required()) return with_output_written(app, failure.exit_code);
    end_after_report(failure.exit_code, world.is_root());
  }
  const bool is_reporting = claim_report();
  if (is_reporting)
    std::cerr << app.get_name() << ": rank " << world.rank() << " on " << host_name() << ": "
              << failure.message << std::endl;
  end_after_report(failure.exit_code, is_reporting);
}

std::string given_options(const CLI::App& command, const std::set<std::string>& left_out) {
  std::string line;
  for (const CLI::Option* option : command.get_options()) {
    if (option->count() == 0 || left_out.contains(option->get_name())) continue;
    const std::string name = shell_quoted(option->get_name());
    const bool is_flag = option->get_expected_max() == 0;
    for (const std::string& value : option->results())
      line += " " + name + (is_flag ? "" : " " + shell_quoted(value));
  }
  return line;
}

std::string command_line(int argc, char** argv) {
  std::string line;
  for (int i = 0; i < argc; ++i) line += (i > 0 ? " " : "") + shell_quoted(argv[i]);
  return line;
}

}  // namespace af::cli
