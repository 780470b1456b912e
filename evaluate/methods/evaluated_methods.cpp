// SPDX-License-Identifier: Apache-2.0
#include "evaluate/methods/evaluated_methods.h"

#include <iostream>
#include <set>
#include <sstream>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/toml_text.h"
#include "register/method_arguments.h"
#include "text/csv_table.h"
#include "volume/attenuation_volume.h"
#include "volume/ray_caster.h"

namespace af::evaluation {
namespace {

void append_problem_of_fields(const MethodOptions& options, std::vector<std::string>& found) {
  std::set<std::string> cameras;
  for (const std::string& text : options.fields) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
      found.push_back("--field = '" + text + "': must be CAMERA=PATH");
    else if (!cameras.insert(text.substr(0, equals)).second)
      found.push_back("--field = '" + text + "': this camera is given twice");
  }
  if (options.renderer == "raycast" && !options.fields.empty())
    found.emplace_back("--field = set: must not be given with --renderer raycast");
}

}  // namespace

std::vector<std::string> MethodOptions::chosen_renderers() const {
  if (renderer == "both") return {"field", "raycast"};
  return {renderer};
}

void append_problems(const MethodOptions& options, std::vector<std::string>& found) {
  append_problem_of_fields(options, found);
  AttenuationModel model;
  model.mu_water_per_mm = options.water_mu_per_mm;
  for (const std::string& text : af::problems(model)) found.push_back(text);
  for (const std::string& text : af::problems(RayCasterOptions{options.step_mm}))
    found.push_back(text);
}

std::string toml_list(const std::vector<std::string>& values) {
  std::ostringstream out;
  out << '[';
  for (std::size_t i = 0; i < values.size(); ++i)
    out << (i == 0 ? "" : ", ") << toml_text(values[i]);
  out << ']';
  return out.str();
}

std::string to_toml(const MethodOptions& options) {
  std::ostringstream out;
  out << "study = " << toml_text(options.study.string()) << "\nrenderer = \"" << options.renderer
      << "\"\ngold = \"" << options.gold
      << "\"\nwater_mu_per_mm = " << number_text(options.water_mu_per_mm)
      << "\nstep_mm = " << number_text(options.step_mm) << "\nfield = " << toml_list(options.fields)
      << '\n';
  if (!options.series_uid.empty()) out << "series = " << toml_text(options.series_uid) << '\n';
  out << to_toml(options.method, registration::resolve(options.method));
  return out.str();
}

void bind_method(CLI::App& command, MethodOptions& options) {
  command.add_option("--study", options.study, "study.toml: rig, cases, X-rays, gold standard")
      ->required();
  command
      .add_option("--field",
                  options.fields,
                  "CAMERA=FIELD.h5, once per camera; replaces the study's `field`")
      ->take_all();
  command
      .add_option("--renderer",
                  options.renderer,
                  "How DRRs are made: field (look-up), raycast, or both from the same poses")
      ->check(CLI::IsMember({"field", "raycast", "both"}))
      ->capture_default_str();
  command
      .add_option("--gold",
                  options.gold,
                  "Gold pose: fiducials (back-projected from the views), study (its "
                  "gold_room_from_ct), or auto (fiducials when there are any)")
      ->check(CLI::IsMember({"auto", "fiducials", "study"}))
      ->capture_default_str();
  bind_method(command, options.method);
  command
      .add_option("--water-mu-per-mm",
                  options.water_mu_per_mm,
                  "Attenuation of water for ray casting, 1/mm")
      ->capture_default_str();
  command.add_option("--step-mm", options.step_mm, "Longest step of ray casting, mm")
      ->capture_default_str();
  command.add_option(
      "--series", options.series_uid, "DICOM series UID, when a CT's folder has several");
}

CLI::App* bind_show_method(CLI::App& app, registration::MethodOptions& options) {
  CLI::App* command = app.add_subcommand(
      "method", "Prints the chains of a preset, with the options that replace parts of it");
  bind_method(*command, options);
  return command;
}

void show_method(const registration::MethodOptions& options, const Communicator& world) {
  all_or_none(world, [&] {
    const std::string text = to_toml(options, registration::resolve(options));
    if (world.is_root()) std::cout << text;
  });
}

}  // namespace af::evaluation
