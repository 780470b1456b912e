// SPDX-License-Identifier: Apache-2.0
#include "register/method/chain_text.h"

#include <array>
#include <charconv>
#include <optional>
#include <sstream>

#include "base/error.h"
#include "base/joined.h"
#include "base/number_text.h"

namespace af::registration {
namespace {

/// One key of a stage: exactly one of the members.
struct StageKey {
  const char* name;
  int* whole;
  double* real;
};

std::array<StageKey, 10> stage_keys(StageOptions& stage) {
  return {{{"level", &stage.level, nullptr},
           {"pixels", &stage.pixel_step, nullptr},
           {"roi", nullptr, &stage.roi_scale},
           {"sigma", nullptr, &stage.smoothing_sigma_mm},
           {"step", nullptr, &stage.search.initial_step_mm},
           {"final", nullptr, &stage.search.final_step_mm},
           {"bins", &stage.similarity.bins, nullptr},
           {"scale", nullptr, &stage.similarity.residual_scale},
           {"tiles", &stage.similarity.tiles, nullptr},
           {"population", &stage.search.population, nullptr}}};
}

template <typename Number>
bool parse(const std::string& text, Number& value) {
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && stop == end;
}

bool set_key(StageOptions& stage, const std::string& name, const std::string& value) {
  for (const StageKey& key : stage_keys(stage))
    if (name == key.name)
      return key.whole != nullptr ? parse(value, *key.whole) : parse(value, *key.real);
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
                       "must be KEY=NUMBER with one of level, pixels, roi, sigma, step, final, "
                       "bins, scale, tiles, population");
  }
  return stage;
}

}  // namespace

std::string stage_text(const StageOptions& stage) {
  StageOptions mine = stage;
  StageOptions plain;
  std::string text = stage.similarity.name + " " + stage.optimizer;
  const auto keys = stage_keys(mine);
  const auto defaults = stage_keys(plain);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (keys[i].whole != nullptr && *keys[i].whole != *defaults[i].whole)
      text += std::string(" ") + keys[i].name + "=" + std::to_string(*keys[i].whole);
    if (keys[i].real != nullptr && *keys[i].real != *defaults[i].real)
      text += std::string(" ") + keys[i].name + "=" + number_text(*keys[i].real);
  }
  return text;
}

std::string chain_text(const ChainOptions& chain) {
  return joined(chain.stages, "; ", stage_text);
}

ChainOptions chain_from_text(const std::string& name, const std::string& text) {
  ChainOptions chain{name, {}};
  std::istringstream stages(text);
  for (std::string stage; std::getline(stages, stage, ';');)
    chain.stages.push_back(stage_from_text(stage));
  return chain;
}

}  // namespace af::registration
