// SPDX-License-Identifier: Apache-2.0
#include "evaluate/case_progress_program.h"

#include <array>
#include <cstdint>
#include <sstream>

#include "base/error.h"
#include "cli/stop_request.h"

namespace af::evaluation {

using nlohmann::json;

std::filesystem::path progress_folder(const std::filesystem::path& output_folder) {
  std::filesystem::path folder = output_folder.lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();
  return folder += ".progress";
}

DecidingValues deciding_lines(const std::string& toml) {
  DecidingValues values;
  std::string* last = nullptr;
  std::istringstream lines(toml);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t equals = line.find(" = ");
    const bool begins = equals != std::string::npos && line.front() != ' ';
    if (begins)
      last = &(values[line.substr(0, equals)] = line.substr(equals + 3));
    else if (last != nullptr)
      *last += line;
  }
  return values;
}

CaseProgress::CaseProgress(const std::filesystem::path& folder,
                           const std::string& case_name,
                           const DecidingValues& decides,
                           bool restart,
                           const Communicator& communicator)
    : case_name_(case_name), communicator_(communicator) {
  all_or_none(communicator_, [&] {
    if (!communicator_.is_root()) return;
    journal_ = std::make_unique<ProgressJournal>(folder, case_name, decides, restart);
    journal_->visit_finished([&](std::span<const std::byte> record) {
      RegistrationRow row = row_of_record(record, folder.string());
      finished_[{row.renderer, static_cast<std::size_t>(row.start_index)}] = std::move(row);
    });
  });
}

std::vector<std::size_t> CaseProgress::unfinished(
    const std::string& renderer, const std::vector<std::size_t>& start_indices) const {
  std::vector<std::byte> flags(start_indices.size());
  for (std::size_t i = 0; i < flags.size(); ++i)
    flags[i] = std::byte{find(renderer, start_indices[i]) == nullptr};
  communicator_.broadcast(flags);
  std::vector<std::size_t> left;
  for (std::size_t i = 0; i < flags.size(); ++i)
    if (flags[i] != std::byte{0}) left.push_back(start_indices[i]);
  return left;
}

const RegistrationRow* CaseProgress::find(const std::string& renderer,
                                          std::size_t start_index) const {
  const auto found = finished_.find({renderer, start_index});
  return found == finished_.end() ? nullptr : &found->second;
}

void CaseProgress::append(const json& packed) {
  const std::vector<std::uint8_t> bytes = json::to_cbor(packed);
  journal_->append(std::as_bytes(std::span(bytes)));
  ++appended_;
}

void CaseProgress::sync() {
  all_or_none(communicator_, [&] {
    if (journal_) journal_->sync();
  });
  std::array<std::uint64_t, 1> stops = {cli::is_stop_requested() ? 1U : 0U};
  communicator_.maximum(stops);
  if (stops[0] == 0) return;
  all_or_none(communicator_, [&] {
    if (communicator_.is_root())
      throw StoppedError("stopped with " + std::to_string(finished_.size() + appended_) +
                         " registrations of case '" + case_name_ +
                         "' saved: run the same command again to go on");
  });
}

}  // namespace af::evaluation
