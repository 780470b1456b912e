// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/evaluation.h"

#include <algorithm>
#include <filesystem>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "attenuation_fields/errors.h"
#include "python/bindings/arrays.h"
#include "python/bindings/pickled.h"
#include "python/bindings/texts.h"
#include "python/bindings/without_lock.h"

namespace attenuation_fields::python {
namespace {

using namespace pybind11::literals;
using PythonTable = MadeBy<Table>;

Table table_of(const std::filesystem::path& path) {
  return without_lock([&] { return Table::read(path); });
}

std::vector<py::ssize_t> shape_of(const py::array& array) {
  return {array.shape(), array.shape() + array.ndim()};
}

std::optional<double> psnr_db_of(const Numbers& drr, const Numbers& reference) {
  const std::vector<py::ssize_t> shape = shape_of(array_of_numbers(reference, "reference"));
  const auto found = converted<float>(drr, "drr", shape);
  const auto expected = converted<float>(reference, "reference", shape);
  const auto size = static_cast<std::size_t>(found.size());
  return psnr_db({found.data(), size}, {expected.data(), size});
}

double mean_tre_mm_of(const Numbers& pose, const Numbers& gold, const Numbers& target_box_ct_mm) {
  const auto box = converted<double>(target_box_ct_mm, "target_box_ct_mm", {2, 3});
  CtBox target;
  std::copy_n(box.data(), 3, target.low_mm.begin());
  std::copy_n(box.data() + 3, 3, target.high_mm.begin());
  return mean_tre_mm(pose_of(pose, "pose"), pose_of(gold, "gold"), target);
}

SuccessRate success_rate_of(const Numbers& tre_mm, double threshold_mm) {
  const auto values = converted<double>(tre_mm, "tre_mm", {-1});
  return success_rate({values.data(), static_cast<std::size_t>(values.size())}, threshold_mm);
}

py::list cells_of(const std::vector<std::string>& cells) {
  py::list texts;
  for (const std::string& cell : cells) texts.append(cell_of(cell));
  return texts;
}

void bind_table(py::module_& module) {
  py::class_<PythonTable> table(
      module, "Table", "A CSV file with a header line: registrations.csv, image-quality.csv.");
  table.def_static("read", keeping_arguments(&table_of, {"path"}), "path"_a);
  def_made_again(table, "table");
  def_copies(table);
  table.def_property_readonly("columns",
                              [](const PythonTable& self) { return cells_of(self.columns()); });
  table.def("__len__", &Table::row_count);
  table.def(
      "texts",
      [](const PythonTable& self, const std::string& column) {
        return cells_of(self.texts(column));
      },
      "column"_a,
      "A column as a list of texts. Bytes that are not UTF-8 become what os.fsdecode() gives.");
  table.def(
      "numbers",
      [](const PythonTable& self, const std::string& column) {
        const std::vector<double> numbers = self.numbers(column);
        return py::array_t<double>(static_cast<py::ssize_t>(numbers.size()), numbers.data());
      },
      "column"_a,
      "A column as float64. Empty cells are NaN.");
}

}  // namespace

void bind_evaluation(py::module_& module) {
  bind_table(module);
  module.def(
      "mean_tre_mm",
      &mean_tre_mm_of,
      "pose"_a,
      "gold"_a,
      "target_box_ct_mm"_a,
      "Mean distance (mm) over a box ((low), (high)) between where two 4x4 poses put its points.");
  module.def("psnr_db",
             &psnr_db_of,
             "drr"_a,
             "reference"_a,
             "Peak signal-to-noise ratio (dB). Pixels where the reference is 0 are left out. None "
             "when nothing remains.");
  py::class_<SuccessRate> rate(
      module, "SuccessRate", "Successes and Wilson's 95 % interval of their rate.");
  rate.def_readonly("trials", &SuccessRate::trials);
  rate.def_readonly("successes", &SuccessRate::successes);
  rate.def_readonly("rate", &SuccessRate::rate);
  rate.def_readonly("low", &SuccessRate::low);
  rate.def_readonly("high", &SuccessRate::high);
  def_pickle(rate,
             &SuccessRate::trials,
             &SuccessRate::successes,
             &SuccessRate::rate,
             &SuccessRate::low,
             &SuccessRate::high);
  module.def("success_rate",
             &success_rate_of,
             "tre_mm"_a,
             "threshold_mm"_a = kSuccessTreMm,
             "Share of TREs (mm) below a threshold. NaN is a failure.");
}

}  // namespace attenuation_fields::python
