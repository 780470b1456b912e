// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "register/method/presets.h"
#include "register/registration_run.h"
#include "register/results/registration_results.h"
#include "support/shared_folder.h"
#include "unit/register/method/narrow_drr.h"
#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

std::vector<RigidTransform> some_starts(const test::SmallCase& small, int count) {
  const PoseFrame frame = PoseFrame::about(small.gold_room_from_ct, small.problem->center_ct_mm);
  std::vector<RigidTransform> starts;
  for (int i = 0; i < count; ++i) {
    HashRandom random(7, static_cast<std::uint64_t>(i));
    std::array<double, 6> values{};
    for (double& value : values) value = random.uniform(-3.0, 3.0);
    starts.push_back(pose_from_parameters(frame, PoseParameters::from_deg_and_mm(values)));
  }
  return starts;
}

RegistrationOptions quick_options() {
  RegistrationOptions options = preset_options("paper");
  options.max_evaluations = 60;
  for (StageOptions& stage : options.chains.front().stages) stage.similarity.bins = 24;
  return options;
}

Registration registration_of(const test::SmallCase& small) {
  Registration registration(small.problem, quick_options());
  registration.examine_ends({});
  return registration;
}

TEST(RegisterStarts, GivesTheRecordsOfASerialRunOnAnyRankCount) {
  const Communicator world = Communicator::world();
  const test::SmallCase small = test::small_case();
  const std::vector<RigidTransform> starts = some_starts(small, 7);
  Registration registration = registration_of(small);
  const test::SharedFolder folder;
  const std::vector<RegistrationRecord> records =
      register_starts(registration, starts, {folder / "p", "registrations", {}}, world);
  if (!world.is_root()) {
    EXPECT_TRUE(records.empty());
    return;
  }
  ASSERT_EQ(records.size(), starts.size());
  const std::size_t best = best_record(records);
  for (std::size_t i = 0; i < records.size(); ++i) {
    const RegistrationResult expected = registration.search(starts[i]);
    const RegistrationResult& found = records[i].result;
    EXPECT_EQ(records[i].start_index, static_cast<std::int64_t>(i));
    EXPECT_EQ(found.start_room_from_ct.matrix(), starts[i].matrix());
    EXPECT_EQ(found.room_from_ct.matrix(), expected.room_from_ct.matrix());
    EXPECT_EQ(found.similarity, expected.similarity);
    EXPECT_EQ(found.evaluations, expected.evaluations);
    EXPECT_EQ(found.drr_count, expected.drr_count);
    EXPECT_EQ(found.stop_reason, expected.stop_reason);
    EXPECT_LE(found.similarity, records[best].result.similarity);
    ASSERT_EQ(found.trace.size(), i == best ? expected.trace.size() : 0U);
  }
  const TraceRow& last = records[best].result.trace.back();
  EXPECT_EQ(last.similarity, records[best].result.similarity);
  EXPECT_EQ(last.evaluations, records[best].result.evaluations);
}

TEST(RegisterStarts, CopesWithFewerStartsThanRanks) {
  const Communicator world = Communicator::world();
  const test::SmallCase small = test::small_case();
  Registration registration = registration_of(small);
  const test::SharedFolder folder;
  const UnfinishedWork work = {folder / "p", "registrations", {}};
  const auto records = register_starts(registration, some_starts(small, 1), work, world);
  EXPECT_EQ(records.size(), world.is_root() ? 1U : 0U);
  // With one start there is no unfinished work to keep.
  EXPECT_FALSE(std::filesystem::exists(work.folder));
  EXPECT_TRUE(register_starts(registration, {}, work, world).empty());
}

TEST(RegisterStarts, KeepsTheTraceOfTheFirstWhenNoStartHasASimilarity) {
  const Communicator world = Communicator::world();
  const test::SmallCase small = test::small_case();
  for (RegistrationView& view : small.problem->views)
    view.renderer = std::make_shared<const test::NarrowDrr>(
        view.renderer, small.problem->nominal_room_from_ct, 1e-6);
  Registration registration = registration_of(small);
  const test::SharedFolder folder;
  const auto records = register_starts(
      registration, some_starts(small, 5), {folder / "p", "registrations", {}}, world);
  if (!world.is_root()) return;
  ASSERT_EQ(records.size(), 5U);
  EXPECT_EQ(best_record(records), 0U);
  for (const RegistrationRecord& record : records)
    EXPECT_EQ(record.result.stop_reason, StopReason::StartInadmissible);
}

}  // namespace
}  // namespace af::registration
