// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace af::benchmark {

/// Wall seconds of one call.
double seconds_of(const std::function<void()>& function);

/// One of the things that are compared.
struct Contender {
  std::string name;
  double work = 0.0;            ///< done by one run, in units of `unit`
  std::string unit;             ///< "rays", "tiles", "DRRs"
  std::function<double()> run;  ///< does the work once and returns the seconds that count
};

struct Timing {
  std::string name;
  double work = 0.0;
  std::string unit;
  std::vector<double> seconds;  ///< of each round

  [[nodiscard]] double median() const;
  [[nodiscard]] double minimum() const;
};

/// Runs every contender once per round. Each round begins with the next contender, so that a
/// machine that slows down slows all of them. A round that warms the caches comes first and does
/// not count.
std::vector<Timing> alternate(const std::vector<Contender>& contenders, int rounds);

/// {name: {work, unit, seconds: {median, min, max, rounds}, per_second (by the median)}}
nlohmann::json to_json(const std::vector<Timing>& timings);

/// How many times faster per unit of work `fast` is than `slow`, by the medians and by the minima.
nlohmann::json speed_ratio(const Timing& fast, const Timing& slow);

/// The timing of that name; nullptr when there was no such contender.
const Timing* find(const std::vector<Timing>& timings, const std::string& name);

double median_of(std::vector<double> values);

}  // namespace af::benchmark
