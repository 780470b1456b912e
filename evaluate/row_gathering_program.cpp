// SPDX-License-Identifier: Apache-2.0
#include "evaluate/row_gathering_program.h"

#include <chrono>
#include <cstddef>
#include <exception>
#include <optional>
#include <span>
#include <vector>

#include "cli/app_main.h"
#include "cli/progress_printer.h"
#include "parallel/work_queue.h"
#include "parallel/work_watch.h"

namespace af::evaluation {

using nlohmann::json;

void collect_rows(const Communicator& world,
                  std::int64_t count,
                  const std::string& what,
                  const std::function<json(std::int64_t item)>& row_of_item,
                  const std::function<void(std::int64_t item, const json& row)>& receive) {
  std::optional<cli::ProgressPrinter> printer;
  if (!what.empty()) printer.emplace(what, world.is_root());
  collect_items(
      world,
      count,
      [&](std::int64_t item) {
        const WorkNote note((what.empty() ? "" : what + ", ") + "item " + std::to_string(item + 1) +
                            " of " + std::to_string(count));
        const std::vector<std::uint8_t> packed = json::to_cbor(row_of_item(item));
        const auto bytes = std::as_bytes(std::span(packed));
        return std::vector<std::byte>(bytes.begin(), bytes.end());
      },
      [&](std::int64_t item, std::span<const std::byte> bytes) {
        const auto* const first = reinterpret_cast<const std::uint8_t*>(bytes.data());
        receive(item, json::from_cbor(first, first + bytes.size()));
      },
      [&](std::int64_t done) {
        if (printer) printer->update(static_cast<double>(done), static_cast<double>(count));
      });
}

void announce_time(const Communicator& world,
                   const std::string& what,
                   std::int64_t count,
                   const std::function<void()>& item) {
  if (!world.is_root() || count < 2) return;
  const auto start = std::chrono::steady_clock::now();
  try {
    item();
  } catch (const std::exception&) {
    return;
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  cli::info(world, cli::expected_time_text(what, count, seconds.count(), world.size()));
}

}  // namespace af::evaluation
