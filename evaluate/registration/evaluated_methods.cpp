// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/evaluated_methods.h"

#include <iostream>

#include "base/error.h"
#include "files/options_toml.h"

namespace af::evaluation {

std::vector<std::string> MethodOptions::chosen_renderers() const {
  if (renderer == "both") return {"field", "raycast"};
  return {renderer};
}

void MethodOptions::describe(Fields& field) {
  field("study", study, "study.toml: rig, cases, X-rays, gold standard").required().input();
  field.part(fields);
  field("renderer",
        renderer,
        "How DRRs are made: field (look-up), raycast, or both from the same poses")
      .choice({"field", "raycast", "both"});
  field("gold",
        gold,
        "Gold pose: fiducials (back-projected from the views), study (its gold_room_from_ct), or "
        "auto (fiducials when there are any)")
      .choice({"auto", "fiducials", "study"});
  field.part(method);
  field.part(attenuation);
  field.at("water_mu_per_mm").help = "Attenuation of water for ray casting, 1/mm";
  field.part(ray_caster);
  field.part(beam);
}

void append_problems(const MethodOptions& options, std::vector<std::string>& found) {
  for (const std::string& text : problems(options.fields)) found.push_back(text);
  if (options.renderer == "raycast" && !options.fields.texts.empty())
    found.emplace_back("--field = set: must not be given with --renderer raycast");
}

namespace {

void show_method(const registration::MethodOptions& options,
                 const std::string& /*command_line*/,
                 const Communicator& world) {
  all_or_none(world, [&] {
    const std::string text = to_toml(options);
    if (world.is_root()) std::cout << text;
  });
}

}  // namespace

cli::SubCommand method_command(CLI::App& app) {
  return cli::sub_command(
      app,
      "method",
      "Prints the chains of a preset, with the options that replace parts of it",
      show_method);
}

}  // namespace af::evaluation
