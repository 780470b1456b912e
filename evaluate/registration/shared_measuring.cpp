// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/shared_measuring.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>

#include "parallel/work_watch.h"

namespace af::evaluation {
namespace {

using Matrix = Eigen::Matrix<double, 3, 4>;
constexpr std::size_t kMatrixBytes = sizeof(double) * Matrix::SizeAtCompileTime;

// Answers are sent as words of 64 bits that are zero on all ranks but one: their sums over the
// ranks keep every bit.

std::uint64_t word_of(const DrawVerdict& verdict) {
  return static_cast<std::uint64_t>(verdict.interval) << 1 |
         static_cast<std::uint64_t>(verdict.is_admissible);
}

DrawVerdict verdict_of(std::uint64_t word) {
  return {static_cast<int>(word >> 1), (word & 1) != 0};
}

constexpr std::size_t kUniformWords = 8;
using UniformWords = std::array<std::uint64_t, kUniformWords>;

UniformWords words_of(const UniformStart& start) {
  UniformWords words{};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    words[i] = std::bit_cast<std::uint64_t>(start.parameters.rotation_rad[axis]);
    words[i + 3] = std::bit_cast<std::uint64_t>(start.parameters.translation_mm[axis]);
  }
  words[6] = std::bit_cast<std::uint64_t>(start.initial_tre_mm);
  words[7] = start.refused;
  return words;
}

UniformStart uniform_start_of(std::span<const std::uint64_t> words) {
  UniformStart start;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    start.parameters.rotation_rad[axis] = std::bit_cast<double>(words[i]);
    start.parameters.translation_mm[axis] = std::bit_cast<double>(words[i + 3]);
  }
  start.initial_tre_mm = std::bit_cast<double>(words[6]);
  start.refused = words[7];
  return start;
}

std::vector<RigidTransform> poses_of(std::span<const std::byte> bytes, IndexRange part) {
  std::vector<RigidTransform> poses(part.count, RigidTransform::Identity());
  for (std::uint64_t i = 0; i < part.count; ++i) {
    Matrix matrix;
    std::memcpy(matrix.data(), bytes.data() + (part.first + i) * kMatrixBytes, kMatrixBytes);
    poses[i].affine() = matrix;
  }
  return poses;
}

}  // namespace

SharedStartMeasures::SharedStartMeasures(const Communicator& world,
                                         StartFrame frame,
                                         const StartOptions& options,
                                         std::span<const Eigen::Vector3d> target_points_ct_mm,
                                         IsAdmissible is_admissible,
                                         std::optional<StartLimit> limit)
    : StartMeasures(std::move(frame),
                    options,
                    target_points_ct_mm,
                    std::move(is_admissible),
                    std::move(limit)),
      world_(world) {}

std::vector<DrawVerdict> SharedStartMeasures::judge_draws(IndexRange draws) {
  std::vector<DrawVerdict> verdicts;
  verdicts.reserve(draws.count);
  for (const std::uint64_t word : ask(Task::JudgeDraws, draws))
    verdicts.push_back(verdict_of(word));
  return verdicts;
}

std::vector<double> SharedStartMeasures::tres_mm(std::span<const RigidTransform> room_from_ct) {
  std::vector<double> tres_mm;
  tres_mm.reserve(room_from_ct.size());
  for (const std::uint64_t word : ask(Task::Tres, {0, room_from_ct.size()}, room_from_ct))
    tres_mm.push_back(std::bit_cast<double>(word));
  return tres_mm;
}

std::vector<UniformStart> SharedStartMeasures::draw_uniform(IndexRange starts) {
  return ask_for_starts(Task::DrawUniform, starts);
}

std::vector<UniformStart> SharedStartMeasures::draw_within_range(IndexRange starts) {
  return ask_for_starts(Task::DrawWithinRange, starts);
}

std::vector<UniformStart> SharedStartMeasures::ask_for_starts(Task task, IndexRange starts) {
  const Words words = ask(task, starts);
  std::vector<UniformStart> drawn;
  drawn.reserve(starts.count);
  for (std::uint64_t i = 0; i < starts.count; ++i)
    drawn.push_back(uniform_start_of(std::span(words).subspan(i * kUniformWords, kUniformWords)));
  return drawn;
}

void SharedStartMeasures::serve() {
  while (!is_over_) answer({});
}

void SharedStartMeasures::end() {
  if (!is_over_) ask(Task::End, {});
}

SharedStartMeasures::Words SharedStartMeasures::ask(Task task,
                                                    IndexRange items,
                                                    std::span<const RigidTransform> poses) {
  const Question question{task, items};
  std::vector<std::byte> bytes(sizeof(question) + poses.size() * kMatrixBytes);
  std::memcpy(bytes.data(), &question, sizeof(question));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Matrix matrix = poses[i].affine();
    std::memcpy(bytes.data() + sizeof(question) + i * kMatrixBytes, matrix.data(), kMatrixBytes);
  }
  return answer(std::move(bytes));
}

/// Collective. All ranks together answer rank 0's question: kUniformWords for every item, or one
/// word.
SharedStartMeasures::Words SharedStartMeasures::answer(std::vector<std::byte> bytes) {
  world_.broadcast(bytes);
  Question question;
  std::memcpy(&question, bytes.data(), sizeof(question));
  if (question.task == Task::End) {
    is_over_ = true;
    return {};
  }
  Words words;
  try {
    words = all_or_none(world_, [&] {
      return part_of_answer(question, std::span(bytes).subspan(sizeof(question)));
    });
  } catch (...) {
    is_over_ = true;  // on every rank
    throw;
  }
  world_.sum(words);
  return words;
}

/// Words of all items; those of other ranks are zero.
SharedStartMeasures::Words SharedStartMeasures::part_of_answer(const Question& question,
                                                               std::span<const std::byte> poses) {
  // The interval at which progress is noted: a TRE takes some 0.1 ms, a uniform start up to
  // thousands of them.
  constexpr std::uint64_t kFewItems = 256;
  const bool is_uniform =
      question.task == Task::DrawUniform || question.task == Task::DrawWithinRange;
  const std::uint64_t count = question.items.count;
  const auto rank = static_cast<std::uint64_t>(world_.rank());
  const auto ranks = static_cast<std::uint64_t>(world_.size());
  const std::uint64_t end = count * (rank + 1) / ranks;
  const std::uint64_t step = is_uniform ? 1 : kFewItems;
  Words words(count * (is_uniform ? kUniformWords : 1));
  for (std::uint64_t first = count * rank / ranks; first < end; first += step) {
    const Words found = answer_alone(question, {first, std::min(step, end - first)}, poses);
    const std::size_t at = first * (is_uniform ? kUniformWords : 1);
    std::copy(found.begin(), found.end(), words.begin() + static_cast<std::ptrdiff_t>(at));
    note_progress();
    if (is_uniform && uniform_start_of(found).is_exhausted()) break;
  }
  return words;
}

/// Items [part.first, part.first + part.count) of those that were asked for.
SharedStartMeasures::Words SharedStartMeasures::answer_alone(const Question& question,
                                                             IndexRange part,
                                                             std::span<const std::byte> poses) {
  const IndexRange items{question.items.first + part.first, part.count};
  Words words;
  switch (question.task) {
    case Task::End:
      break;
    case Task::JudgeDraws:
      for (const DrawVerdict& verdict : StartMeasures::judge_draws(items))
        words.push_back(word_of(verdict));
      break;
    case Task::Tres:
      for (const double tre_mm : StartMeasures::tres_mm(poses_of(poses, part)))
        words.push_back(std::bit_cast<std::uint64_t>(tre_mm));
      break;
    case Task::DrawUniform:
      for (const UniformStart& start : StartMeasures::draw_uniform(items))
        for (const std::uint64_t word : words_of(start)) words.push_back(word);
      break;
    case Task::DrawWithinRange:
      for (const UniformStart& start : StartMeasures::draw_within_range(items))
        for (const std::uint64_t word : words_of(start)) words.push_back(word);
      break;
  }
  return words;
}

StratifiedStarts starts_measured_together(
    const Communicator& world,
    SharedStartMeasures& measures,
    const std::function<StratifiedStarts(StartMeasures& measures)>& make) {
  return all_or_none(world, [&]() -> StratifiedStarts {
    if (!world.is_root()) {
      measures.serve();
      return {};
    }
    try {
      StratifiedStarts starts = make(measures);
      measures.end();
      return starts;
    } catch (...) {
      measures.end();
      throw;
    }
  });
}

}  // namespace af::evaluation
