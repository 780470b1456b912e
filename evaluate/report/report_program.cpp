// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/report_program.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <iostream>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/error.h"
#include "files/captured_output.h"
#include "files/shell_words.h"
#include "ranks/terminal.h"

extern char** environ;

namespace af::evaluation {

namespace {

constexpr const char* kName = "af-report";

std::string program_path() {
  std::error_code error;
  const auto beside = std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / kName;
  return std::filesystem::exists(beside, error) ? beside.string() : kName;
}

/// Runs a program and returns its exit status. What it says of errors goes to `errors`.
int exit_status(std::vector<std::string> words, int errors) {
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  pid_t process = 0;
  const int error =
      posix_spawnp(&process, arguments.front(), &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw FileError(kName, std::string("cannot be run: ") + std::strerror(error));
  int status = 0;
  while (waitpid(process, &status, 0) < 0)
    if (errno != EINTR) throw FileError(kName, std::string("was lost: ") + std::strerror(errno));
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

/// The last line, without the name of the program.
std::string message_of(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  text.erase(0, text.rfind('\n') + 1);
  const std::string name = std::string(kName) + ": ";
  return text.starts_with(name) ? text.substr(name.size()) : text;
}

}  // namespace

void run_af_report(const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {program_path()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::cout.flush();
  int status = 0;
  const std::string message =
      message_of(captured_output(kName, [&](int errors) { status = exit_status(words, errors); }));
  if (status == static_cast<int>(ExitCode::Input)) throw InputError(message);
  if (status != 0)
    throw FileError(kName,
                    message.empty() ? "ended with status " + std::to_string(status) : message);
}

void draw_results(const std::vector<std::string>& arguments, const Communicator& world) try {
  run_af_report(arguments);
} catch (const Error& error) {
  std::string command = kName;
  for (const std::string& argument : arguments) command += " " + shell_quoted(argument);
  warn(world,
       std::string("the numbers are complete, figures and tables are missing (") + error.what() +
           "); they are made by: " + command);
}

}  // namespace af::evaluation
