// SPDX-License-Identifier: Apache-2.0
#include "precompute/design_choice.h"

#include <chrono>

#include "precompute/build/field_build.h"
#include "precompute/design/design_probe.h"
#include "precompute/formatted_text.h"
#include "ranks/terminal.h"
#include "ranks/work_watch.h"

namespace af {

namespace {

/// Look-ups and codebook sizes that deserve a point of the model.
std::vector<DesignPoint> points_of(const DesignMeasurement& measured, const DesignParts& stated) {
  std::vector<DesignPoint> points;
  for (const auto& [codewords, bytes] : measured.bytes_per_tile)
    for (const char* look_up : {"linear", "cubic"})
      if (!stated.look_up || *stated.look_up == look_up)
        points.push_back(measured.point(codewords, look_up));
  return points;
}

std::string forecast_text(const DesignForecast& forecast) {
  return formatted("%.1f dB (interpolation %.1f, quantisation %.1f), %.2f MB, %.2f ms per DRR: ",
                   forecast.psnr_db,
                   forecast.interpolation_db,
                   forecast.quantisation_db,
                   forecast.file_bytes / 1e6,
                   forecast.drr_ms) +
         to_text(forecast.design);
}

/// Collective.
DesignChoice choose_design(const FieldSource& source,
                           const SlabAlignedVolume& resampled,
                           const PrecomputeOptions& options,
                           const Communicator& communicator) {
  const auto start = std::chrono::steady_clock::now();
  const CodebookReduction reduction = reduction_over(communicator);
  ProbeScene scene{*source.volume,
                   resampled,
                   resampled.slice_sums(),
                   source.camera,
                   source.frame,
                   source.range,
                   source.quantizer(),
                   std::nullopt,
                   options.caster,
                   options.ray_caster,
                   source.sources};
  if (options.st_plane) scene.st_plane = options.st_plane_rule();
  ProbeOptions probe_options;
  probe_options.seed = options.seed;
  probe_options.selection_for = [&](int codewords) {
    return options.training_selection(codewords);
  };
  const auto ranks = static_cast<std::size_t>(communicator.size());
  ProbeRays rays = all_or_none(communicator, [&] {
    return draw_probe_rays(scene, {}, options.seed, {reduction.rank, ranks});
  });
  const DesignProbe probe(scene, probe_options, std::move(rays), reduction, ranks);
  const bool is_stated = options.budget.is_stated();
  const DesignBudget budget = is_stated ? options.budget : options.design_preset().budget;
  SearchSpace space;
  space.fixed = options.stated_parts();
  space.most_slabs = scene.most_slabs();
  DesignChoice choice;
  choice.asked = to_text(budget);
  choice.chosen = search_design(budget, space, [&](const FieldDesign& design) {
    const std::array<int, 1> codewords = {design.codewords};
    return points_of(probe.measure(design, codewords), space.fixed);
  });
  choice.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return choice;
}

/// The text printed about a choice.
std::string choice_text(const DesignChoice& choice) {
  std::string text =
      "design for " + choice.asked + formatted(", by a probe of %.1f s\n", choice.seconds);
  for (const DesignForecast& measured : choice.chosen.measured)
    text += "  measured  " + forecast_text(measured) + "\n";
  if (choice.chosen.runner_up.design.slabs > 0)
    text += "  second    " + forecast_text(choice.chosen.runner_up) + "\n";
  return text + "  chosen    " + forecast_text(choice.chosen.forecast);
}

}  // namespace

std::optional<DesignChoice> chosen_design(const std::vector<FieldPart>& parts,
                                          const PrecomputeOptions& options,
                                          PrecomputeRun& run) {
  if (!options.needs_probe()) return std::nullopt;
  const WorkNote note("probing designs", WorkNote::Kind::Phase);
  const FieldPart& part = parts[parts.size() / 2];
  DesignChoice choice = all_or_none(
      run.world, [&] { return choose_design(part.source, *part.resampled, options, run.world); });
  inform(run.world, choice_text(choice));
  run.clock.end("probe");
  return choice;
}

}  // namespace af
