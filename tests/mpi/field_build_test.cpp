// SPDX-License-Identifier: Apache-2.0
#include "precompute/build/field_build.h"

#include <array>
#include <atomic>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/stored_bytes.h"
#include "base/vector_width.h"
#include "field/field_reading.h"
#include "precompute/build/field_encoder.h"
#include "precompute/build/training_journal.h"
#include "precompute/casting/slab_aligned_volume.h"
#include "precompute/casting/trilinear_caster.h"
#include "precompute/casting/unit_costs.h"
#include "precompute/casting/unit_planner.h"
#include "ranks/values_of_ranks.h"
#include "support/ct_phantoms.h"
#include "support/shared_folder.h"
#include "unit/precompute/casting/shear_warp_cases.h"

namespace af {
namespace {

// Made by these tests on one rank with the widest vectors. Any rank count, plan and vector width
// must give the same, because all operations are correctly rounded.
constexpr const char* kFrozenPayload =
    "ad07e88283e88fd0d50023839e7e53628036aee29a24d64f809795b9771855c2";

constexpr const char* kFrozenMeanRemovedPayload =
    "62df2541ea0fecf0f4e133b8ff7219d2713621db92db0fa9c4f3b12dc10502b9";

CtVolume small_ct() {
  CtGrid grid;
  grid.size = {24, 20, 18};
  grid.spacing_mm = {3.0, 4.0, 5.0};
  grid.origin_mm = Eigen::Vector3d(-34.5, -38.0, -42.5);
  return box_phantom(grid, {4, 3, 3}, {17, 14, 13}, 400);
}

/// 7 x 6 viewpoints over 25 x 22 nodes, of which an odd number is stored. Nothing here depends on
/// libm.
LightSlab small_light_slab() {
  LightSlab light_slab;
  light_slab.uv_plane_y_mm = 500.0;
  light_slab.u = {-90.0, 90.0, 7};
  light_slab.v = {-70.0, 60.0, 6};
  SlabGeometry slab;
  slab.s = {-60.0, 62.0, 25};
  slab.t = {-50.0, 55.0, 22};
  slab.stored_s = {2, 23};
  slab.stored_t = {2, 16};
  light_slab.slabs.push_back(slab);
  return light_slab;
}

/// Everything between CT and file, at a small scale.
class FieldBuildTest : public testing::Test {
 protected:
  FieldFileInfo build(
      const std::filesystem::path& path,
      std::int64_t rays_per_unit,
      UnitStore* progress = nullptr,
      const StopRequested& stop = [] { return false; }) {
    const auto units = plan_units(light_slab_.lattice(), {rays_per_unit});
    const FieldBuild build = build_of(units, progress);
    CastPhase cast = cast_field(build, {kSelection, kept_tile_bytes_}, stop, {});
    units_resumed_ = cast.units_resumed;
    units_kept_ = cast.units_kept;
    CompressedAttenuationField field;
    field.identity.camera.name = "AP";
    field.identity.camera.detector_origin_point = {-100.0, -100.0, 1000.0};
    field.identity.camera.size_px = {200, 200};
    field.identity.ct.content_sha256 = std::string(64, 'b');
    field.light_slab = light_slab_;
    field.quantizer_step = quantizer_.step();
    field.codebook =
        train_field(build, cast, {.codewords = 64, .seed = 3, .mean_step = mean_step_}, {})
            .codebook;
    FieldEncoder encoder(build, cast, field.codebook, overflow_);
    const FieldFileInfo info = write_field(
        field,
        [&] { return encoder.next_blocks(); },
        [] {
          return FieldProvenance{"0", "c", "o", "{}"};
        },
        path,
        world_);
    units_damaged_ = encoder.units_damaged();
    return info;
  }

  [[nodiscard]] FieldBuild build_of(const std::vector<WorkUnit>& units, UnitStore* progress) const {
    return {caster_,
            light_slab_.lattice(),
            units,
            unit_costs(units, light_slab_, volume_.corner_points()),
            progress,
            world_};
  }

  [[nodiscard]] static UnfinishedWork work_in(const std::filesystem::path& folder,
                                              std::int64_t rays_per_unit = kUnitRays) {
    return {folder, "units", {{"step_mm", "3"}, {"ct_content_sha256", "b"}}, rays_per_unit};
  }

  /// Casts, keeping progress, until some units are done, then stops as for SIGUSR1.
  void stop_after(const std::filesystem::path& path, std::uint64_t units_per_rank) {
    UnitStore progress(work_in(path), world_);
    std::atomic<std::uint64_t> asked = 0;
    try {
      build("/nowhere/unused.h5", kUnitRays, &progress, [&] { return asked++ >= units_per_rank; });
      FAIL() << "it did not stop";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::Stopped) << error.what();
    }
    world_.barrier();
  }

  static constexpr std::int64_t kUnitRays = 2 * 2 * 4 * 16;

  Communicator world_ = Communicator::world();
  test::SharedFolder folder_;
  AttenuationVolume volume_{small_ct(), AttenuationModel{}};
  AttenuationQuantizer quantizer_ =
      AttenuationQuantizer::for_maximum(volume_.max_total_attenuation());
  LightSlab light_slab_ = small_light_slab();
  TrilinearFieldCaster caster_{volume_, light_slab_, quantizer_, RayCasterOptions{2.0}};
  static constexpr TrainingSelection kSelection{0.5, 100000, 3};
  std::uint64_t kept_tile_bytes_ = ~std::uint64_t{0};
  TileOverflow overflow_ = TileOverflow::CastAgain;
  int mean_step_ = 0;
  std::uint64_t units_resumed_ = 0;
  std::uint64_t units_kept_ = 0;
  std::uint64_t units_damaged_ = 0;
};

TEST(SlabAlignedVolume, IsTheSameWhenTheRanksOfANodeFillItTogether) {
  const Communicator world = Communicator::world();
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  for (const Eigen::Matrix3d& rotation :
       {test::aligned_rotations()[1], test::oblique_rotations()[0]}) {
    RigidTransform slab_from_ct = RigidTransform::Identity();
    slab_from_ct.linear() = rotation;
    const SlabAlignedVolume alone(volume, slab_from_ct);
    const SlabAlignedVolume shared(volume,
                                   slab_from_ct,
                                   slab_aligned_layout(volume, slab_from_ct),
                                   [&](std::size_t bytes, const SlabAlignedFill& fill) {
                                     return world.allocate_on_node_together(bytes, fill);
                                   });
    ASSERT_EQ(shared.bytes(), alone.bytes());
    for (int y = 0; y < alone.grid().size[1]; ++y)
      for (int z = 0; z < alone.grid().size[2]; ++z) {
        ASSERT_EQ(shared.row(y, z).begin, alone.row(y, z).begin);
        ASSERT_EQ(shared.row(y, z).end, alone.row(y, z).end);
        for (int x = 0; x < alone.grid().size[0]; ++x)
          ASSERT_EQ(shared.level(x, y, z), alone.level(x, y, z));
      }
    world.barrier();
  }
}

TEST_F(FieldBuildTest, PayloadIsTheSameOnAnyRankCountPlanAndVectorWidth) {
  EXPECT_EQ(build(folder_ / "whole.h5", 1000000).payload_sha256, kFrozenPayload);
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    EXPECT_EQ(build(folder_ / "cut.h5", kUnitRays).payload_sha256, kFrozenPayload);
  }
  force_vector_width(std::nullopt);
}

TEST_F(FieldBuildTest, MeanRemovedPayloadIsTheSameOnAnyRankCountPlanAndVectorWidth) {
  mean_step_ = 48;
  EXPECT_EQ(build(folder_ / "whole.h5", 1000000).payload_sha256, kFrozenMeanRemovedPayload);
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    EXPECT_EQ(build(folder_ / "cut.h5", kUnitRays).payload_sha256, kFrozenMeanRemovedPayload);
  }
  force_vector_width(std::nullopt);
  kept_tile_bytes_ = 2000;
  overflow_ = TileOverflow::ReadBack;
  UnitStore progress(work_in(folder_ / "a.progress"), world_);
  EXPECT_EQ(build(folder_ / "a.h5", kUnitRays, &progress).payload_sha256,
            kFrozenMeanRemovedPayload);
}

/// Sixty-three shapes and separate means serve better than sixty-three tiles.
TEST_F(FieldBuildTest, MeanRemovedTilesComeNearerToTheSamples) {
  const auto units = plan_units(light_slab_.lattice(), {kUnitRays});
  const FieldBuild build = build_of(units, nullptr);
  const auto error_of = [&](int mean_step) {
    CastPhase cast = cast_field(build, {kSelection}, [] { return false; }, {});
    const Codebook codebook =
        train_field(build, cast, {.codewords = 64, .seed = 3, .mean_step = mean_step}, {}).codebook;
    FieldEncoder encoder(build, cast, codebook, TileOverflow::CastAgain);
    while (sum_over(world_, encoder.next_blocks().size()) > 0) {
    }
    return static_cast<double>(encoder.squared_error());
  };
  EXPECT_LT(error_of(48), 0.75 * error_of(0));
}

/// The payload holds the filter's weights, which must depend on neither.
TEST_F(FieldBuildTest, FilterIsTheSameOnAnyRankCountAndVectorWidth) {
  light_slab_.slabs[0].s.nodes = 65;
  light_slab_.slabs[0].stored_s = {2, 63};
  const auto units = plan_units(light_slab_.lattice(), {kUnitRays});
  const FieldBuild build = build_of(units, nullptr);
  CastPhase cast = cast_field(build, {kSelection}, [] { return false; }, {});
  const Codebook codebook =
      train_field(build, cast, {.codewords = 64, .seed = 3, .mean_step = 48}, {}).codebook;
  const Communicator alone = Communicator::alone();
  const FieldBuild build_alone{caster_, light_slab_.lattice(), units, {}, nullptr, alone};
  const FittedFilter expected = fit_filter(build_alone, codebook, 3);
  ASSERT_TRUE(expected.filter.has_value());
  EXPECT_LT(expected.squared_error_left, 0.8 * expected.squared_error);
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    const FittedFilter fitted = fit_filter(build, codebook, 3);
    EXPECT_EQ(fitted.filter, expected.filter);
    EXPECT_EQ(fitted.tiles, expected.tiles);
  }
  force_vector_width(std::nullopt);
}

TEST_F(FieldBuildTest, PayloadIsTheSameWhereverTheTilesAreKept) {
  constexpr std::uint64_t kRoomForSome = 2000;
  for (const std::uint64_t room : {std::uint64_t{0}, kRoomForSome}) {
    kept_tile_bytes_ = room;
    overflow_ = TileOverflow::CastAgain;
    EXPECT_EQ(build(folder_ / "cast-again.h5", kUnitRays).payload_sha256, kFrozenPayload);
    overflow_ = TileOverflow::ReadBack;
    UnitStore progress(work_in(folder_ / (std::to_string(room) + ".progress")), world_);
    EXPECT_EQ(build(folder_ / "read-back.h5", kUnitRays, &progress).payload_sha256, kFrozenPayload);
    EXPECT_EQ(units_damaged_, 0u);
    if (room == 0)
      EXPECT_EQ(units_kept_, 0u);
    else
      EXPECT_GT(units_kept_, 0u);
  }
}

TEST_F(FieldBuildTest, TilesThatCannotBeReadBackAreCastAgain) {
  const auto units = plan_units(light_slab_.lattice(), {kUnitRays});
  UnitStore progress(work_in(folder_ / "a.h5.progress"), world_);
  const FieldBuild build = build_of(units, &progress);
  CastPhase cast = cast_field(build, {kSelection, 0}, [] { return false; }, {});
  const OverflowChoice choice = choose_overflow(build, cast);
  EXPECT_GT(choice.read_bytes_per_second, 0.0);
  const Codebook codebook = train_field(build, cast, {.codewords = 64, .seed = 3}, {}).codebook;
  FieldEncoder encoder(build, cast, codebook, TileOverflow::ReadBack);
  world_.barrier();
  if (world_.is_root())
    for (const auto& entry : std::filesystem::directory_iterator(progress.path()))
      if (entry.path().extension() == ".records") std::filesystem::resize_file(entry.path(), 0);
  world_.barrier();
  std::size_t mine = 0;
  for (auto blocks = encoder.next_blocks(); !blocks.empty(); blocks = encoder.next_blocks())
    mine += blocks.size();
  EXPECT_EQ(encoder.units_damaged(), mine);
  std::array<std::uint64_t, 1> all{mine};
  world_.sum(all);
  EXPECT_EQ(all[0], units.size());
}

TEST_F(FieldBuildTest, DecodedFieldStaysNearTheCastSamples) {
  build(folder_ / "a.h5", kUnitRays);
  const auto field = read_field(folder_ / "a.h5", world_);
  const RayCaster single(volume_, RayCasterOptions{2.0});
  double squared = 0.0;
  double squared_signal = 0.0;
  const SlabGeometry& slab = light_slab_.slabs.front();
  for (int u = 0; u < 7; ++u)
    for (int v = 0; v < 6; ++v)
      for (int s = 0; s < 25; ++s)
        for (int t = 0; t < 22; ++t) {
          const float direct = single.total_attenuation(light_slab_.viewpoint(u, v),
                                                        light_slab_.st_point(slab, s, t));
          const bool is_stored = s >= 2 && t >= 2 && t < 18;
          const double difference = static_cast<double>(field->node_value(0, {u, v, s, t})) -
                                    (is_stored ? static_cast<double>(direct) : 0.0);
          squared += difference * difference;
          squared_signal += static_cast<double>(direct) * static_cast<double>(direct);
        }
  // 64 codewords fit a smooth body well. A decoder that mixed up axes or blocks would be off by the
  // signal itself.
  EXPECT_LT(squared, 0.01 * squared_signal);
}

TEST_F(FieldBuildTest, AStoppedRunIsResumedToTheSamePayload) {
  const auto progress_path = folder_ / "a.h5.progress";
  stop_after(progress_path, 2);
  stop_after(progress_path, 3);
  // Another plan, as another rank count would make.
  UnitStore progress(work_in(progress_path, 999), world_);
  EXPECT_EQ(progress.rays_per_unit(), kUnitRays);
  EXPECT_EQ(build(folder_ / "a.h5", progress.rays_per_unit(), &progress).payload_sha256,
            kFrozenPayload);
  EXPECT_GE(units_resumed_, 5u);
}

TEST_F(FieldBuildTest, DamagedAndTornShardsAreCastAgain) {
  const auto progress_path = folder_ / "a.h5.progress";
  stop_after(progress_path, 6);
  if (world_.is_root()) {
    int shard = 0;
    for (const auto& entry : std::filesystem::directory_iterator(progress_path)) {
      if (entry.path().extension() != ".records") continue;
      const auto size = std::filesystem::file_size(entry.path());
      if (shard++ == 0) {
        std::filesystem::resize_file(entry.path(), size - 5);  // torn at the end
        std::fstream file(entry.path(), std::ios::in | std::ios::out | std::ios::binary);
        file.seekp(33);  // in the first unit's bitmap
        file.put('\x5A');
      } else {
        std::ofstream(entry.path(), std::ios::app) << "garbage that is no record header at all";
      }
    }
    std::ofstream(progress_path / "units.0009-000000.records");
  }
  world_.barrier();
  UnitStore progress(work_in(progress_path), world_);
  EXPECT_EQ(build(folder_ / "a.h5", kUnitRays, &progress).payload_sha256, kFrozenPayload);
  EXPECT_GE(units_resumed_, 1u);
}

TEST_F(FieldBuildTest, ProgressOfOtherOptionsIsRefusedByName) {
  const auto progress_path = folder_ / "a.h5.progress";
  stop_after(progress_path, 2);
  UnfinishedWork other = work_in(progress_path);
  other.decides["step_mm"] = "4";
  try {
    const UnitStore refused(other, world_);
    FAIL() << "it was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::Input);
    EXPECT_NE(std::string(error.what()).find("step_mm = 4: the unfinished work was begun with 3"),
              std::string::npos)
        << error.what();
  }
}

TEST_F(FieldBuildTest, ProgressOfRefusedOptionsGivesWayToOthersAndIsUsedByTheSame) {
  const auto progress_path = folder_ / "a.h5.progress";
  const auto units = plan_units(light_slab_.lattice(), {kUnitRays});
  const auto units_found = [&](const std::string& step_mm) {
    UnfinishedWork wanted = work_in(progress_path);
    wanted.decides["step_mm"] = step_mm;
    UnitStore progress(wanted, world_);
    std::array<std::uint64_t, 1> found{};
    progress.visit_finished(units, [&](const UnitTiles&) { ++found[0]; });
    world_.sum(found);
    return found[0];
  };
  stop_after(progress_path, 2);
  UnitStore(work_in(progress_path), world_).give_way();
  world_.barrier();
  EXPECT_GT(units_found("3"), 0u);
  EXPECT_THROW(units_found("4"), Error);  // it has been taken again
  world_.barrier();
  UnitStore(work_in(progress_path), world_).give_way();
  world_.barrier();
  EXPECT_EQ(units_found("4"), 0u);
}

TEST_F(FieldBuildTest, ADamagedManifestIsAFileError) {
  const auto progress_path = folder_ / "a.h5.progress";
  stop_after(progress_path, 1);
  for (const char* text : {"", "{", "{\"format\": 3}", "[1, 2]"}) {
    if (world_.is_root()) std::ofstream(progress_path / "units.json") << text;
    world_.barrier();
    try {
      const UnitStore refused(work_in(progress_path), world_);
      ADD_FAILURE() << text << " was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::File) << error.what();
    }
    world_.barrier();
  }
}

TEST_F(FieldBuildTest, TooManyCodewordsAreOneErrorOfTheWholeJob) {
  const auto units = plan_units(light_slab_.lattice(), {kUnitRays});
  const FieldBuild build = build_of(units, nullptr);
  CastPhase cast = cast_field(build, {{0.001, 100000, 3}}, [] { return false; }, {});
  try {
    train_field(build, cast, {.codewords = 64}, {});
    FAIL() << "it trained";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::Input);
    EXPECT_NE(std::string(error.what()).find("more codewords than training tiles"),
              std::string::npos)
        << error.what();
  }
}

TEST_F(FieldBuildTest, TrainingIsKeptForTheSameOptionsOnly) {
  TrainedCodebook training;
  training.codebook.codewords = {Tile{}, Tile{1, 2, 3}};
  training.training_tiles = 70;
  training.iterations = {{500, 60, 1}, {400, 50, 0}};
  const UnfinishedWork work = {folder_ / "progress", "training", {{"codewords", "2"}}};
  EXPECT_FALSE(TrainingJournal(work, {.codewords = 2}, world_).begun().has_value());
  TrainingJournal(work, {.codewords = 2}, world_).append(training);
  const auto begun = TrainingJournal(work, {.codewords = 2}, world_).begun();
  ASSERT_TRUE(begun.has_value());
  EXPECT_EQ(begun->codebook.codewords, training.codebook.codewords);
  EXPECT_EQ(begun->training_tiles, 70u);
  ASSERT_EQ(begun->iterations.size(), 2u);
  EXPECT_EQ(begun->iterations[1].training_squared_error, 400u);
  const TrainingJournal other(
      {work.folder, work.name, {{"codewords", "3"}}}, {.codewords = 3}, world_);
  EXPECT_FALSE(other.begun().has_value());
}

TEST_F(FieldBuildTest, ATrainingWithAnotherCodebookThanItSaysIsThrownAway) {
  const UnfinishedWork work = {folder_ / "progress", "training", {{"codewords", "2"}}};
  const auto begun_with = [&](const std::vector<Tile>& codewords) {
    TrainedCodebook training;
    training.codebook.codewords = codewords;
    TrainingJournal(work, {.codewords = 2}, world_).append(training);
    return TrainingJournal(work, {.codewords = 2}, world_).begun().has_value();
  };
  EXPECT_TRUE(begun_with({Tile{}, Tile{1}}));
  EXPECT_FALSE(begun_with({Tile{}, Tile{1}, Tile{2}}));  // too many
  EXPECT_FALSE(begun_with({Tile{1}, Tile{}}));           // not sorted, zero is not the first
  EXPECT_FALSE(begun_with({}));
  TrainedCodebook of_shapes;
  of_shapes.codebook = {{Tile{}, Tile{1}}, 48};
  TrainingJournal(work, {.codewords = 2}, world_).append(of_shapes);
  EXPECT_FALSE(TrainingJournal(work, {.codewords = 2}, world_).begun().has_value());
}

TEST(TrainingFiles, BytesThatAreNotOfATrainingAreNone) {
  TrainedCodebook training;
  training.codebook.codewords = {Tile{}};
  training.iterations = {{5, 6, 0}};
  std::vector<std::byte> bytes = bytes_of(training);
  EXPECT_TRUE(training_of(bytes).has_value());
  bytes.pop_back();
  EXPECT_FALSE(training_of(bytes).has_value());
  EXPECT_FALSE(training_of({}).has_value());
  std::fill(bytes.begin(), bytes.end(), std::byte{0xFF});  // sizes whose product would overflow
  EXPECT_FALSE(training_of(bytes).has_value());
}

TEST_F(FieldBuildTest, EncodedUnitsAreReadForTheirCodebookOnly) {
  const auto units = plan_units(light_slab_.lattice(), {kUnitRays});
  const EncodedUnit encoded{std::vector<std::uint16_t>(units[1].tile_count(), 7), 99};
  constexpr std::uint32_t kCodebookCrc = 5;
  {
    UnitStore progress(work_in(folder_ / "a.h5.progress"), world_);
    if (world_.is_root()) progress.append(units[1], encoded, kCodebookCrc);
    world_.barrier();
  }
  UnitStore progress(work_in(folder_ / "a.h5.progress"), world_);
  progress.visit_finished(units, [](const UnitTiles&) { ADD_FAILURE() << "no tiles were kept"; });
  const auto read = progress.read_encoded(units[1], 1, kCodebookCrc);
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->indices, encoded.indices);
  EXPECT_EQ(read->squared_error, 99u);
  EXPECT_FALSE(progress.read_encoded(units[1], 1, kCodebookCrc + 1).has_value());
  EXPECT_FALSE(progress.read_encoded(units[0], 1, kCodebookCrc).has_value());
  world_.barrier();
  if (world_.is_root()) {
    std::fstream shard(progress.path() / "units.0000-000000.records",
                       std::ios::in | std::ios::out | std::ios::binary);
    shard.seekp(49);  // behind the header, the error and the CRC: in the indices
    shard.put('\x5A');
  }
  world_.barrier();
  EXPECT_FALSE(progress.read_encoded(units[1], 1, kCodebookCrc).has_value());
}

TEST_F(FieldBuildTest, AUnitCastAgainForItsDamagedRecordIsFoundByTheNextRun) {
  const auto units = plan_units(light_slab_.lattice(), {kUnitRays});
  const UnitTiles tiles =
      make_unit_tiles(units[0], std::vector<std::uint16_t>(units[0].sample_count(), 3));
  const auto run = [&](bool appends) {
    UnitStore progress(work_in(folder_ / "a.h5.progress"), world_);
    std::array<std::uint64_t, 1> found{0};
    progress.visit_finished(units, [&](const UnitTiles&) { ++found[0]; });
    world_.sum(found);
    if (appends && world_.is_root()) progress.append(tiles);
    world_.barrier();
    return found[0];
  };
  EXPECT_EQ(run(true), 0u);
  if (world_.is_root()) {
    std::fstream shard(folder_ / "a.h5.progress" / "units.0000-000000.records",
                       std::ios::in | std::ios::out | std::ios::binary);
    shard.seekp(-1, std::ios::end);
    shard.put('\x5A');
    // These have names of shards but are none: a folder, and a run number that no run can follow.
    std::filesystem::create_directory(folder_ / "a.h5.progress" / "units.0000-000009.records");
    std::ofstream(folder_ / "a.h5.progress" / "units.9223372036854775807-000000.records") << "x";
  }
  world_.barrier();
  EXPECT_EQ(run(true), 0u);
  EXPECT_EQ(run(false), 1u);
}

TEST_F(FieldBuildTest, GeometryOfRankZeroIsTakenOver) {
  CompressedAttenuationField field;
  field.light_slab = small_light_slab();
  field.light_slab.u.first_mm += 1e-13 * world_.rank();
  field.light_slab.attenuation_end_y_mm = 12.5;
  share_geometry(field.light_slab, world_);
  const LightSlab& shared = field.light_slab;
  EXPECT_EQ(shared.u.first_mm, -90.0);
  EXPECT_EQ(shared.v.nodes, 6);
  EXPECT_EQ(shared.slabs[0].stored_t.count, 16);
  EXPECT_EQ(shared.attenuation_end_y_mm, 12.5);
  EXPECT_EQ(shared.slabs[0].t.last_mm, 55.0);
  EXPECT_EQ(shared.slab_from_ct.matrix(), small_light_slab().slab_from_ct.matrix());
}

}  // namespace
}  // namespace af
