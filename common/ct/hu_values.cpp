// SPDX-License-Identifier: Apache-2.0
#include "ct/hu_values.h"

#include <algorithm>

#include "base/error.h"

namespace af {

namespace {

constexpr double kUnlabelledHu = -1000.0;

}  // namespace

HuConversion::HuConversion(const CtReadOptions& options) {
  throw_if_any(problems(options));
  const double per_hu = options.values_water_mu_per_mm / 1000.0;
  if (options.values == "mu" || options.values == "raw") {
    const bool is_raw = options.values == "raw";
    kind_ = Kind::Scaled;
    scale_ = (is_raw ? options.raw_slope_per_mm : 1.0) / per_hu;
    offset_ = (is_raw ? options.raw_offset_per_mm / per_hu : 0.0) + kUnlabelledHu;
  }
  if (options.values == "labels") {
    kind_ = Kind::Labels;
    for (const std::string& text : options.label_hu) labels_.push_back(*label_of(text));
    std::sort(labels_.begin(), labels_.end());
  }
}

double HuConversion::hu(double number) const {
  switch (kind_) {
    case Kind::Hu:
      return number;
    case Kind::Scaled:
      return scale_ * number + offset_;
    case Kind::Labels:
      break;
  }
  if (!std::isfinite(number)) return number;
  const auto found = std::lower_bound(labels_.begin(), labels_.end(), std::pair{number, -1e300});
  return found != labels_.end() && found->first == number ? found->second : kUnlabelledHu;
}

}  // namespace af
