// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/design_search.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>

#include "base/error.h"

namespace af {

namespace {

/// Share of the requested size to aim for. The rest allows for forecast errors.
constexpr double kSizeMargin = 0.97;
constexpr int kMostMeasured = 5;
/// After this many measurements, a measured design may be worse by more than kLittle.
constexpr int kEnoughMeasured = 3;

/// A number with this many digits after the point.
std::string fixed(double value, int digits) {
  std::array<char, 64> text{};
  const auto end = std::to_chars(
      text.data(), text.data() + text.size(), value, std::chars_format::fixed, digits);
  return {text.data(), end.ptr};
}

std::string summary(const DesignForecast& forecast) {
  return fixed(forecast.psnr_db, 1) + " dB, " + fixed(forecast.file_bytes / 1e6, 2) + " MB, " +
         fixed(forecast.drr_ms, 3) + " ms (" + to_text(forecast.design) + ")";
}

/// All designs of the family that agree with the stated parts.
class Family {
 public:
  Family(const SearchSpace& space, bool may_be_linear) {
    const DesignParts& fixed = space.fixed;
    const auto one_or = [](const auto& stated, auto list) {
      if (stated) list = {*stated};
      return list;
    };
    slabs_ = one_or(fixed.slabs, std::vector{1, 2, 3, 4, 6, 8, 12});
    if (!fixed.slabs)
      std::erase_if(slabs_, [&](int slabs) { return slabs > 1 && slabs > space.most_slabs / 4; });
    uv_nodes_ = one_or(fixed.uv_nodes,
                       std::vector{6, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, 64, 80, 96});
    std::vector<int> st_nodes;
    for (int nodes = 96; nodes <= 1024; nodes += 8) st_nodes.push_back(nodes);
    st_nodes_ = one_or(fixed.st_nodes, st_nodes);
    codewords_ = one_or(fixed.codewords, std::vector{4096, 16384, 65536});
    look_ups_ = one_or(fixed.look_up,
                       may_be_linear ? std::vector<std::string>{"cubic", "linear"}
                                     : std::vector<std::string>{"cubic"});
    mean_step_ = fixed.mean_step.value_or(0);
    is_uv_free_ = !fixed.uv_nodes.has_value();
  }

  template <typename Visit>
  void for_each(const Visit& visit) const {
    for (const std::string& look_up : look_ups_)
      for (const int slabs : slabs_)
        for (const int uv : uv_nodes_) {
          // Fewer viewpoints always blur, and more add cost without benefit.
          constexpr int kFewest = 40;
          constexpr int kMost = 128;
          if (is_uv_free_ && (slabs * uv < kFewest || slabs * uv > kMost)) continue;
          for (const int st : st_nodes_)
            for (const int codewords : codewords_)
              visit(FieldDesign{slabs, uv, st, codewords, look_up, mean_step_});
        }
  }

 private:
  std::vector<int> slabs_;
  std::vector<int> uv_nodes_;
  std::vector<int> st_nodes_;
  std::vector<int> codewords_;
  std::vector<std::string> look_ups_;
  int mean_step_ = 0;
  bool is_uv_free_ = true;
};

/// Compares forecasts within a budget.
class Judge {
 public:
  Judge(const DesignBudget& budget, const SearchSpace& space) : budget_(budget), space_(space) {}

  [[nodiscard]] bool fits_size(const DesignForecast& forecast) const {
    return !budget_.max_field_bytes ||
           forecast.file_bytes <= kSizeMargin * static_cast<double>(*budget_.max_field_bytes);
  }
  [[nodiscard]] bool fits_time(const DesignForecast& forecast) const {
    return !budget_.max_drr_ms || forecast.drr_ms <= *budget_.max_drr_ms;
  }
  [[nodiscard]] bool fits(const DesignForecast& forecast) const {
    return fits_size(forecast) && fits_time(forecast) &&
           (!budget_.target_psnr_db || forecast.psnr_db >= *budget_.target_psnr_db);
  }
  /// Whether the forecast is not much better than was asked for.
  [[nodiscard]] bool is_near_target(const DesignForecast& forecast) const {
    constexpr double kNearDb = 0.3;
    return !budget_.target_psnr_db || forecast.psnr_db <= *budget_.target_psnr_db + kNearDb;
  }
  /// The cost of a forecast. Smaller is better.
  [[nodiscard]] double cost(const DesignForecast& forecast) const {
    // A DRR of twice the time must save a sixth of the file, or give 0.3 dB more.
    const double doublings = std::log2(std::max(forecast.drr_ms, 1e-6));
    const double size = std::log(forecast.file_bytes);
    if (budget_.target_psnr_db) return size + 0.18 * doublings;
    // A file of twice the size must give 0.05 dB more.
    return -forecast.psnr_db + 0.3 * doublings + 0.07 * size;
  }

 private:
  const DesignBudget& budget_;
  const SearchSpace& space_;
};

/// Whether the probe need not measure `design`, because it has measured one with almost the same
/// nodes.
bool is_measured(const FieldDesign& design, const DesignModel& model) {
  return std::ranges::any_of(model.points(), [&](const DesignPoint& point) {
    const FieldDesign& known = point.forecast.design;
    const double st_change = std::abs(std::log(1.0 * design.st_nodes / known.st_nodes));
    constexpr double kSmallChange = 0.12;
    return known.slabs == design.slabs && known.uv_nodes == design.uv_nodes &&
           known.codewords == design.codewords && known.look_up == design.look_up &&
           st_change < kSmallChange;
  });
}

struct Choice {
  std::optional<DesignForecast> best;
  std::optional<DesignForecast> best_measured;  ///< among designs that count as measured
  std::optional<DesignForecast> other_slabs;    ///< the best with another number of slabs
  DesignForecast highest_psnr;                  ///< among those that fit size and time
  DesignForecast smallest;                      ///< among those with the PSNR
  std::optional<DesignForecast> fastest;
  bool has_highest = false;
  bool has_smallest = false;
};

Choice choice_of(const Family& family,
                 const Judge& judge,
                 const DesignModel& model,
                 const DesignBudget& budget) {
  Choice choice;
  std::vector<DesignForecast> best_of_slabs;
  family.for_each([&](const FieldDesign& design) {
    const DesignForecast forecast = model.forecast(design);
    if (!choice.fastest || forecast.drr_ms < choice.fastest->drr_ms) choice.fastest = forecast;
    if (judge.fits_size(forecast) && judge.fits_time(forecast) &&
        (!choice.has_highest || forecast.psnr_db > choice.highest_psnr.psnr_db)) {
      choice.highest_psnr = forecast;
      choice.has_highest = true;
    }
    if (judge.fits_time(forecast) &&
        (!budget.target_psnr_db || forecast.psnr_db >= *budget.target_psnr_db) &&
        (!choice.has_smallest || forecast.file_bytes < choice.smallest.file_bytes)) {
      choice.smallest = forecast;
      choice.has_smallest = true;
    }
    if (!judge.fits(forecast)) return;
    if ((!choice.best_measured || judge.cost(forecast) < judge.cost(*choice.best_measured)) &&
        is_measured(design, model))
      choice.best_measured = forecast;
    const auto same_slabs = std::ranges::find_if(best_of_slabs, [&](const DesignForecast& best) {
      return best.design.slabs == design.slabs;
    });
    if (same_slabs == best_of_slabs.end())
      best_of_slabs.push_back(forecast);
    else if (judge.cost(forecast) < judge.cost(*same_slabs))
      *same_slabs = forecast;
  });
  std::ranges::stable_sort(best_of_slabs, [&](const DesignForecast& a, const DesignForecast& b) {
    return judge.cost(a) < judge.cost(b);
  });
  if (!best_of_slabs.empty()) choice.best = best_of_slabs.front();
  if (best_of_slabs.size() > 1) choice.other_slabs = best_of_slabs[1];
  return choice;
}

[[noreturn]] void refuse(const DesignBudget& budget, const Choice& choice) {
  std::string text = "no field meets the limits: " + to_text(budget);
  if (choice.has_highest)
    text += "; the highest PSNR within size and time: " + summary(choice.highest_psnr);
  if (choice.has_smallest)
    text += std::string("; the smallest file ") +
            (budget.target_psnr_db ? "with that PSNR: " : "within the time: ") +
            summary(choice.smallest);
  if (!choice.has_smallest && budget.max_drr_ms)
    text += "; the fastest DRR: " + summary(*choice.fastest);
  throw InputError(text);
}

/// Where a search begins: among the designs that usually win.
FieldDesign first_guess(const SearchSpace& space) {
  FieldDesign guess{8, 10, 288, 16384, "cubic"};
  if (space.most_slabs < 32) guess = {1, 64, 256, 16384, "cubic"};
  guess = space.fixed.over(guess);
  if (space.fixed.slabs && !space.fixed.uv_nodes)
    guess.uv_nodes = std::clamp((64 / guess.slabs + 1) / 2 * 2, 6, 64);
  return guess;
}

}  // namespace

ChosenDesign search_design(const DesignBudget& budget,
                           const SearchSpace& space,
                           const MeasureDesign& measure) {
  const Family family(space, budget.max_drr_ms.has_value());
  const Judge judge(budget, space);
  DesignModel model;
  ChosenDesign chosen;
  FieldDesign next = first_guess(space);
  Choice choice;
  for (int measured = 0; measured < kMostMeasured; ++measured) {
    model.add(measure(next));
    model.fit();
    chosen.measured.push_back(model.forecast(next));
    choice = choice_of(family, judge, model, budget);
    // A measured design is preferred to one that the model only forecasts to be slightly better.
    constexpr double kLittle = 0.06;
    const double allowed = measured + 1 < kEnoughMeasured ? kLittle : 3.0 * kLittle;
    if (choice.best_measured &&
        judge.cost(*choice.best_measured) <= judge.cost(*choice.best) + allowed &&
        judge.is_near_target(*choice.best_measured)) {
      choice.best = choice.best_measured;
      break;
    }
    // The model may wrongly say that nothing fits, so measure at the edge of the budget.
    if (choice.best)
      next = choice.best->design;
    else if (choice.has_highest)
      next = choice.highest_psnr.design;
    else if (choice.has_smallest)
      next = choice.smallest.design;
    if (is_measured(next, model)) break;
  }
  if (!choice.best) refuse(budget, choice);
  chosen.forecast = *choice.best;
  chosen.runner_up.design.slabs = 0;
  if (choice.other_slabs) chosen.runner_up = *choice.other_slabs;
  return chosen;
}

}  // namespace af
