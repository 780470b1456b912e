// SPDX-License-Identifier: Apache-2.0
// A record of a journal of registrations.
#include <optional>

#include "evaluate/registration/registration_rows.h"
#include "fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  std::optional<evaluation::TracedRow> row;
  const auto record = std::as_bytes(std::span(data, size));
  if (!fuzz::is_accepted([&] { row = evaluation::row_of_record(record, "journal"); })) return 0;
  const auto bytes = nlohmann::json::to_cbor(evaluation::packed_row(*row));
  const auto again = evaluation::row_of_record(std::as_bytes(std::span(bytes)), "again");
  fuzz::require(nlohmann::json::to_cbor(evaluation::packed_row(again)) == bytes,
                "a row reads back as it was written");
  (void)evaluation::registrations_table({&row->row, 1}).to_text();
  return 0;
}
