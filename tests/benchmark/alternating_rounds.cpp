// SPDX-License-Identifier: Apache-2.0
#include "benchmark/alternating_rounds.h"

#include <algorithm>
#include <chrono>

#include "base/error.h"

namespace af::benchmark {

double seconds_of(const std::function<void()>& function) {
  const auto start = std::chrono::steady_clock::now();
  function();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median_of(std::vector<double> values) {
  check(!values.empty(), "a median of at least one value");
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

double Timing::median() const {
  return median_of(seconds);
}

double Timing::minimum() const {
  return *std::min_element(seconds.begin(), seconds.end());
}

std::vector<Timing> alternate(const std::vector<Contender>& contenders, int rounds) {
  std::vector<Timing> timings;
  for (const Contender& contender : contenders) {
    timings.push_back({contender.name, contender.work, contender.unit, {}});
    contender.run();
  }
  for (int round = 0; round < rounds; ++round)
    for (std::size_t i = 0; i < contenders.size(); ++i) {
      const std::size_t turn = (static_cast<std::size_t>(round) + i) % contenders.size();
      timings[turn].seconds.push_back(contenders[turn].run());
    }
  return timings;
}

nlohmann::json to_json(const std::vector<Timing>& timings) {
  nlohmann::json json = nlohmann::json::object();
  for (const Timing& timing : timings)
    json[timing.name] = {{"work", timing.work},
                         {"unit", timing.unit},
                         {"seconds",
                          {{"median", timing.median()},
                           {"min", timing.minimum()},
                           {"max", *std::max_element(timing.seconds.begin(), timing.seconds.end())},
                           {"rounds", timing.seconds.size()}}},
                         {"per_second", timing.work / timing.median()}};
  return json;
}

nlohmann::json speed_ratio(const Timing& fast, const Timing& slow) {
  const double of_work = fast.work / slow.work;
  return {{"faster", fast.name},
          {"than", slow.name},
          {"by_median", of_work * slow.median() / fast.median()},
          {"by_minimum", of_work * slow.minimum() / fast.minimum()}};
}

const Timing* find(const std::vector<Timing>& timings, const std::string& name) {
  for (const Timing& timing : timings)
    if (timing.name == name) return &timing;
  return nullptr;
}

}  // namespace af::benchmark
