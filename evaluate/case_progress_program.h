// SPDX-License-Identifier: Apache-2.0
// Finished registrations of an unfinished evaluation, so that a stopped or killed run goes on.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "evaluate/registration_rows_files.h"
#include "io/progress_journal.h"
#include "parallel/communicator.h"

namespace af::evaluation {

/// "OUTPUT.progress", beside the folder of the results.
std::filesystem::path progress_folder(const std::filesystem::path& output_folder);

/// Lines "key = value" of options in force; lines of a list go with the line that began it.
DecidingValues deciding_lines(const std::string& toml);

/// The registrations of one case that are finished, in a journal that rank 0 keeps.
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

  /// Rank 0: the finished row of a start; nullptr when there is none.
  [[nodiscard]] const RegistrationRow* find(const std::string& renderer,
                                            std::size_t start_index) const;

  /// Rank 0: how many registrations earlier runs finished.
  [[nodiscard]] std::size_t finished_count() const { return finished_.size(); }

  /// Rank 0: keeps a row, as packed_row() makes it.
  void append(const nlohmann::json& packed);

  /// Collective. Makes sure that what was appended survives the machine. When a stop was asked for
  /// on any rank, throws StoppedError on all of them.
  void sync();

 private:
  std::string case_name_;
  Communicator communicator_;
  std::unique_ptr<ProgressJournal> journal_;                                 ///< rank 0 alone
  std::map<std::pair<std::string, std::size_t>, RegistrationRow> finished_;  ///< of earlier runs
  std::size_t appended_ = 0;
};

}  // namespace af::evaluation
