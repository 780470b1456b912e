// SPDX-License-Identifier: Apache-2.0
#include "ranks/provenance.h"

#include <array>
#include <chrono>
#include <ctime>
#include <fstream>
#include <string_view>

#include "base/build_info.h"
#include "base/error.h"
#include "base/vector_width.h"
#include "files/output_file.h"
#include "files/shell_words.h"

namespace af {

namespace {

/// When this process started, as closely as a library can tell.
const std::time_t process_start_time = std::time(nullptr);

std::string utc_text(std::time_t time) {
  std::tm parts{};
  gmtime_r(&time, &parts);
  std::array<char, 32> text{};
  const std::size_t length = std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return {text.data(), length};
}

/// "model name" of /proc/cpuinfo; "unknown" where there is none.
std::string cpu_model() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

/// The text as one line that cannot end a shell comment.
std::string comment_text(std::string text) {
  for (char& character : text)
    if (static_cast<unsigned char>(character) < ' ') character = ' ';
  return text;
}

std::string identity_text(const InputIdentity& input) {
  const auto* const ct = std::get_if<CtIdentity>(&input);
  return ct != nullptr ? text(*ct) : std::get<std::string>(input);
}

std::string script_text(const Provenance& provenance) {
  const bool is_parallel = provenance.rank_count > 1;
  std::string text = "#!/bin/sh\n# Repeats the run that made the files beside this script.\n";
  text += "# " + comment_text(provenance.program) + " " + std::string(program_version()) + " (" +
          "commit " + std::string(program_commit()) + ", " + std::string(compiler_description()) +
          "), started " + utc_text(process_start_time) + ", " +
          std::to_string(provenance.rank_count) + " rank(s), seed " +
          std::to_string(provenance.seed) + "\n";
  if (!provenance.inputs.empty()) text += "# Its inputs, by SHA-256:\n";
  for (const auto& [name, input] : provenance.inputs)
    text += "#   " + comment_text(identity_text(input)) + "  " + comment_text(name) + "\n";
  text += "set -eu\nfolder=" + shell_quoted(std::filesystem::current_path().string()) + "\n";
  text +=
      "if [ -d \"$folder\" ]; then\n"
      "  cd \"$folder\"\n"
      "else\n"
      "  echo \"reproduce.sh: $folder is gone; running in $PWD\" >&2\n"
      "fi\n";
  if (is_parallel) text += "# Any rank count gives the same results; RANKS overrides this one.\n";
  text += "exec ";
  if (is_parallel) text += "mpirun -n \"${RANKS:-" + std::to_string(provenance.rank_count) + "}\" ";
  return text + provenance.command_line + "\n";
}

}  // namespace

nlohmann::json to_json(const Provenance& provenance) {
  nlohmann::json hashes = nlohmann::json::object();
  nlohmann::json grids = nlohmann::json::object();
  for (const auto& [name, input] : provenance.inputs) {
    const auto* const ct = std::get_if<CtIdentity>(&input);
    hashes[name] = ct != nullptr ? ct->content_sha256 : std::get<std::string>(input);
    if (ct != nullptr) grids[name] = to_json(ct->grid);
  }
  return {
      {"program", provenance.program},
      {"program_version", std::string(program_version())},
      {"program_commit", std::string(program_commit())},
      {"compiler", std::string(compiler_description())},
      {"command_line", provenance.command_line},
      {"options_toml", provenance.options_toml},
      {"seed", provenance.seed},
      {"rank_count", provenance.rank_count},
      {"input_sha256", hashes},
      {"input_grids", grids},
      {"input_notes", provenance.input_notes},
      {"host", {{"cpu", cpu_model()}, {"vector_bits", static_cast<int>(active_vector_width())}}},
      {"started_utc", utc_text(process_start_time)}};
}

void write_reproduce_script(const std::filesystem::path& folder, const Provenance& provenance) {
  check(!provenance.command_line.empty(), "reproduce.sh needs a command line");
  const std::string text = script_text(provenance);
  write_atomically(folder / "reproduce.sh", [&text](const std::filesystem::path& partial) {
    std::ofstream file(partial, std::ios::binary);
    file.exceptions(std::ios::badbit | std::ios::failbit);
    file << text;
    file.close();
    using std::filesystem::perms;
    std::filesystem::permissions(partial,
                                 perms::owner_exec | perms::group_exec | perms::others_exec,
                                 std::filesystem::perm_options::add);
  });
}

void write_results_last(const std::filesystem::path& file,
                        nlohmann::json summary,
                        const Provenance& provenance) {
  write_reproduce_script(file.parent_path(), provenance);
  summary["provenance"] = to_json(provenance);
  write_text_file(file, summary.dump(2) + "\n");
}

}  // namespace af
