// SPDX-License-Identifier: Apache-2.0
#include "ranks/progress_printer.h"

#include <cmath>
#include <cstdio>
#include <iostream>
#include <unistd.h>

namespace af {

namespace {

constexpr double kTerminalIntervalSeconds = 0.2;
constexpr double kPlainIntervalSeconds = 10.0;

double seconds_between(std::chrono::steady_clock::time_point a,
                       std::chrono::steady_clock::time_point b) {
  return std::chrono::duration<double>(b - a).count();
}

}  // namespace

ProgressPrinter::ProgressPrinter(std::string label, bool enabled)
    : label_(std::move(label)),
      enabled_(enabled),
      on_terminal_(isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()),
      last_print_(start_) {}

ProgressPrinter::~ProgressPrinter() {
  if (!enabled_ || !printed_) return;
  if (on_terminal_) std::cerr << "\r\033[K";
  std::cerr << label_ << ": "
            << duration_text(seconds_between(start_, std::chrono::steady_clock::now())) << '\n';
}

void ProgressPrinter::update(double done, double total) {
  if (!enabled_ || !(total > 0.0)) return;
  const auto now = std::chrono::steady_clock::now();
  const double interval = on_terminal_ ? kTerminalIntervalSeconds : kPlainIntervalSeconds;
  if (seconds_between(last_print_, now) < interval) return;
  last_print_ = now;
  printed_ = true;
  const double elapsed = seconds_between(start_, now);
  const double fraction = done / total;
  const std::string left =
      fraction > 0.0 ? duration_text(elapsed * (1.0 - fraction) / fraction) : "unknown";
  if (on_terminal_) std::cerr << "\r\033[K";
  std::cerr << label_ << ": " << static_cast<int>(std::floor(100.0 * fraction)) << " %, "
            << duration_text(elapsed) << " elapsed, " << left << " left"
            << (on_terminal_ ? "" : "\n") << std::flush;
}

ProgressCallback ProgressPrinter::callback() {
  return [this](double done, double total) { update(done, total); };
}

std::string expected_time_text(const std::string& what,
                               std::int64_t count,
                               double seconds_each,
                               int ranks) {
  const double rounds = std::ceil(static_cast<double>(count) / ranks);
  char each[32];
  std::snprintf(each, sizeof(each), "%.*f ms", seconds_each < 0.01 ? 1 : 0, 1000 * seconds_each);
  return what + ": " + std::to_string(count) + ", about " + duration_text(rounds * seconds_each) +
         " on " + std::to_string(ranks) + (ranks == 1 ? " rank" : " ranks") + " (" +
         (seconds_each < 1.0 ? std::string(each) : duration_text(seconds_each)) + " each)";
}

std::string duration_text(double seconds) {
  char text[64];
  if (seconds < 60.0) {
    std::snprintf(text, sizeof(text), "%.1f s", seconds);
    return text;
  }
  const auto whole = static_cast<long>(std::lround(seconds));
  if (whole < 3600)
    std::snprintf(text, sizeof(text), "%ld min %02ld s", whole / 60, whole % 60);
  else
    std::snprintf(text, sizeof(text), "%ld h %02ld min", whole / 3600, whole % 3600 / 60);
  return text;
}

}  // namespace af
