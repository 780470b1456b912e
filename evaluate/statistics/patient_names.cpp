// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/patient_names.h"

#include <cctype>

namespace af::evaluation {

std::size_t digits_at_end(const std::string& name) {
  std::size_t count = 0;
  while (count < name.size() &&
         std::isdigit(static_cast<unsigned char>(name[name.size() - 1 - count])) != 0)
    ++count;
  return count;
}

std::string patient_of_case(const std::string& case_name) {
  const std::size_t digits = digits_at_end(case_name);
  if (digits == 0 || case_name.size() < digits + 3) return case_name;
  const std::size_t mark = case_name.size() - digits - 2;
  return case_name.compare(mark, 2, "-p") == 0 ? case_name.substr(0, mark) : case_name;
}

}  // namespace af::evaluation
