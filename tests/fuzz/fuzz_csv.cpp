// SPDX-License-Identifier: Apache-2.0
// Tables: CSV as such, poses for DRRs, starts of registrations, and poses that were found.
#include <optional>
#include <string>
#include <vector>

#include "evaluate/registration/start_tables.h"
#include "files/csv_table.h"
#include "fuzz/fuzz_input.h"
#include "study/pose_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  const auto path = fuzz::written("poses.csv", fuzz::as_text({data, size}));
  std::optional<CsvTable> table;
  std::string parts;
  const bool is_accepted_in_parts = fuzz::is_accepted([&] {
    CsvTable::read_in_parts(path, [&](const CsvTable& part) { parts += part.rows_text(); });
  });
  const bool is_accepted = fuzz::is_accepted([&] { table = CsvTable::read(path); });
  fuzz::require(is_accepted == is_accepted_in_parts, "a table is refused in parts, or as a whole");
  if (!is_accepted) return 0;
  fuzz::require(parts == table->rows_text(), "a table in parts is the same table");
  const auto again = CsvTable::read(fuzz::written("again.csv", table->to_text()));
  fuzz::require(again.columns() == table->columns() && again.row_count() == table->row_count() &&
                    again.to_text() == table->to_text(),
                "a table reads back as it was written");
  fuzz::is_accepted([&] { (void)read_pose_file(path, {PoseFrame(), {}}); });
  evaluation::PoseTableFrames frames;
  frames.case_name = "skull-01";
  std::vector<std::string> notes;
  fuzz::is_accepted([&] { evaluation::read_starts(path, frames, notes); });
  fuzz::is_accepted([&] { evaluation::read_found_poses(path, frames); });
  fuzz::is_accepted([&] { evaluation::unknown_case_problems(path, {"skull-01"}); });
  return 0;
}
