// SPDX-License-Identifier: Apache-2.0
// What runs once per DRR allocates no memory.
#include <cmath>

#include <gtest/gtest.h>

#include "drr/field_level.h"
#include "drr/two_pass_af_drr.h"
#include "register/method/presets.h"
#include "register/problem/multi_view_objective.h"
#include "support/counted_allocations.h"
#include "unit/drr/small_fields.h"
#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

/// Allocations by all threads while `work` runs.
template <typename Work>
long allocations_of(const Work& work) {
  const long before = test::allocation_count();
  work();
  return test::allocation_count() - before;
}

/// Whether `work` stops allocating after some repetitions. Each thread allocates once, when it
/// first takes a part, and on a busy machine one may sleep through hundreds of repetitions. Work
/// that allocates every time never settles.
template <typename Work>
bool settles(const Work& work) {
  constexpr int kInARow = 20;
  int in_a_row = 0;
  for (int i = 0; i < 3000 && in_a_row < kInARow; ++i)
    in_a_row = allocations_of(work) == 0 ? in_a_row + 1 : 0;
  return in_a_row == kInARow;
}

double bumps(const RayNodes& n) {
  return std::round(3000.0 + 800.0 * std::sin(0.35 * n.s + 0.2 * n.u) * std::cos(0.3 * n.t) +
                    400.0 * std::cos(0.5 * n.v + 0.25 * n.t));
}

TEST(Allocation, IsCounted) {
  const auto allocate = [] { ::operator delete(::operator new(8)); };
  EXPECT_EQ(allocations_of(allocate), 1);
  EXPECT_FALSE(settles(allocate));
}

TEST(Allocation, NoneIsMadeByALookUpOnceItsWorkspaceIsWarm) {
  const auto field = small_field(bumps, 2, 7, 41);
  const View view = View::whole_detector(small_camera());
  const std::size_t pixels = view.pixel_count();
  std::vector<float> drr(pixels);
  std::vector<float> planes(6 * pixels);
  std::vector<float> columns(pixels);
  std::vector<float> rows(pixels);
  const auto pool = std::make_shared<ThreadPool>(3);
  for (const TwoPassOptions& options :
       {TwoPassOptions{},
        TwoPassOptions{.sums_on_more_nodes = true},
        TwoPassOptions{AxisInterpolation::Cubic},
        TwoPassOptions{AxisInterpolation::Cubic, AxisInterpolation::Cubic}}) {
    const TwoPassAfDrr compressed(field, options, pool);
    const TwoPassAfDrr level(make_field_pyramid(field, 1).front(), options, pool);
    for (const TwoPassAfDrr* renderer : {&compressed, &level}) {
      const auto workspace = renderer->make_workspace();
      const auto render_all = [&] {
        for (std::uint64_t i = 0; i < 10; ++i) {
          const RigidTransform pose = pose_from_parameters({}, small_pose(i));
          const PoseGradients gradients{Eigen::Vector3d(1.0, 2.0, 3.0), planes};
          renderer->render(pose, view, *workspace, drr);
          renderer->render(pose, view, *workspace, drr, gradients);
          renderer->render_gradient_images(pose, view, *workspace, columns, rows);
        }
      };
      EXPECT_TRUE(settles(render_all));
    }
  }
}

/// Two views of a small field, compared with its own DRRs at another pose.
MultiViewObjective field_objective(const std::string& similarity, int threads) {
  const auto renderer = std::make_shared<const TwoPassAfDrr>(small_field(bumps, 1, 7, 41));
  const View view = View::whole_detector(small_camera());
  SimilarityReference reference;
  reference.xray = render_image(*renderer, pose_from_parameters({}, small_pose(1)), view);
  reference.drr_range = {0.0, 10000.0};
  SimilarityOptions options;
  options.name = similarity;
  options.has_smooth_histogram = known_measure(similarity).is_differentiable;
  const std::shared_ptr<const SimilarityMeasure> measure = make_similarity(options, reference);
  const ObjectiveView one{view, renderer, measure, std::nullopt};
  return MultiViewObjective({one, one}, std::make_shared<ThreadPool>(threads));
}

class AllocationOf : public testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(Measures, AllocationOf, testing::ValuesIn(similarity_names()));

TEST_P(AllocationOf, AnEvaluationIsZeroAfterTheFirstOnes) {
  std::vector<RigidTransform> poses;
  for (std::uint64_t i = 0; i < 12; ++i) poses.push_back(pose_from_parameters({}, small_pose(i)));
  std::vector<ObjectiveValue> values(poses.size());
  NormalEquations equations;
  for (const int threads : {1, 2}) {
    MultiViewObjective objective = field_objective(GetParam(), threads);
    const auto evaluate = [&] {
      objective.evaluate_all(poses, values);
      for (const RigidTransform& pose : poses) {
        objective.evaluate(pose);
        if (known_measure(GetParam()).is_differentiable)
          objective.evaluate_with(pose, {1.0, 2.0, 3.0}, Derivatives::Gradient, equations);
        if (known_measure(GetParam()).is_least_squares)
          objective.evaluate_with(pose, {1.0, 2.0, 3.0}, Derivatives::NormalEquations, equations);
      }
    };
    EXPECT_TRUE(settles(evaluate)) << threads << " threads";
  }
}

TEST_P(AllocationOf, ARegistrationDoesNotGrowWithItsEvaluations) {
  const test::SmallCase small = test::small_case();
  RegistrationOptions options = preset_options("paper");
  options.use_similarity(GetParam());
  Registration registration(small.problem, options);
  const RegistrationResult result = registration.search(small.problem->nominal_room_from_ct);
  ASSERT_GT(result.evaluations, 100);
  const long allocations =
      allocations_of([&] { (void)registration.search(small.problem->nominal_room_from_ct); });
  // A few per stage and a trace that doubles its memory, whatever the number of evaluations.
  constexpr long kMostAllocations = 40;
  EXPECT_LE(allocations, kMostAllocations) << result.evaluations << " evaluations";
}

}  // namespace
}  // namespace af::registration
