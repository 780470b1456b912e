// SPDX-License-Identifier: Apache-2.0
// How well DRRs at a study's known pose fit the values of its X-rays, at one energy and with a
// tube's spectrum, by ray casting and, where fields are given, by look-up. A table in Markdown.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "cli/app_main.h"
#include "register/case_loading.h"
#include "register/field_paths.h"
#include "study/study_file.h"

namespace {

using namespace af;
using namespace af::registration;

struct Options {
  std::string study;
  std::string case_name;
  FieldPaths fields;
  SpectrumOptions spectrum;
  double scatter_to_primary = 0.0;
  AttenuationModel attenuation;
  double step_mm = 0.5;
  int timing_drrs = 0;
};

/// Sums over the pixels of the regions where the DRR shows the body.
class ValueFit {
 public:
  void add(double drr, double xray) {
    ++count_;
    drr_ += drr;
    xray_ += xray;
    drr_drr_ += drr * drr;
    drr_xray_ += drr * xray;
    xray_xray_ += xray * xray;
  }
  /// Mean of DRR - X-ray.
  [[nodiscard]] double bias() const { return (drr_ - xray_) / count_; }
  [[nodiscard]] double rms() const {
    return std::sqrt(std::max(0.0, (drr_drr_ - 2.0 * drr_xray_ + xray_xray_) / count_));
  }
  /// What remains beside the straight line that fits best; registration by correlation sees no
  /// more.
  [[nodiscard]] double rms_about_line() const {
    const double variance = xray_xray_ - xray_ * xray_ / count_;
    const double covariance = drr_xray_ - drr_ * xray_ / count_;
    return std::sqrt(std::max(0.0, variance - slope() * covariance) / count_);
  }
  [[nodiscard]] double slope() const {
    return (drr_xray_ - drr_ * xray_ / count_) / (drr_drr_ - drr_ * drr_ / count_);
  }

 private:
  double count_ = 0.0;
  double drr_ = 0.0, xray_ = 0.0;
  double drr_drr_ = 0.0, drr_xray_ = 0.0, xray_xray_ = 0.0;
};

ValueFit fit_of(const RegistrationProblem& problem, const RigidTransform& room_from_ct) {
  constexpr float kBodyFrom = 0.05f;
  ValueFit fit;
  for (const RegistrationView& view : problem.views) {
    const Image2d drr = render_image(*view.renderer, room_from_ct, view.view);
    const RegionOfInterest& roi = view.view.roi;
    for (int row = 0; row < roi.height; ++row)
      for (int column = 0; column < roi.width; ++column) {
        const float value = drr.at(column, row);
        const int x = roi.column + column;
        const int y = roi.row + row;
        if (value < kBodyFrom) continue;
        if (!view.mask.pixels.empty() && view.mask.at(x, y) == 0.0f) continue;
        fit.add(static_cast<double>(value), static_cast<double>(view.xray.at(x, y)));
      }
  }
  return fit;
}

/// Milliseconds of a DRR of the first view: the median of several, each at its own pose, because
/// renderers keep what they can from one pose to the next.
double milliseconds(const RegistrationProblem& problem, const RigidTransform& pose, int drrs) {
  const RegistrationView& view = problem.views.front();
  const auto workspace = view.renderer->make_workspace();
  std::vector<float> values(view.view.pixel_count());
  std::vector<double> times;
  for (int i = 0; i < drrs; ++i) {
    RigidTransform moved = pose;
    moved.pretranslate(Eigen::Vector3d(0.7 * (i % 5), 0.9 * (i % 7), -0.8 * (i % 3)));
    const auto begin = std::chrono::steady_clock::now();
    view.renderer->render(moved, view.view, *workspace, values);
    times.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
            .count());
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

void print_rows(const Options& options, const Communicator& world) {
  const Study study = read_study(options.study);
  const StudyCase& study_case = study.find_case(options.case_name);
  if (!study_case.gold_room_from_ct.has_value())
    throw InputError("case '" + study_case.name + "' = without gold_room_from_ct: must state it");
  const double kvp = options.spectrum.tube_kvp;
  struct Tube {
    std::string name;
    XrayBeamOptions beam;
  };
  std::vector<Tube> tubes = {{"one energy", {}}};
  const auto add_tube = [&](double change, double scatter) {
    XrayBeamOptions beam{options.spectrum, scatter};
    beam.spectrum.tube_kvp = kvp + change;
    if (!problems(beam.spectrum).empty()) return;
    char name[96];
    std::snprintf(name,
                  sizeof name,
                  "%g kV, %g mm Al%s",
                  beam.spectrum.tube_kvp,
                  beam.spectrum.aluminium_mm,
                  scatter > 0.0 ? ", scatter" : "");
    tubes.push_back({name, beam});
  };
  for (const double change : {0.0, -20.0, 20.0}) add_tube(change, 0.0);
  if (options.scatter_to_primary > 0.0) {
    tubes.push_back(
        {"one energy, scatter", {SpectrumOptions::one_energy(), options.scatter_to_primary}});
    for (const double change : {0.0, -20.0, 20.0}) add_tube(change, options.scatter_to_primary);
  }
  std::printf(
      "| DRRs | X-rays of | Bias of U | RMS | Slope | RMS about the line "
      "|%s\n|---|---|---|---|---|---|%s\n",
      options.timing_drrs > 0 ? " ms |" : "",
      options.timing_drrs > 0 ? "---|" : "");
  for (const RendererKind kind : {RendererKind::RayCast, RendererKind::Field}) {
    if (kind == RendererKind::Field && options.fields.texts.empty()) continue;
    for (const Tube& tube : tubes) {
      CaseLoadOptions loading;
      loading.renderer = kind;
      if (kind == RendererKind::Field) loading.field_paths = options.fields.by_camera();
      loading.ray_caster.step_mm = options.step_mm;
      loading.beam = tube.beam;
      loading.attenuation = options.attenuation;
      const LoadedCase loaded = load_case(study, study_case, loading, world);
      const RigidTransform& gold = *study_case.gold_room_from_ct;
      const ValueFit fit = fit_of(*loaded.problem, gold);
      std::printf("| %s | %s | %+.4f | %.4f | %.3f | %.4f |",
                  to_string(kind),
                  tube.name.c_str(),
                  fit.bias(),
                  fit.rms(),
                  fit.slope(),
                  fit.rms_about_line());
      if (options.timing_drrs > 0)
        std::printf(" %.3f |", milliseconds(*loaded.problem, gold, options.timing_drrs));
      std::printf("\n");
    }
  }
}

}  // namespace

// Only a defect in the declaration of options can throw here, and it may end the program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  Options options;
  CLI::App app{
      "DRRs at a study's gold pose against the values of its X-rays: at one energy, of the tube's "
      "spectrum, and of tubes of 20 kV less and more."};
  app.add_option("--study", options.study, "study.toml with gold_room_from_ct")->required();
  app.add_option("--case", options.case_name, "Case [the only one]");
  app.add_option("--field", options.fields.texts, "CAMERA=FIELD.af.h5; FIELD.bone.af.h5 beside it");
  app.add_option("--tube-kvp", options.spectrum.tube_kvp, "Of the X-rays")->capture_default_str();
  app.add_option("--aluminium-mm", options.spectrum.aluminium_mm, "Their filter")
      ->capture_default_str();
  app.add_option("--scatter-to-primary",
                 options.scatter_to_primary,
                 "Also DRRs with so much scatter; 0: none")
      ->capture_default_str();
  app.add_option("--water-mu-per-mm", options.attenuation.mu_water_per_mm, "Of the CT's HU scale")
      ->capture_default_str();
  app.add_option("--step-mm", options.step_mm, "Of ray casting")->capture_default_str();
  app.add_option("--timing-drrs", options.timing_drrs, "DRRs that are timed; 0: none");
  return cli::app_main(
      app, argc, argv, [&](const Communicator& world) { print_rows(options, world); });
}
