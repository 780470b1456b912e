// SPDX-License-Identifier: Apache-2.0
#include "evaluate/case_progress_program.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <span>
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
    : folder_(folder),
      case_name_(case_name),
      communicator_(communicator),
      shard_(folder, case_name, communicator.rank()) {
  all_or_none(communicator_, [&] {
    if (!communicator_.is_root()) return;
    journal_ = std::make_unique<ProgressJournal>(folder, case_name, decides, restart);
    journal_->mend_and_visit([&](std::span<const std::byte> record) {
      const RegistrationRow row = row_of_record(record, folder_.string());
      finished_[row.renderer].push_back(static_cast<std::size_t>(row.start_index));
    });
    for (auto& [renderer, starts] : finished_) {
      std::sort(starts.begin(), starts.end());
      starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
    }
  });
}

std::vector<std::size_t> CaseProgress::unfinished(
    const std::string& renderer, const std::vector<std::size_t>& start_indices) const {
  std::vector<std::byte> flags(start_indices.size());
  if (const auto done = finished_.find(renderer); done != finished_.end())
    for (std::size_t i = 0; i < flags.size(); ++i)
      flags[i] =
          std::byte{std::binary_search(done->second.begin(), done->second.end(), start_indices[i])};
  communicator_.broadcast(flags);
  std::vector<std::size_t> left;
  for (std::size_t i = 0; i < flags.size(); ++i)
    if (flags[i] == std::byte{0}) left.push_back(start_indices[i]);
  return left;
}

std::size_t CaseProgress::finished_count() const {
  std::size_t count = 0;
  for (const auto& [renderer, starts] : finished_) count += starts.size();
  return count;
}

void CaseProgress::append(const RegistrationRow& row) {
  const std::vector<std::uint8_t> bytes = json::to_cbor(packed_row(row));
  shard_.append(std::as_bytes(std::span(bytes)));
  ++appended_;
}

void CaseProgress::sync() {
  all_or_none(communicator_, [&] { shard_.sync(); });
  std::array<std::uint64_t, 1> stops = {cli::is_stop_requested() ? 1U : 0U};
  communicator_.maximum(stops);
  std::array<std::uint64_t, 1> rows = {appended_ + finished_count()};
  communicator_.sum(rows);
  if (stops[0] == 0) return;
  all_or_none(communicator_, [&] {
    if (communicator_.is_root())
      throw StoppedError("stopped with " + std::to_string(rows[0]) + " registrations of case '" +
                         case_name_ + "' saved: run the same command again to go on");
  });
}

void CaseProgress::visit_rows(const std::function<void(RegistrationRow row)>& receive) const {
  journal_->visit(communicator_.size(), [&](std::span<const std::byte> record) {
    receive(row_of_record(record, folder_.string()));
  });
}

}  // namespace af::evaluation
