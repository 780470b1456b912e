// SPDX-License-Identifier: Apache-2.0
#include "precompute/plan/precompute_options.h"

#include <algorithm>
#include <array>
#include <charconv>

#include "base/plausible.h"
#include "base/toml_text.h"

namespace af {

namespace {

void append(const std::vector<std::string>& more, std::vector<std::string>& found) {
  found.insert(found.end(), more.begin(), more.end());
}

void append_node_problems(const char* name, int nodes, std::vector<std::string>& found) {
  constexpr int kMaxNodes = 4096;
  if (nodes < 2 || nodes > kMaxNodes)
    found.push_back(std::string(name) + " = " + std::to_string(nodes) +
                    ": must be within 2 and 4096");
}

}  // namespace

CodebookOptions PrecomputeOptions::codebook_options() const {
  CodebookOptions options;
  options.codewords = codewords;
  options.max_iterations = max_iterations;
  options.seed = seed;
  return options;
}

StPlane PrecomputeOptions::st_plane_rule() const {
  if (st_plane.empty()) return slabs == 1 ? StPlane::Centre : StPlane::Centroid;
  return st_plane == "centre" ? StPlane::Centre : StPlane::Centroid;
}

LightSlabSpec PrecomputeOptions::light_slab_spec(const DepthSlabs& depth_slabs) const {
  LightSlabSpec spec;
  spec.uv_nodes = uv_nodes;
  spec.st_nodes = st_nodes;
  spec.slab_boundaries_y_mm = depth_slabs.boundaries_y_mm;
  spec.st_plane_y_mm = depth_slabs.st_plane_y_mm;
  return spec;
}

std::vector<std::string> problems(const PrecomputeOptions& options) {
  std::vector<std::string> found = problems(options.range());
  constexpr int kMostSlabs = 64;
  if (options.slabs < 1 || options.slabs > kMostSlabs)
    found.push_back("slabs = " + std::to_string(options.slabs) + ": must be within 1 and 64");
  append_node_problems("uv_nodes", options.uv_nodes, found);
  append_node_problems("st_nodes", options.st_nodes, found);
  if (options.caster != "trilinear" && !options.is_shear_warp())
    found.push_back("caster = " + options.caster + ": must be trilinear or shear-warp");
  if (!options.st_plane.empty() && options.st_plane != "centre" && options.st_plane != "centroid")
    found.push_back("st_plane = " + options.st_plane + ": must be centre or centroid");
  if (options.overflow != "auto" && options.overflow != "read-back" &&
      options.overflow != "cast-again")
    found.push_back("overflow = " + options.overflow + ": must be auto, read-back or cast-again");
  for (const std::string& hint : options.mpi_io_hints)
    if (const std::size_t equals = hint.find('='); equals == 0 || equals >= hint.size() - 1)
      found.push_back("mpi_io_hint = " + hint + ": must be KEY=VALUE");
  append(problems(RayCasterOptions{options.step_mm}), found);
  append(problems(options.attenuation_model()), found);
  append(problems(options.codebook_options()), found);
  append(problems(options.training_selection()), found);
  if (!options.center_ct_mm.empty() && options.center_ct_mm.size() != 3)
    found.push_back("center_ct_mm has " + std::to_string(options.center_ct_mm.size()) +
                    " numbers: must be x,y,z");
  for (const double coordinate : options.center_ct_mm)
    if (!is_plausible_room_mm(coordinate))
      found.push_back("center_ct_mm = " + exact_text(coordinate) + ": " + kPlausibleRoom);
  return found;
}

TrainingSelection PrecomputeOptions::training_selection() const {
  if (training_fraction) return {*training_fraction, max_training_tiles, seed};
  const auto per_codeword = kTrainingTilesPerCodeword * static_cast<std::uint64_t>(codewords);
  return {kLargestTrainingFraction,
          std::min({max_training_tiles, per_codeword, kTrainingTilesUnlessStated}),
          seed};
}

NamedValues casting_options(const PrecomputeOptions& options) {
  return {
      {"max_rotation_deg", exact_text(options.max_rotation_deg)},
      {"max_translation_mm", exact_text(options.max_translation_mm)},
      {"slabs", std::to_string(options.slabs)},
      {"st_plane", toml_text(options.st_plane_rule() == StPlane::Centre ? "centre" : "centroid")},
      {"uv_nodes", std::to_string(options.uv_nodes)},
      {"st_nodes", std::to_string(options.st_nodes)},
      {"caster", toml_text(options.caster)},
      {"step_mm", exact_text(options.step_mm)},
      {"water_mu_per_mm", exact_text(options.water_mu_per_mm)}};
}

NamedValues codebook_options(const PrecomputeOptions& options) {
  return {{"codewords", std::to_string(options.codewords)},
          {"max_iterations", std::to_string(options.max_iterations)},
          options.training_fraction
              ? NamedValues::value_type{"training_fraction", exact_text(*options.training_fraction)}
              : NamedValues::value_type{"training_tiles_per_codeword",
                                        std::to_string(kTrainingTilesPerCodeword)},
          {"max_training_tiles", std::to_string(options.max_training_tiles)},
          {"seed", std::to_string(options.seed)}};
}

std::string to_toml(const PrecomputeOptions& options) {
  std::string text;
  const auto add_text = [&](const char* name, const std::string& value) {
    if (!value.empty()) text += std::string(name) + " = " + toml_text(value) + "\n";
  };
  add_text("ct", options.ct);
  add_text("series", options.series_uid);
  add_text("rig", options.rig);
  add_text("camera", options.camera);
  add_text("nominal_pose", options.nominal_pose);
  add_text("study", options.study);
  add_text("case", options.case_name);
  if (options.center_ct_mm.size() == 3)
    text += "center_ct_mm = [" + exact_text(options.center_ct_mm[0]) + ", " +
            exact_text(options.center_ct_mm[1]) + ", " + exact_text(options.center_ct_mm[2]) +
            "]\n";
  for (const NamedValues& values : {casting_options(options), codebook_options(options)})
    for (const auto& [name, value] : values) text.append(name).append(" = ").append(value) += '\n';
  add_text("output", options.output);
  text += "memory_limit_bytes = " + std::to_string(options.memory_limit_bytes) + "\n";
  add_text("overflow", options.overflow);
  if (!options.mpi_io_hints.empty()) {
    text += "mpi_io_hints = [";
    for (const std::string& hint : options.mpi_io_hints) text += toml_text(hint) + ", ";
    text += "]\n";
  }
  text += std::string("checkpoint = ") + (options.has_checkpoint ? "true" : "false") + "\n";
  return text;
}

std::string exact_text(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  std::string digits(text.data(), end);
  // TOML tells floats from integers by the point or exponent.
  if (digits.find_first_of(".en") == std::string::npos) digits += ".0";
  return digits;
}

}  // namespace af
