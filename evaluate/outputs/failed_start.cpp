// SPDX-License-Identifier: Apache-2.0
#include "evaluate/outputs/failed_start.h"

#include "files/output_file.h"

namespace af::evaluation {

std::string trace_file(const std::string& case_name,
                       const std::string& renderer,
                       std::int64_t start_index) {
  return "traces/" + file_name_part(case_name) + "-" + file_name_part(renderer) + "-" +
         std::to_string(start_index) + ".csv";
}

}  // namespace af::evaluation
