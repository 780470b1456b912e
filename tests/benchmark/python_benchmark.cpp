// SPDX-License-Identifier: Apache-2.0
// How much more a DRR costs from Python than by the library's call, and by that call than by the
// renderer itself. All take turns on the same field object, in one process on one core.
#include <pybind11/embed.h>
#include <pybind11/numpy.h>

#include <CLI/CLI.hpp>

#include "attenuation_fields/renderer.h"
#include "base/hash_random.h"
#include "benchmark/alternating_rounds.h"
#include "benchmark/benchmark_case.h"
#include "cli/app_main.h"

namespace af::benchmark {
namespace {

namespace py = pybind11;

struct PythonOptions {
  std::string field;
  /// Many short ones, so that other work on the machine disturbs few of them.
  int rounds = 301;
  bool is_quick = false;
  std::string output;
};

/// Six numbers each, uniform in half of the field's range.
std::vector<std::array<double, 6>> random_parameters(const attenuation_fields::Field& field) {
  constexpr int kPoses = 20;
  std::vector<std::array<double, 6>> poses(kPoses);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    HashRandom random(1, i);
    for (std::size_t k = 0; k < 6; ++k)
      poses[i][k] = 0.5 * (k < 3 ? field.max_rotation_deg() : field.max_translation_mm()) *
                    (2.0 * random.uniform() - 1.0);
  }
  return poses;
}

/// The loops of a user. `poses` holds pairs of tuples.
constexpr const char* kLoops = R"(
from time import perf_counter

def fresh(field, poses, repetitions):
    start = perf_counter()
    for _ in range(repetitions):
        for rotation_deg, translation_mm in poses:
            drr = field.drr(rotation_deg=rotation_deg, translation_mm=translation_mm)
    return perf_counter() - start

def reused(field, poses, repetitions, out):
    start = perf_counter()
    for _ in range(repetitions):
        for rotation_deg, translation_mm in poses:
            field.drr(rotation_deg, translation_mm, out=out)
    return perf_counter() - start

def gradient(field, poses, repetitions):
    start = perf_counter()
    for _ in range(repetitions):
        for rotation_deg, translation_mm in poses:
            drr, planes = field.drr_and_gradient(rotation_deg, translation_mm)
    return perf_counter() - start
)";

void run(const PythonOptions& options) {
  const py::scoped_interpreter interpreter;
  const py::object module = py::module_::import("attenuation_fields");
  const py::object python_field = module.attr("Field").attr("open")(options.field);
  const auto& field = static_cast<const attenuation_fields::Field&>(
      python_field.cast<const attenuation_fields::Renderer&>());
  const auto poses = random_parameters(field);
  constexpr int kRepetitions = 1;
  const py::dict loops;
  py::exec(kLoops, loops);
  py::list pairs;
  for (const auto& p : poses)
    pairs.append(
        py::make_tuple(py::make_tuple(p[0], p[1], p[2]), py::make_tuple(p[3], p[4], p[5])));
  const py::array_t<float> out({field.height(), field.width()});
  const auto python = [&](const char* name, auto&&... more) {
    return [=, &loops] {
      return loops[name](python_field, pairs, kRepetitions, more...).template cast<double>();
    };
  };
  std::vector<float> drr(field.pixel_count());
  std::vector<float> planes(6 * drr.size());
  const auto in_turns = [&](const std::function<void(const attenuation_fields::Vector3&,
                                                     const attenuation_fields::Vector3&)>& draw) {
    return seconds_of([&] {
      for (int i = 0; i < kRepetitions; ++i)
        for (const auto& p : poses) draw({p[0], p[1], p[2]}, {p[3], p[4], p[5]});
    });
  };
  const auto work = static_cast<double>(poses.size()) * kRepetitions;
  const std::vector<Timing> timings =
      alternate({{"C++ drr()",
                  work,
                  "DRRs",
                  [&] {
                    return in_turns([&](const auto& rotation_deg, const auto& translation_mm) {
                      field.drr(field.frame().pose(rotation_deg, translation_mm), drr);
                    });
                  }},
                 {"Python drr(out=)", work, "DRRs", python("reused", out)},
                 {"Python drr()", work, "DRRs", python("fresh")},
                 {"C++ drr_and_gradient()",
                  work,
                  "DRRs",
                  [&] {
                    return in_turns([&](const auto& rotation_deg, const auto& translation_mm) {
                      field.drr_and_gradient(rotation_deg, translation_mm, drr, planes);
                    });
                  }},
                 {"Python drr_and_gradient()", work, "DRRs", python("gradient")}},
                options.is_quick ? 1 : options.rounds);
  // The ratio says what Python costs.
  const nlohmann::json ratios = {speed_ratio(timings[0], timings[1]),
                                 speed_ratio(timings[0], timings[2]),
                                 speed_ratio(timings[3], timings[4])};
  write_section(options.output,
                "python",
                {{"columns", field.width()},
                 {"rows", field.height()},
                 {"field_payload_sha256", field.payload_sha256()},
                 {"results", to_json(timings)},
                 {"ratios", ratios}});
}

}  // namespace
}  // namespace af::benchmark

// Outside app_main only the declaration of options can throw, and that would be a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::benchmark::PythonOptions options;
  CLI::App app{"Seconds of one DRR from Python beside the library's call, one core."};
  app.add_option("--field", options.field, "The field")->required();
  app.add_option("--rounds", options.rounds, "Rounds")->capture_default_str();
  app.add_flag("--quick", options.is_quick, "Little work: shows that it works, not how fast");
  app.add_option("-o,--output", options.output, "JSON")->required();
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator& /*world*/) { af::benchmark::run(options); });
}
