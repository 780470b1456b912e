// SPDX-License-Identifier: Apache-2.0
// A record of a journal of registrations.
#include <optional>

#include "base/stored_bytes.h"
#include "evaluate/registration/registration_rows.h"
#include "fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  std::optional<evaluation::TracedRow> row;
  const auto record = std::as_bytes(std::span(data, size));
  if (!fuzz::is_accepted([&] { row = value_of<evaluation::TracedRow>(record, "journal"); }))
    return 0;
  const auto bytes = bytes_of(*row);
  fuzz::require(bytes_of(value_of<evaluation::TracedRow>(bytes, "again")) == bytes,
                "a row reads back as it was written");
  (void)evaluation::registrations_table({&row->row, 1}).to_text();
  return 0;
}
