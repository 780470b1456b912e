// SPDX-License-Identifier: Apache-2.0
#include "evaluate/row_gathering_program.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

namespace af::evaluation {

using nlohmann::json;

std::vector<json> gather_rows(const Communicator& communicator, const std::vector<json>& mine) {
  const std::vector<std::uint8_t> packed = json::to_cbor(mine);
  std::vector<json> rows;
  for (const std::vector<std::byte>& bytes :
       communicator.gather(std::as_bytes(std::span(packed)))) {
    const auto* const first = reinterpret_cast<const std::uint8_t*>(bytes.data());
    for (json& row : json::from_cbor(first, first + bytes.size())) rows.push_back(std::move(row));
  }
  std::sort(rows.begin(), rows.end(), [](const json& a, const json& b) {
    return a[0].get<std::int64_t>() < b[0].get<std::int64_t>();
  });
  return rows;
}

}  // namespace af::evaluation
