// SPDX-License-Identifier: Apache-2.0
#include "register/method/registration_options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <sstream>
#include <string_view>
#include <variant>

#include "base/error.h"
#include "base/joined.h"
#include "base/named_rows.h"
#include "base/number_text.h"
#include "drr/drr_renderer.h"

namespace af::registration {
namespace {

/// The text of a last resort begins with this.
constexpr std::string_view kLastResort = "below ";

/// The text of a chain that starts from the best end so far begins with this, after any 'below
/// VALUE:'.
constexpr std::string_view kAgain = "again:";

void add_once(const std::string& name, std::vector<std::string>& names) {
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

/// Whether the optimiser exists and its measure gives it the derivatives that it needs.
void append_optimizer_problems(const StageOptions& stage, std::vector<std::string>& found) {
  const std::vector<std::string> names = optimizer_names();
  if (std::find(names.begin(), names.end(), stage.optimizer) == names.end()) {
    found.push_back("optimizer = '" + stage.optimizer + "': must be one of " + joined(names));
    return;
  }
  const Derivatives needs = known_optimizer(stage.optimizer).needs();
  const auto serves = [&](const KnownMeasure& measure) {
    return needs == Derivatives::None ||
           (needs == Derivatives::Gradient ? measure.is_differentiable : measure.is_least_squares);
  };
  if (serves(known_measure(stage.similarity.name))) return;
  std::vector<std::string> fitting;
  for (const KnownMeasure& measure : known_measures())
    if (serves(measure)) fitting.emplace_back(measure.name);
  found.push_back("similarity = '" + stage.similarity.name + "': optimizer '" + stage.optimizer +
                  "' needs derivatives, which these have: " + joined(fitting));
}

void append_chain_problems(const ChainOptions& chain, std::vector<std::string>& found) {
  for (std::size_t i = 0; i < chain.stages.size(); ++i)
    for (const std::string& text : problems(chain.stages[i]))
      found.push_back("chain '" + chain.name + "', stage " + std::to_string(i + 1) + ": " + text);
}

template <typename Number>
bool parse(const std::string& text, Number& value) {
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && stop == end;
}

/// Visits a number of a stage. Stages have only int and double ones.
template <typename Visitor>
auto visit_number(const Field& field, const Visitor& visitor) {
  if (int* const* const whole = std::get_if<int*>(&field.value)) return visitor(**whole);
  return visitor(*std::get<double*>(field.value));
}

/// A field's key as it is typed in a chain.
std::string key_of(const Field& field) {
  return field.option.substr(field.option.find_first_not_of('-'));
}

bool set_key(StageOptions& stage, const std::string& key, const std::string& value) {
  for (const Field& field : fields_of(stage))
    if (key == key_of(field))
      return visit_number(field, [&](auto& number) { return parse(value, number); });
  return false;
}

StageOptions stage_from_text(const std::string& text) {
  StageOptions stage;
  std::istringstream words(text);
  if (!(words >> stage.similarity.name >> stage.optimizer))
    throw InputError("chain", "'" + text + "'", "a stage begins with a measure and an optimiser");
  for (std::string word; words >> word;) {
    const std::size_t equals = word.find('=');
    if (equals == std::string::npos ||
        !set_key(stage, word.substr(0, equals), word.substr(equals + 1)))
      throw InputError("chain",
                       "'" + word + "'",
                       "must be KEY=NUMBER with one of " + joined(fields_of(stage), ", ", key_of));
  }
  return stage;
}

std::string stage_text(const StageOptions& stage) {
  StageOptions mine = stage;
  StageOptions plain;
  const Fields defaults = fields_of(plain);
  std::string text = stage.similarity.name + " " + stage.optimizer;
  auto default_field = defaults.begin();
  for (const Field& field : fields_of(mine)) {
    const auto text_of = [](const auto& number) { return number_text(number); };
    const std::string value = visit_number(field, text_of);
    if (value != visit_number(*default_field++, text_of)) text += " " + key_of(field) + "=" + value;
  }
  return text;
}

}  // namespace

void StageOptions::describe(Fields& field) {
  field("level", level, "of the pyramid, each twice as coarse; 0: the field itself")
      .within(0, kCoarsestLevel);
  field("pixel_step", pixel_step, "detector pixels per stage pixel").as("pixels").within(1, 64);
  field("roi_scale", roi_scale, "size of the region, as a multiple of the study's")
      .as("roi")
      .within(0.1, 4.0);
  field(
      "smoothing_sigma_mm", smoothing_sigma_mm, "mm on the isocentre plane: Gaussian on the X-rays")
      .as("sigma")
      .at_least(0.0)
      .finite();
  field("silhouette_mm",
        silhouette_mm,
        "mm: only what is this near to the CT's silhouette counts; 0: the whole region")
      .as("silhouette")
      .within(0.0, 100.0);
  field.part(similarity);
  field.leave_out(optimizer, "stands before the keys");
  field.part(search);
}

std::vector<std::string> problems(const StageOptions& stage) {
  std::vector<std::string> found = similarity_name_problems(stage.similarity.name);
  if (found.empty()) append_optimizer_problems(stage, found);
  for (const std::string& text : field_problems(stage)) found.push_back(text);
  return found;
}

std::string chain_text(const ChainOptions& chain) {
  const std::string condition =
      chain.is_last_resort() ? std::string(kLastResort) + number_text(chain.only_below) + ": " : "";
  const std::string from = chain.from_best_end ? std::string(kAgain) + " " : "";
  return condition + from + joined(chain.stages, "; ", stage_text);
}

ChainOptions chain_from_text(const std::string& name, const std::string& text) {
  ChainOptions chain{name, {}};
  std::size_t begin = 0;
  if (text.starts_with(kLastResort)) {
    const std::size_t colon = std::min(text.find(':'), text.size());
    const std::string value = text.substr(kLastResort.size(), colon - kLastResort.size());
    if (colon == text.size() || !parse(value, chain.only_below) || !std::isfinite(chain.only_below))
      throw InputError("chain", "'" + text + "'", "a last resort begins with 'below VALUE:'");
    begin = std::min(text.find_first_not_of(' ', colon + 1), text.size());
  }
  if (text.substr(begin).starts_with(kAgain)) {
    chain.from_best_end = true;
    begin += kAgain.size();
  }
  std::istringstream stages(text.substr(begin));
  for (std::string stage; std::getline(stages, stage, ';');)
    chain.stages.push_back(stage_from_text(stage));
  return chain;
}

std::string chain_keys_help() {
  StageOptions stage;
  return joined(
      fields_of(stage), "; ", [](const Field& field) { return key_of(field) + "= " + field.help; });
}

JudgeOptions::JudgeOptions() {
  stage.similarity.name = "rg";
  stage.level = 2;
  stage.pixel_step = 4;
  stage.roi_scale = kWidestRegionScale;
}

std::vector<StageOptions*> RegistrationOptions::stages() {
  std::vector<StageOptions*> all;
  for (ChainOptions& chain : chains)
    for (StageOptions& stage : chain.stages) all.push_back(&stage);
  for (StageOptions& stage : finish.stages) all.push_back(&stage);
  return all;
}

std::vector<const StageOptions*> RegistrationOptions::stages() const {
  std::vector<const StageOptions*> all;
  for (const ChainOptions& chain : chains)
    for (const StageOptions& stage : chain.stages) all.push_back(&stage);
  for (const StageOptions& stage : finish.stages) all.push_back(&stage);
  return all;
}

void RegistrationOptions::use_similarity(const std::string& name) {
  for (StageOptions* const stage : stages()) stage->similarity.name = name;
}

void RegistrationOptions::use_optimizer(const std::string& name) {
  for (StageOptions* const stage : stages()) stage->optimizer = name;
}

std::string RegistrationOptions::similarity_list() const {
  std::vector<std::string> names;
  for (const StageOptions* const stage : stages()) add_once(stage->similarity.name, names);
  return joined(names);
}

std::string RegistrationOptions::optimizer_list() const {
  std::vector<std::string> names;
  for (const StageOptions* const stage : stages()) add_once(stage->optimizer, names);
  return joined(names);
}

std::string RegistrationOptions::final_similarity() const {
  return chains.size() > 1 ? judge.stage.similarity.name : stages().back()->similarity.name;
}

double RegistrationOptions::silhouette_mm() const {
  return stages().empty() ? 0.0 : stages().back()->silhouette_mm;
}

int RegistrationOptions::coarsest_level() const {
  int coarsest = chains.size() > 1 ? judge.stage.level : 0;
  for (const StageOptions* const stage : stages()) coarsest = std::max(coarsest, stage->level);
  return coarsest;
}

std::vector<int> RegistrationOptions::last_levels() const {
  std::set<int> levels;
  if (!finish.stages.empty()) {
    levels.insert(finish.stages.back().level);
  } else {
    for (const ChainOptions& chain : chains)
      if (!chain.stages.empty()) levels.insert(chain.stages.back().level);
  }
  return {levels.begin(), levels.end()};
}

std::vector<std::string> problems(const RegistrationOptions& options) {
  std::vector<std::string> found;
  if (options.chains.empty()) found.emplace_back("chains = none: there must be at least one");
  for (const ChainOptions& chain : options.chains) {
    if (chain.stages.empty())
      found.push_back("chain '" + chain.name + "': stages = none: there must be at least one");
    append_chain_problems(chain, found);
  }
  if (!options.chains.empty() &&
      (options.chains.front().is_last_resort() || options.chains.front().from_best_end))
    found.push_back("chain '" + options.chains.front().name +
                    "': must not begin with 'below VALUE:' or 'again:': no chain stands before it");
  append_chain_problems(options.finish, found);
  if (options.chains.size() > 1) {
    for (const std::string& text : problems(options.judge.stage)) found.push_back("judge: " + text);
    if (options.judge.stage.similarity.name != "rg")
      found.push_back("judge: similarity = '" + options.judge.stage.similarity.name +
                      "': must be rg, the measure whose value is 0 without any DRR");
  }
  if (options.max_evaluations < 1)
    found.push_back("max_evaluations = " + std::to_string(options.max_evaluations) +
                    ": must be >= 1");
  return found;
}

}  // namespace af::registration
