// SPDX-License-Identifier: Apache-2.0
#include "evaluate/outputs/row_gathering.h"

#include <chrono>
#include <cstddef>
#include <exception>
#include <numeric>
#include <span>
#include <vector>

#include "base/error.h"
#include "run/progress_printer.h"
#include "run/terminal.h"
#include "text/cbor_json.h"

namespace af::evaluation {

using nlohmann::json;

void collect_rows(const Communicator& world,
                  const UnfinishedWork& unfinished,
                  std::int64_t count,
                  const std::string& what,
                  const std::function<json(std::int64_t item)>& row_of_item,
                  const std::function<void(std::int64_t item, const json& row)>& receive) {
  ResumableItems items(unfinished, world);
  std::vector<std::int64_t> all(static_cast<std::size_t>(count));
  std::iota(all.begin(), all.end(), 0);
  items.complete(all, what, [&](std::int64_t item) { return cbor_bytes(row_of_item(item)); });
  all_or_none(world, [&] {
    if (!world.is_root()) return;
    items.visit([&](std::int64_t item, std::span<const std::byte> row) {
      try {
        receive(item, json_of_cbor(row, unfinished.folder.string()));
      } catch (const json::exception& error) {
        throw FileError(unfinished.folder.string(),
                        std::string("a record is no row: ") + error.what());
      }
    });
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
  inform(world, expected_time_text(what, count, seconds.count(), world.size()));
}

}  // namespace af::evaluation
