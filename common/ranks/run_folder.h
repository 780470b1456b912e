// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "files/output_lock.h"
#include "ranks/communicator.h"
#include "ranks/progress_journal.h"
#include "ranks/provenance.h"

namespace af {

/// Where a long run leaves what it makes.
struct RunOutput {
  std::filesystem::path path;      ///< a folder, or a file
  std::vector<std::string> files;  ///< that will be in the folder; empty: `path` is a file
  bool restarts = false;           ///< discards unfinished work
  bool keeps_progress = true;      ///< a stop saves what is finished
};

/// What a long run needs around its work, in order: its outputs are known before inputs are read, a
/// stop may be asked for, other jobs are kept out, finished work is kept in OUTPUT.progress, and
/// the file that says that everything is there is written last. (The watchdog belongs to app_main:
/// it also watches what comes before, and must survive an error of one rank.)
class RunFolder {
 public:
  /// Collective. From now on the output files are refused as inputs, and a stop may be asked for.
  RunFolder(RunOutput output, const Communicator& world);

  /// Collective. Creates the folder, and keeps other jobs out from now on. Call it once the inputs
  /// are known to be good, so that bad ones leave nothing behind, and before the work, so that an
  /// unwritable folder does not waste it. Throws as make_folder() and OutputLock do.
  void open();

  /// The work called `name`, as it is kept in OUTPUT.progress.
  [[nodiscard]] UnfinishedWork unfinished(const std::string& name, DecidingValues decides) const;

  /// Whether this rank was asked to stop and has a place to save what is finished.
  [[nodiscard]] bool is_stop_requested() const;
  /// Collective. Throws StoppedError on every rank when any was asked to stop. `state` says how
  /// much of the work is saved.
  void stop_if_requested(const std::string& state) const;

  /// Rank 0. From here on the results of an earlier run are incomplete: its summary.json is gone.
  void begin_results() const;

  /// Rank 0. Writes summary.json by write_results_last(). Nothing is unfinished then.
  void finish(nlohmann::json summary, const Provenance& provenance) const;
  /// Rank 0, when no rank has a journal open. Nothing is unfinished any more.
  void finish() const;

 private:
  RunOutput output_;
  std::filesystem::path progress_;
  Communicator world_;
  std::unique_ptr<OutputLock> lock_;  ///< rank 0
};

}  // namespace af
