// SPDX-License-Identifier: Apache-2.0
#include "ranks/run_folder.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "files/output_file.h"
#include "ranks/root_only.h"
#include "ranks/stop_request.h"

namespace af {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSummary = "summary.json";

fs::path progress_folder(const fs::path& output) {
  fs::path folder = output.lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();
  return folder += ".progress";
}

}  // namespace

RunFolder::RunFolder(RunOutput output, const Communicator& world)
    : output_(std::move(output)), progress_(progress_folder(output_.path)), world_(world) {
  if (output_.keeps_progress) listen_for_stop_requests();
  do_on_root(world_, [&] {
    if (!output_.files.empty()) announce_outputs(output_.path, output_.files);
  });
}

void RunFolder::open() {
  do_on_root(world_, [&] {
    const fs::path parent = output_.path.has_parent_path() ? output_.path.parent_path() : ".";
    make_folder(output_.files.empty() ? parent : output_.path);
    lock_ = std::make_unique<OutputLock>(output_.path);
  });
}

UnfinishedWork RunFolder::unfinished(const std::string& name, DecidingValues decides) const {
  UnfinishedWork work{progress_, name, std::move(decides)};
  work.restarts = output_.restarts;
  return work;
}

bool RunFolder::is_stop_requested() const {
  return output_.keeps_progress && af::is_stop_requested();
}

void RunFolder::stop_if_requested(const std::string& state) const {
  if (!output_.keeps_progress || !af::is_stop_requested(world_)) return;
  all_or_none(world_, [&] {
    throw StoppedError("stopped " + state + ": run the same command again to go on");
  });
}

void RunFolder::begin_results() const {
  remove_output(output_.path / kSummary);
}

void RunFolder::finish(nlohmann::json summary, const Provenance& provenance) const {
  write_results_last(output_.path / kSummary, std::move(summary), provenance);
  finish();
}

void RunFolder::finish() const {
  std::error_code error;
  fs::remove_all(progress_, error);
  if (error) throw FileError(progress_.string(), "cannot be removed: " + error.message());
}

}  // namespace af
