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
  std::vector<std::string> files;  ///< that will stand in the folder; empty: `path` is a file
  bool restarts = false;           ///< throws unfinished work away
  bool keeps_progress = true;      ///< a stop saves what is finished
};

/// What a long run needs around its work, in order: its outputs are known before inputs are read; a
/// stop may be asked for; other jobs are kept out; what is finished is kept in OUTPUT.progress; and
/// the file that says that all is there is written last. (The watchdog is app_main's: it watches
/// what comes before, too, and must survive an error of one rank.)
class RunFolder {
 public:
  /// Collective. From now on the output files are refused as inputs, and a stop may be asked for.
  RunFolder(RunOutput output, const Communicator& world);

  /// Collective. Makes the folder, and keeps other jobs out from now on. Call it once the inputs
  /// are known to be good, so that bad ones leave nothing behind, and before the work, so that an
  /// unwritable folder does not waste it. FileError or InputError as make_folder() and
  /// OutputLock.
  void open();

  /// The work called `name` as it is kept in OUTPUT.progress.
  [[nodiscard]] UnfinishedWork unfinished(const std::string& name, DecidingValues decides) const;

  /// Whether this rank was asked to stop, and has where to save what is finished.
  [[nodiscard]] bool is_stop_requested() const;
  /// Collective. StoppedError on every rank when any was asked to stop; `state` says what of the
  /// work is saved.
  void stop_if_requested(const std::string& state) const;

  /// Rank 0. From here on the results of an earlier run are incomplete: its summary.json is gone.
  void begin_results() const;

  /// Rank 0. write_results_last() as summary.json; then nothing is unfinished.
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
