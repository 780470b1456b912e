// SPDX-License-Identifier: Apache-2.0
// Finished registrations of an unfinished evaluation, so that a stopped or killed run goes on.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "evaluate/registration_rows_files.h"
#include "io/progress_journal.h"
#include "parallel/communicator.h"

namespace af::evaluation {

/// "OUTPUT.progress", beside the folder of the results.
std::filesystem::path progress_folder(const std::filesystem::path& output_folder);

/// Lines "key = value" of options in force; lines of a list go with the line that began it.
DecidingValues deciding_lines(const std::string& toml);

/// The registrations of one case that are finished. Every rank keeps its own in a shard of one
/// journal: no row passes through rank 0 until all are there.
class CaseProgress {
 public:
  /// Collective. Opens or creates the journal of a case. InputError that names the difference when
  /// it was begun with other options or inputs; `restart` throws it away.
  CaseProgress(const std::filesystem::path& folder,
               const std::string& case_name,
               const DecidingValues& decides,
               bool restart,
               const Communicator& communicator);

  /// Collective. Which of a renderer's starts are not finished, the same on every rank.
  [[nodiscard]] std::vector<std::size_t> unfinished(
      const std::string& renderer, const std::vector<std::size_t>& start_indices) const;

  /// Rank 0: how many registrations earlier runs finished.
  [[nodiscard]] std::size_t finished_count() const;

  /// Keeps a row that this rank finished.
  void append(const RegistrationRow& row);

  /// Collective. Makes sure that what was appended survives the machine. When a stop was asked for
  /// on any rank, throws StoppedError on all of them.
  void sync();

  /// Rank 0, after sync(): calls `receive` with every row of all runs and ranks. Rows of one start
  /// are alike, should there be several.
  void visit_rows(const std::function<void(RegistrationRow row)>& receive) const;

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
  std::string case_name_;
  Communicator communicator_;
  std::unique_ptr<ProgressJournal> journal_;  ///< rank 0 alone
  ProgressShard shard_;                       ///< this rank's
  /// Rank 0: start indices that earlier runs finished, by renderer, ascending.
  std::map<std::string, std::vector<std::size_t>> finished_;
  std::uint64_t appended_ = 0;
};

}  // namespace af::evaluation
