// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/evaluation.h"

#include <filesystem>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "attenuation_fields/errors.h"
#include "python/bindings/arrays.h"
#include "python/bindings/texts.h"

namespace attenuation_fields::python {
namespace {

using namespace pybind11::literals;
using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;

std::span<const float> values_of(const Floats& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}

py::list cells_of(const std::vector<std::string>& cells) {
  py::list texts;
  for (const std::string& cell : cells) texts.append(cell_of(cell));
  return texts;
}

void bind_table(py::module_& module) {
  py::class_<Table> table(
      module, "Table", "A CSV file with a header line: registrations.csv, image-quality.csv.");
  table.def_static(
      "read",
      [](const std::filesystem::path& path) {
        const py::gil_scoped_release release;
        return Table::read(path);
      },
      "path"_a);
  table.def_property_readonly("columns",
                              [](const Table& self) { return cells_of(self.columns()); });
  table.def("__len__", &Table::row_count);
  table.def(
      "texts",
      [](const Table& self, const std::string& column) { return cells_of(self.texts(column)); },
      "column"_a,
      "A column as a list of texts; bytes that are not UTF-8 as os.fsdecode() has them.");
  table.def(
      "numbers",
      [](const Table& self, const std::string& column) {
        const std::vector<double> numbers = self.numbers(column);
        return py::array_t<double>(static_cast<py::ssize_t>(numbers.size()), numbers.data());
      },
      "column"_a,
      "A column as float64; empty cells are NaN.");
}

}  // namespace

void bind_evaluation(py::module_& module) {
  bind_table(module);
  module.def(
      "mean_tre_mm",
      [](const Numbers& pose,
         const Numbers& gold,
         const std::array<std::array<double, 3>, 2>& target_box_ct_mm) {
        return mean_tre_mm(pose_of(pose, "pose"),
                           pose_of(gold, "gold"),
                           {target_box_ct_mm[0], target_box_ct_mm[1]});
      },
      "pose"_a,
      "gold"_a,
      "target_box_ct_mm"_a,
      "Mean distance (mm) over a box ((low), (high)) between where two 4x4 poses put its points.");
  module.def(
      "psnr_db",
      [](const Floats& drr, const Floats& reference) {
        require_shape(drr, "drr", {reference.shape(), reference.shape() + reference.ndim()});
        return psnr_db(values_of(drr), values_of(reference));
      },
      "drr"_a,
      "reference"_a,
      "Peak signal-to-noise ratio; zeros of the reference are left out; None when nothing is "
      "left.");
  py::class_<SuccessRate> rate(
      module, "SuccessRate", "Successes and Wilson's 95 % interval of their rate.");
  rate.def_readonly("trials", &SuccessRate::trials);
  rate.def_readonly("successes", &SuccessRate::successes);
  rate.def_readonly("rate", &SuccessRate::rate);
  rate.def_readonly("low", &SuccessRate::low);
  rate.def_readonly("high", &SuccessRate::high);
  module.def(
      "success_rate",
      [](const Numbers& tre_mm, double threshold_mm) {
        require_shape(tre_mm, "tre_mm", {-1});
        return success_rate({tre_mm.data(), static_cast<std::size_t>(tre_mm.size())}, threshold_mm);
      },
      "tre_mm"_a,
      "threshold_mm"_a = kSuccessTreMm,
      "Share of TREs (mm) below a threshold; NaN is a failure.");
}

}  // namespace attenuation_fields::python
