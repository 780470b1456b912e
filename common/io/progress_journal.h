// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <span>
#include <string>

#include "io/progress_manifest.h"

namespace af {

/// Finished records of unfinished work: FOLDER/NAME.json says what they are valid for, and to
/// FOLDER/NAME.records one process appends them, each with its size and CRC-32C. Whatever a killed
/// run left torn or damaged is cut off when the journal is opened again.
class ProgressJournal {
 public:
  /// Opens or creates a journal. InputError that names the difference when earlier records were
  /// about something else; `restart` throws them away. FileError when files cannot be read or
  /// written.
  ProgressJournal(const std::filesystem::path& folder,
                  const std::string& name,
                  const DecidingValues& decides,
                  bool restart);

  using Visit = std::function<void(std::span<const std::byte> record)>;
  /// The sound records of earlier runs, in the order in which they were appended; what follows the
  /// first unsound one is cut off. To be called before append().
  void visit_finished(const Visit& visit);

  /// The record survives the end of this process from now on; of the machine after sync().
  void append(std::span<const std::byte> record);

  void sync();

  /// Removes the journal, and the folder when nothing else is in it: the work is complete.
  void remove();

 private:
  [[nodiscard]] std::filesystem::path manifest_path() const;
  [[nodiscard]] std::filesystem::path records_path() const;

  std::filesystem::path folder_;
  std::string name_;
  std::ofstream file_;
};

}  // namespace af
