// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "evaluate/starts/perturbed_starts.h"
#include "parallel/communicator.h"

namespace af::evaluation {

/// Shares the measures that rank 0 asks for: every rank takes an equal part of the draws or poses.
class SharedStartMeasures final : public StartMeasures {
 public:
  SharedStartMeasures(const Communicator& world,
                      StartFrame frame,
                      const StartOptions& options,
                      std::span<const Eigen::Vector3d> target_points_ct_mm,
                      IsAdmissible is_admissible,
                      std::optional<StartLimit> limit = std::nullopt);

  // Called by rank 0, while the others serve(). An error on any rank is thrown on all ranks and
  // ends the sharing.
  std::vector<DrawVerdict> judge_draws(IndexRange draws) override;
  std::vector<double> tres_mm(std::span<const RigidTransform> room_from_ct) override;
  std::vector<UniformStart> draw_uniform(IndexRange starts) override;
  std::vector<UniformStart> draw_within_range(IndexRange starts) override;

  /// Called by the other ranks: computes parts until rank 0 calls end().
  void serve();
  /// Called by rank 0. Does nothing when an error has ended the sharing.
  void end();

 private:
  using Words = std::vector<std::uint64_t>;
  enum class Task : std::uint64_t { End, JudgeDraws, Tres, DrawUniform, DrawWithinRange };
  struct Question {
    Task task = Task::End;
    IndexRange items;
  };
  Words ask(Task task, IndexRange items, std::span<const RigidTransform> poses = {});
  std::vector<UniformStart> ask_for_starts(Task task, IndexRange starts);
  Words answer(std::vector<std::byte> bytes);
  Words part_of_answer(const Question& question, std::span<const std::byte> poses);
  Words answer_alone(const Question& question, IndexRange part, std::span<const std::byte> poses);

  const Communicator& world_;
  bool is_over_ = false;
};

/// Collective. The starts that `make` gives on rank 0. The other ranks get none; meanwhile they
/// share rank 0's measures. Errors are thrown on every rank.
StratifiedStarts starts_measured_together(
    const Communicator& world,
    SharedStartMeasures& measures,
    const std::function<StratifiedStarts(StartMeasures& measures)>& make);

}  // namespace af::evaluation
