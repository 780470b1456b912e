// SPDX-License-Identifier: Apache-2.0
#include "register/problem/multi_view_objective.h"

#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

#include <gtest/gtest.h>

#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

/// Counts its calls and reports rays outside beyond tx = 3 mm.
class CountingRenderer final : public DrrRenderer {
 public:
  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& /*view*/,
                      RenderWorkspace& /*workspace*/,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& /*gradients*/) const override {
    ++calls;
    for (float& value : total_attenuation) value = 0.0f;
    return {room_from_ct.translation().x() > 3.0 ? 7 : 0};
  }
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override {
    return std::make_unique<RenderWorkspace>();
  }
  [[nodiscard]] const char* name() const override { return "counting"; }
  mutable std::atomic<int> calls = 0;
};

class ConstantMeasure final : public SimilarityMeasure {
 public:
  explicit ConstantMeasure(double value) : value_(value) {}
  [[nodiscard]] double evaluate(std::span<const float> /*drr*/,
                                SimilarityWorkspace& /*workspace*/) const override {
    return value_;
  }
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override {
    return std::make_unique<SimilarityWorkspace>();
  }

 private:
  double value_;
};

struct Fixture {
  std::shared_ptr<CountingRenderer> renderer = std::make_shared<CountingRenderer>();

  [[nodiscard]] MultiViewObjective objective(const std::optional<MotionLimit>& limit = std::nullopt,
                                             int threads = 1) const {
    std::vector<ObjectiveView> views;
    for (int i = 0; i < 3; ++i) {
      ObjectiveView view;
      view.view.camera = test::small_camera(i % 2 == 1);
      view.view.roi = {0, 0, 4, 4};
      view.renderer = renderer;
      view.measure = std::make_shared<ConstantMeasure>(1.0 + i);
      view.limit = limit;
      views.push_back(view);
    }
    return MultiViewObjective(std::move(views), std::make_shared<ThreadPool>(threads));
  }
};

RigidTransform shifted(double tx_mm) {
  RigidTransform pose = RigidTransform::Identity();
  pose.translation().x() = tx_mm;
  return pose;
}

TEST(MultiViewObjective, IsTheSumOverItsViews) {
  const Fixture fixture;
  const ObjectiveValue value = fixture.objective().evaluate(shifted(0.0));
  EXPECT_TRUE(value.is_admissible);
  EXPECT_EQ(value.similarity, 1.0 + 2.0 + 3.0);
  EXPECT_EQ(value.drr_count, 3);
}

TEST(MultiViewObjective, APoseWithARayOutsideIsInadmissible) {
  const Fixture fixture;
  const ObjectiveValue value = fixture.objective().evaluate(shifted(3.5));
  EXPECT_FALSE(value.is_admissible);
  EXPECT_TRUE(std::isnan(value.similarity));
  EXPECT_EQ(value.rays_outside, 7);
  // The first view decides; the others are not rendered.
  EXPECT_EQ(fixture.renderer->calls, 1);
}

TEST(MultiViewObjective, APoseBeyondTheMotionRangeCostsNoDrr) {
  const Fixture fixture;
  MotionLimit limit;
  limit.range = {limit.range.max_rotation_rad(), 2.0};
  const ObjectiveValue value = fixture.objective(limit).evaluate(shifted(2.5));
  EXPECT_FALSE(value.is_admissible);
  EXPECT_EQ(value.drr_count, 0);
  EXPECT_EQ(fixture.renderer->calls, 0);
  EXPECT_TRUE(fixture.objective(limit).evaluate(shifted(1.5)).is_admissible);
}

TEST(MultiViewObjective, PosesTogetherHaveTheValuesThatTheyHaveAlone) {
  const Fixture fixture;
  MotionLimit limit;
  limit.range = {limit.range.max_rotation_rad(), 5.0};
  std::vector<RigidTransform> poses;
  for (int i = 0; i < 40; ++i) poses.push_back(shifted(0.25 * i));  // inside, outside, beyond
  MultiViewObjective alone = fixture.objective(limit);
  for (const int threads : {1, 2, 5}) {
    MultiViewObjective together = fixture.objective(limit, threads);
    std::vector<ObjectiveValue> values(poses.size());
    together.evaluate_all(poses, values);
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const ObjectiveValue expected = alone.evaluate(poses[i]);
      EXPECT_EQ(values[i].is_admissible, expected.is_admissible);
      if (expected.is_admissible) {
        EXPECT_EQ(values[i].similarity, expected.similarity);
      }
      EXPECT_EQ(values[i].drr_count, expected.drr_count);
      EXPECT_EQ(values[i].rays_outside, expected.rays_outside);
    }
  }
}

/// Renders the tx of a remembered pose. A pose more than 2 mm away replaces that one, and rays are
/// outside beyond 3 mm.
class RememberingRenderer final : public DrrRenderer {
 public:
  explicit RememberingRenderer(std::chrono::milliseconds delay) : delay_(delay) {}
  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& /*view*/,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& /*gradients*/) const override {
    std::this_thread::sleep_for(delay_);
    auto& memory = dynamic_cast<Memory&>(workspace);
    const double tx_mm = room_from_ct.translation().x();
    if (!memory.tx_mm || std::abs(*memory.tx_mm - tx_mm) > 2.0) memory.tx_mm = tx_mm;
    for (float& value : total_attenuation) value = static_cast<float>(*memory.tx_mm);
    if (!memory.is_allowed) memory.tx_mm.reset();
    return {tx_mm > 3.0 ? 7 : 0};
  }
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override {
    return std::make_unique<Memory>();
  }
  [[nodiscard]] const char* name() const override { return "remembering"; }

 private:
  struct Memory final : RenderWorkspace {
    bool is_allowed = false;
    std::optional<double> tx_mm;

    void reuse_images(bool allowed) override {
      is_allowed = allowed;
      tx_mm.reset();
    }
  };

  std::chrono::milliseconds delay_;
};

class FirstPixel final : public SimilarityMeasure {
 public:
  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& /*workspace*/) const override {
    return static_cast<double>(drr.front());
  }
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override {
    return std::make_unique<SimilarityWorkspace>();
  }
};

/// Where threads share the views, the first view's DRR comes last.
MultiViewObjective remembering_objective(int threads) {
  std::vector<ObjectiveView> views;
  for (int i = 0; i < 3; ++i) {
    ObjectiveView view;
    view.view.camera = test::small_camera(false);
    view.view.roi = {0, 0, 4, 4};
    view.renderer =
        std::make_shared<RememberingRenderer>(std::chrono::milliseconds(i == 0 ? 20 : 0));
    view.measure = std::make_shared<FirstPixel>();
    views.push_back(view);
  }
  return MultiViewObjective(std::move(views), std::make_shared<ThreadPool>(threads));
}

TEST(MultiViewObjective, ReusesImagesAlikeOnAnyNumberOfThreads) {
  for (const int threads : {1, 2, 5}) {
    MultiViewObjective objective = remembering_objective(threads);
    EXPECT_EQ(objective.evaluate(shifted(0.5)).similarity, 3 * 0.5);
    EXPECT_EQ(objective.evaluate(shifted(1.0)).similarity, 3 * 1.0);  // nothing is reused yet
    objective.reuse_images(true);
    EXPECT_EQ(objective.evaluate(shifted(0.5)).similarity, 3 * 0.5);
    EXPECT_EQ(objective.evaluate(shifted(1.0)).similarity, 3 * 0.5);
    // With threads, later views are rendered before the first one refuses the pose.
    EXPECT_FALSE(objective.evaluate(shifted(3.25)).is_admissible);
    EXPECT_EQ(objective.evaluate(shifted(1.5)).similarity, 3 * 1.5);
    EXPECT_EQ(objective.evaluate(shifted(2.0)).similarity, 3 * 1.5);
    const std::vector<RigidTransform> poses = {shifted(2.0), shifted(2.25)};
    std::vector<ObjectiveValue> values(poses.size());
    objective.evaluate_all(poses, values);  // ends the reuse
    EXPECT_EQ(values[0].similarity, 3 * 2.0);
    EXPECT_EQ(values[1].similarity, 3 * 2.25);
    EXPECT_EQ(objective.evaluate(shifted(1.0)).similarity, 3 * 1.0);
  }
}

}  // namespace
}  // namespace af::registration
