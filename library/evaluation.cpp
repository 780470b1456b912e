// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/evaluation.h"

#include <limits>
#include <utility>

#include "base/error.h"
#include "base/joined.h"
#include "evaluate/statistics/success_rate.h"
#include "files/csv_table.h"
#include "geometry/target_box.h"
#include "geometry/tre.h"
#include "library/translation.h"
#include "xray/psnr.h"

namespace attenuation_fields {

namespace library = af::library;

static_assert(kSuccessTreMm == af::evaluation::kSuccessTreMm);

double mean_tre_mm(const Pose& pose, const Pose& gold, const CtBox& target_box_ct) {
  return library::translated([&] {
    return af::mean_tre_mm(library::transform_of(pose, "pose"),
                           library::transform_of(gold, "gold"),
                           af::target_points({library::vector_of(target_box_ct.low_mm),
                                              library::vector_of(target_box_ct.high_mm)}));
  });
}

std::optional<double> psnr_db(std::span<const float> drr, std::span<const float> reference) {
  return library::translated([&]() -> std::optional<double> {
    if (drr.size() != reference.size())
      throw af::InputError(
          "drr",
          std::to_string(drr.size()) + " pixels",
          "must be as many as of the reference, " + std::to_string(reference.size()));
    const std::optional<af::Psnr> psnr = af::psnr(drr, reference);
    return psnr.has_value() ? std::optional(psnr->psnr_db) : std::nullopt;
  });
}

SuccessRate success_rate(std::span<const double> tre_mm, double threshold_mm) {
  return library::translated([&] {
    std::vector<af::evaluation::TreOutcome> outcomes;
    for (const double tre : tre_mm) outcomes.push_back({0.0, tre});
    SuccessRate result;
    result.trials = static_cast<std::int64_t>(tre_mm.size());
    result.successes = af::evaluation::count_successes(outcomes, threshold_mm);
    const auto interval = af::evaluation::wilson_interval(result.successes, result.trials);
    result.low = interval.low;
    result.high = interval.high;
    result.rate = result.trials > 0
                      ? static_cast<double>(result.successes) / static_cast<double>(result.trials)
                      : std::numeric_limits<double>::quiet_NaN();
    return result;
  });
}

struct Table::Impl {
  af::CsvTable table;

  void require_column(const std::string& column) const {
    if (!table.find_column(column).has_value())
      throw af::InputError(
          "column", "'" + column + "'", "must be one of " + af::joined(table.columns(), ", "));
  }
};

Table::Table(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Table Table::read(const std::filesystem::path& path) {
  return library::translated_reading(
      [&] { return Table(std::make_shared<const Impl>(Impl{af::CsvTable::read(path)})); });
}

const std::vector<std::string>& Table::columns() const {
  return impl_->table.columns();
}

std::size_t Table::row_count() const {
  return impl_->table.row_count();
}

std::vector<std::string> Table::texts(const std::string& column) const {
  return library::translated([&] {
    impl_->require_column(column);
    std::vector<std::string> texts;
    for (std::size_t row = 0; row < row_count(); ++row)
      texts.push_back(impl_->table.text(row, column));
    return texts;
  });
}

std::vector<double> Table::numbers(const std::string& column) const {
  return library::translated([&] {
    impl_->require_column(column);
    std::vector<double> numbers;
    for (std::size_t row = 0; row < row_count(); ++row)
      numbers.push_back(impl_->table.text(row, column).empty()
                            ? std::numeric_limits<double>::quiet_NaN()
                            : impl_->table.number_or_nan(row, column));
    return numbers;
  });
}

}  // namespace attenuation_fields
