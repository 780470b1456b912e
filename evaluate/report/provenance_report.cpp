// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <map>
#include <sstream>
#include <string_view>

#include "evaluate/report/html_text.h"
#include "evaluate/report/number_html.h"
#include "evaluate/report/sections_report.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

/// "key = value" lines of an options text.
std::map<std::string, std::string> option_lines(const std::string& text) {
  std::map<std::string, std::string> options;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t equals = line.find('=');
    if (line.starts_with("#") || equals == std::string::npos) continue;
    const auto trimmed = [](const std::string& part) {
      const std::size_t first = part.find_first_not_of(" \"");
      const std::size_t last = part.find_last_not_of(" \"");
      return first == std::string::npos ? std::string() : part.substr(first, last - first + 1);
    };
    options[trimmed(line.substr(0, equals))] = trimmed(line.substr(equals + 1));
  }
  return options;
}

/// "100" of "100.0".
std::string plain_number(std::string text) {
  if (text.ends_with(".0")) text.resize(text.size() - 2);
  return text;
}

struct OptionLabel {
  const char* key;
  const char* label;
  const char* unit;
};

constexpr std::array<OptionLabel, 13> kSimulationLabels = {
    {{"tube-kvp", "Tube voltage", "kV"},
     {"aluminium-mm", "Filter", "mm aluminium"},
     {"energy-bins", "Spectrum", "energy bins"},
     {"scatter-to-primary", "Scatter-to-primary ratio", ""},
     {"scatter-sigma-mm", "Scatter kernel, sigma", "mm"},
     {"photons-per-pixel", "Photons per pixel, open beam (Poisson noise)", ""},
     {"blur-sigma-px", "Detector blur, sigma", "pixels"},
     {"bits", "Quantisation", "bits"},
     {"rays-per-pixel-side", "Rays per pixel side", ""},
     {"fiducial-sigma-px", "Noise of the fiducials' detected positions", "pixels"},
     {"max-offset-rotation-deg", "True pose: drawn within, per angle", "degrees of nominal"},
     {"max-offset-translation-mm", "True pose: drawn within, per axis", "mm of nominal"},
     {"seed", "Seed", ""}}};

/// What the X-rays have beyond a clean simulation, one item per effect; empty when nothing.
std::string stress_text(const json& simulation) {
  std::string items;
  for (const json& effect : simulation.value("stress", json::array()))
    items += element("li",
                     "<strong>" + escaped(effect.value("name", "")) +
                         "</strong>: " + escaped(effect.value("text", "")));
  if (items.empty()) return "";
  return element("p",
                 "The X-rays are harder than that, as real ones are (<code>--stress</code>):") +
         element("ul", items);
}

bool has_stress(const json& simulation, const std::string& name) {
  const json stress = simulation.value("stress", json::array());
  return std::any_of(
      stress.begin(), stress.end(), [&](const json& e) { return e.value("name", "") == name; });
}

/// What the X-rays were taken of: the registered CT, or what the stress made of one of both.
const char* imaged_ct_text(const json& simulation) {
  const bool is_degraded = has_stress(simulation, "degraded-ct");
  const bool is_moved = has_stress(simulation, "motion");
  if (is_degraded && is_moved)
    return " through the original CT after a motion that deformed it (the CT that is registered is "
           "a degraded one, from before the motion),";
  if (is_degraded) return " through the original CT (the CT that is registered is a degraded one),";
  if (is_moved)
    return " through the CT after a motion that deformed it (the CT that is registered is from "
           "before the motion),";
  return " through the CT itself,";
}

std::string simulation_text(const json& simulation) {
  const auto options = option_lines(simulation.value("options_toml", ""));
  std::vector<std::pair<std::string, std::string>> items;
  for (const OptionLabel& label : kSimulationLabels)
    if (const auto found = options.find(label.key); found != options.end())
      items.emplace_back(
          label.label,
          escaped(plain_number(found->second)) + (*label.unit ? " " : "") + label.unit);
  const auto ideal = options.find("ideal");
  const bool is_ideal = ideal != options.end() && ideal->second == "true";
  const std::string stress = stress_text(simulation);
  std::string text = element(
      "p",
      "The X-rays were simulated by <code>af-simulate</code> " +
          escaped(simulation.value("program_version", "")) + imaged_ct_text(simulation) +
          " by an exact projector (Siddon) instead of the ray caster that "
          "made the fields, with a polychromatic spectrum, scatter, noise and detector blur, so "
          "that the images differ from any DRR as X-rays do.");
  if (is_ideal)
    text =
        element("p",
                "The X-rays were simulated by <code>af-simulate</code> " +
                    escaped(simulation.value("program_version", "")) + imaged_ct_text(simulation) +
                    " with <strong>every effect switched off</strong> (<code>--ideal</code>)" +
                    (stress.empty() ? ": they are line integrals, and errors are smaller than "
                                      "with X-rays."
                                    : " but those named below."));
  return text + (is_ideal ? "" : definition_list(items)) + stress;
}

std::string hashes_text(const json& hashes) {
  std::string text;
  for (const auto& [name, hash] : hashes.items())
    text += escaped(name) + "<br><span class=\"hash\">" + escaped(hash.get<std::string>()) +
            "</span><br>";
  return text.empty() ? "–" : text;
}

std::string title_of_kind(std::string_view kind) {
  if (kind == "registration") return "Registration";
  if (kind == "similarity-curves") return "Similarity curves";
  if (kind == "error-budget") return "Error budget";
  return kind == "field-parameters" ? "Field parameters" : "Image quality";
}

std::string run_provenance(const EvaluationRun& run) {
  const json& provenance = run.summary.at("provenance");
  const auto text = [&](const char* key) {
    const json value = provenance.value(key, json());
    return value.is_string() ? escaped(value.get<std::string>()) : plain(value);
  };
  const json host = provenance.value("host", json::object());
  const std::string link = run.link("reproduce.sh");
  return element("h3", title_of_kind(run.kind) + ": " + escaped(run.name)) +
         definition_list(
             {{"Program",
               text("program") + " " + text("program_version") + ", commit " +
                   escaped(provenance.value("program_commit", "unknown"))},
              {"Started (UTC)", text("started_utc")},
              {"Compiler, processor",
               text("compiler") + ", " + escaped(host.value("cpu", "unknown")) + " (" +
                   plain(host.value("vector_bits", json())) + "-bit vectors)"},
              {"Ranks", text("rank_count")},
              {"Seed", text("seed")},
              {"Inputs, SHA-256", hashes_text(provenance.value("input_sha256", json::object()))},
              {"Script that repeats it", "<a href=\"" + link + "\">" + link + "</a>"}}) +
         element("pre", text("command_line")) + element("pre", text("options_toml"));
}

}  // namespace

std::string xray_section(const std::vector<EvaluationRun>& runs) {
  // Runs of one study say the same: it is said once, with their names.
  std::vector<std::pair<std::string, std::string>> texts;
  for (const EvaluationRun* run : runs_of(runs, "registration")) {
    const json& simulation = run->summary.at("simulation");
    const std::string text = simulation.is_object()
                                 ? simulation_text(simulation)
                                 : element("p",
                                           "Nothing beside the study says that its X-rays were "
                                           "simulated: they are taken to be real.");
    const auto same = std::find_if(
        texts.begin(), texts.end(), [&](const auto& entry) { return entry.first == text; });
    if (same == texts.end())
      texts.emplace_back(text, escaped(run->name));
    else
      same->second += ", " + escaped(run->name);
  }
  if (texts.empty()) return "";
  std::string result = section_heading("How the X-rays were made", "xrays");
  for (const auto& [text, names] : texts)
    result += (texts.size() > 1 ? element("h3", names) : "") + text;
  return result;
}

std::string definitions_section() {
  return section_heading("What the words mean", "words") +
         definition_list(
             {{"DRR",
               "Digitally reconstructed radiograph: an image of line integrals through the CT, "
               "dimensionless."},
              {"Attenuation field",
               "The line integrals of all rays of a motion range, tabulated on two planes, "
               "vector-quantised; a DRR is a look-up (Russakoff et al., IEEE TMI 24(11), 2005)."},
              {"TRE",
               "Target registration error: the mean distance, over points 2 mm apart or less in "
               "the target box, between where the found pose and the gold pose put them; mm."},
              {"Gold pose",
               "From fiducials: each is back-projected from all views, and the CT's fiducials are "
               "fitted to these points rigidly (Arun 1987). FRE is the RMS residual of that fit; "
               "a ray gap the shortest distance between the two views' rays."},
              {"Gold standard by itself",
               "The mean TRE that the fiducials' gold pose has with respect to the true pose, by "
               "Monte Carlo on the residuals of the fiducials; a TRE below it is not measured. "
               "Leave-one-out: how far a fiducial lies from where the pose fitted to the others "
               "puts it (RMS)."},
              {"Stated pose",
               "The pose that the study itself gives (gold_room_from_ct); for simulated X-rays "
               "the true one, free of the fiducials' detection noise."},
              {"Success", "TRE below 2.5 mm. Failures of every kind stay in the denominator."},
              {"mRPD",
               "Mean reprojection distance: of a target point at the gold pose from the line "
               "through the source and the same point at the found pose; mm (van de Kraats et al., "
               "IEEE TMI 24(9), 2005)."},
              {"95 % interval",
               "Wilson's score interval. It treats starts as independent; starts of one patient "
               "share a CT and its X-rays, so it says nothing about other patients."},
              {"PSNR",
               "20 log<sub>10</sub>(I<sub>max</sub> / RMS difference), I<sub>max</sub> the "
               "reference's maximum, over pixels whose ray meets matter; dB."}});
}

std::string provenance_section(const std::vector<EvaluationRun>& runs) {
  std::string text = section_heading("Provenance", "provenance");
  for (const EvaluationRun& run : runs) text += run_provenance(run);
  return text;
}

}  // namespace af::evaluation
