// SPDX-License-Identifier: Apache-2.0
// Tests the library by its public headers alone, against what the programs made
// (make_library_study).
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "attenuation_fields/attenuation_fields.h"
#include "library/library_study.h"

namespace attenuation_fields {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

constexpr Vector3 kRotationDeg = {2.0, -1.5, 3.0};
constexpr Vector3 kTranslationMm = {4.0, -5.0, 6.0};

fs::path study_file(const std::string& name) {
  return fs::path(AF_LIBRARY_STUDY) / name;
}

/// The last `count` floats of a file: all of the pixels of an image.
std::vector<float> last_floats(const fs::path& path, std::size_t count) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(file), {});
  std::vector<float> values(count);
  if (bytes.size() < count * sizeof(float)) {
    ADD_FAILURE() << path << " has " << bytes.size() << " bytes";
    return values;
  }
  std::copy_n(bytes.end() - static_cast<std::ptrdiff_t>(count * sizeof(float)),
              count * sizeof(float),
              reinterpret_cast<char*>(values.data()));
  return values;
}

std::vector<float> drr_of(const Renderer& renderer, const Pose& pose) {
  std::vector<float> drr(renderer.pixel_count());
  renderer.drr(pose, drr);
  return drr;
}

template <typename Thrown>
std::string message_of(const std::function<void()>& function) {
  try {
    function();
  } catch (const Thrown& error) {
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

TEST(LibraryField, LooksUpTheDrrOfTheProgram) {
  const Field field = Field::open(study_file("AP.af.h5"));
  const Pose pose = field.frame().pose(kRotationDeg, kTranslationMm);
  EXPECT_EQ(drr_of(field, pose), last_floats(study_file("field.mha"), field.pixel_count()));
  const Field cubic = Field::open(study_file("AP.af.h5"), {.look_up = "cubic"});
  EXPECT_EQ(drr_of(cubic, pose), last_floats(study_file("cubic.mha"), field.pixel_count()));
  EXPECT_EQ(cubic.look_up(), "cubic");
  EXPECT_EQ(field.camera().name, "AP");
  EXPECT_NEAR(field.max_rotation_deg(), 8.0, 1e-9);
  EXPECT_EQ(field.max_translation_mm(), 12.0);
  const Ct ct = Ct::read(study_file("ct.nii.gz"));
  EXPECT_EQ(field.ct_content_sha256(), ct.content_sha256());
  EXPECT_TRUE(field.is_of(ct));
  CtGrid moved = ct.grid();
  moved.origin_mm[0] += 7.0;
  EXPECT_FALSE(field.is_of(Ct::from_voxels(moved, nullptr, ct.hu())));
  EXPECT_THAT(field.payload_sha256(), SizeIs(64));
}

TEST(LibraryField, LooksUpTheDrrOfTheProgramInAnAtlas) {
  const Field atlas = Field::open(study_file("AP.atlas.af.h5"));
  EXPECT_GT(atlas.members(), 1);
  EXPECT_EQ(Field::open(study_file("AP.af.h5")).members(), 1);
  const Pose between = atlas.frame().pose({2.0, -1.5, 7.0}, kTranslationMm);
  const auto expected = last_floats(study_file("atlas.mha"), atlas.pixel_count());
  EXPECT_EQ(drr_of(atlas, between), expected);
  // Whichever thread needs a member first reads it, while others read files, too.
  const Field shared = Field::open(study_file("AP.atlas.af.h5"), {.threads = 3});
  std::vector<Pose> poses(6, between);
  std::vector<float> stack(poses.size() * shared.pixel_count());
  std::thread reading([] {
    for (int i = 0; i < 5; ++i) (void)Field::open(study_file("AP.af.h5"));
  });
  EXPECT_EQ(shared.drrs(poses, stack), 0);
  reading.join();
  EXPECT_TRUE(std::equal(expected.begin(),
                         expected.end(),
                         stack.end() - static_cast<std::ptrdiff_t>(shared.pixel_count())));
}

constexpr Beam kBeam = {.tube_kvp = 80.0, .aluminium_mm = 2.0, .scatter_to_primary = 0.2};

TEST(LibraryField, LooksUpTheDrrOfTheProgramOfABeam) {
  const Field field = Field::open(study_file("AP.af.h5"), {}, kBeam);
  const Pose pose = field.frame().pose(kRotationDeg, kTranslationMm);
  EXPECT_EQ(drr_of(field, pose), last_floats(study_file("field-beam.mha"), field.pixel_count()));
  EXPECT_NE(drr_of(field, pose), last_floats(study_file("field.mha"), field.pixel_count()));
  EXPECT_THAT(message_of<FileError>([] { (void)Field::open(study_file("LAT.af.h5"), {}, kBeam); }),
              HasSubstr("LAT.bone.af.h5"));
  EXPECT_THAT(
      message_of<FileError>([] { (void)Field::open(study_file("AP.atlas.af.h5"), {}, kBeam); }),
      HasSubstr("AP.atlas.bone.af.h5"));
  EXPECT_THAT(message_of<InputError>(
                  [] { (void)Field::open(study_file("AP.af.h5"), {}, {.tube_kvp = -1.0}); }),
              HasSubstr("tube_kvp"));
}

TEST(LibraryRayCaster, CastsTheDrrOfTheProgramOfABeam) {
  const Rig rig = Rig::read(study_file("rig.toml").string());
  const RayCaster caster(Ct::read(study_file("ct.nii.gz")),
                         rig.camera("LAT"),
                         {.isocenter_point = rig.isocenter_point},
                         kBeam);
  EXPECT_EQ(drr_of(caster, caster.frame().pose(kRotationDeg, kTranslationMm)),
            last_floats(study_file("cast-beam.mha"), caster.pixel_count()));
}

TEST(LibraryRayCaster, CastsTheDrrOfTheProgram) {
  const Rig rig = Rig::read(study_file("rig.toml").string());
  const RayCaster caster(Ct::read(study_file("ct.nii.gz")),
                         rig.camera("LAT"),
                         {.isocenter_point = rig.isocenter_point});
  EXPECT_EQ(drr_of(caster, caster.frame().pose(kRotationDeg, kTranslationMm)),
            last_floats(study_file("cast.mha"), caster.pixel_count()));
}

TEST(LibraryRenderer, GivesTheDerivativesThatTheProgramsOptimiseWith) {
  const Field field = Field::open(study_file("AP.af.h5"));
  const std::size_t pixels = field.pixel_count();
  std::vector<float> values(7 * pixels);
  const std::span<float> all(values);
  field.drr_and_motion_gradient(field.frame().pose(kRotationDeg, kTranslationMm),
                                af::test::kPivotRoomMm,
                                all.first(pixels),
                                all.subspan(pixels));
  EXPECT_EQ(values, last_floats(study_file("motion-gradient.f32"), 7 * pixels));
}

/// Compares sums over the detector with central differences of the sums. Waves of 14 and 18 pixels
/// weight the sums, which averages out the rounding of single pixels and responds to every motion.
TEST(LibraryRenderer, GivesDerivativesByItsParameters) {
  const Rig rig = Rig::read(study_file("rig.toml").string());
  const RayCaster caster(Ct::read(study_file("ct.nii.gz")), rig.camera("LAT"), {.step_mm = 0.1});
  const std::size_t pixels = caster.pixel_count();
  std::vector<float> drr(pixels);
  std::vector<float> planes(6 * pixels);
  caster.drr_and_gradient(kRotationDeg, kTranslationMm, drr, planes);
  EXPECT_EQ(drr, drr_of(caster, caster.frame().pose(kRotationDeg, kTranslationMm)));
  const auto weight = [&](std::size_t i) {
    const auto width = static_cast<std::size_t>(caster.width());
    return std::sin(0.45 * static_cast<double>(i % width) + 0.3) *
           std::cos(0.35 * static_cast<double>(i / width) - 0.2);
  };
  const auto weighted = [&](std::span<const float> values) {
    double sum = 0.0;
    for (std::size_t i = 0; i < pixels; ++i) sum += weight(i) * static_cast<double>(values[i]);
    return sum;
  };
  constexpr double kStep = 0.05;  // degrees, mm
  std::vector<double> found;
  std::vector<double> expected;
  for (std::size_t k = 0; k < 6; ++k) {
    const auto moved = [&](double step) {
      Vector3 rotation = kRotationDeg;
      Vector3 translation = kTranslationMm;
      (k < 3 ? rotation[k] : translation[k - 3]) += step;
      return weighted(drr_of(caster, caster.frame().pose(rotation, translation)));
    };
    expected.push_back((moved(kStep) - moved(-kStep)) / (2.0 * kStep));
    found.push_back(weighted(std::span(planes).subspan(k * pixels, pixels)));
  }
  // As the volume moves, samples slide where rays enter and leave it. This shifts values, and
  // differences over a small step by some percent of the largest.
  constexpr double kTolerance = 0.05;
  for (const std::size_t first : {0U, 3U}) {
    double largest = 0.0;
    for (std::size_t k = first; k < first + 3; ++k)
      largest = std::max(largest, std::abs(expected[k]));
    for (std::size_t k = first; k < first + 3; ++k)
      EXPECT_NEAR(found[k], expected[k], kTolerance * largest) << k;
  }
}

TEST(LibraryRenderer, MakesBatchesOfTheSameBitsOnAnyThreads) {
  const Field one = Field::open(study_file("AP.af.h5"));
  const Field three = Field::open(study_file("AP.af.h5"), {.threads = 3});
  EXPECT_EQ(three.threads(), 3);
  const std::size_t pixels = one.pixel_count();
  std::vector<Pose> poses;
  std::vector<std::array<double, 6>> parameters;
  for (int i = 0; i < 7; ++i) {
    parameters.push_back({0.5 * i, 1.0, -0.3 * i, 2.0, -1.0 * i, 0.7});
    const auto& p = parameters.back();
    poses.push_back(one.frame().pose({p[0], p[1], p[2]}, {p[3], p[4], p[5]}));
  }
  std::vector<float> batch(poses.size() * pixels);
  three.drrs(poses, batch);
  std::vector<float> batch_again(batch.size());
  std::vector<float> planes(6 * batch.size());
  three.drrs_and_gradients(parameters, batch_again, planes);
  EXPECT_EQ(batch, batch_again);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    std::vector<float> drr(pixels);
    std::vector<float> gradient(6 * pixels);
    one.drr_and_gradient({parameters[i][0], parameters[i][1], parameters[i][2]},
                         {parameters[i][3], parameters[i][4], parameters[i][5]},
                         drr,
                         gradient);
    EXPECT_TRUE(std::equal(drr.begin(), drr.end(), batch.begin() + static_cast<long>(i * pixels)));
    EXPECT_TRUE(std::equal(
        gradient.begin(), gradient.end(), planes.begin() + static_cast<long>(6 * i * pixels)));
  }
}

TEST(LibraryRenderer, MayBeCalledFromSeveralThreads) {
  for (const int threads : {1, 2}) {
    const Field field = Field::open(study_file("AP.af.h5"), {.threads = threads});
    const auto expected = last_floats(study_file("field.mha"), field.pixel_count());
    const Pose pose = field.frame().pose(kRotationDeg, kTranslationMm);
    std::vector<int> differences(4, 0);
    {
      std::vector<std::jthread> callers;
      for (int& count : differences)
        callers.emplace_back([&] {
          for (int i = 0; i < 20; ++i) count += drr_of(field, pose) == expected ? 0 : 1;
        });
    }
    EXPECT_THAT(differences, ElementsAre(0, 0, 0, 0));
  }
}

TEST(LibraryRenderer, EndsEarlyWhenAConditionIsMet) {
  for (const int threads : {1, 2}) {
    const Field field = Field::open(study_file("AP.af.h5"), {.threads = threads});
    const Pose pose = field.frame().pose(kRotationDeg, kTranslationMm);
    const std::vector<Pose> poses(1000, pose);
    std::vector<float> stack(poses.size() * field.pixel_count());
    int questions = 0;
    try {
      const StopCondition condition([&] { return ++questions == 2; });
      for (;;) field.drrs(poses, stack);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), 75);
    }
    EXPECT_EQ(questions, 2);
    EXPECT_EQ(drr_of(field, pose), last_floats(study_file("field.mha"), field.pixel_count()));
  }
}

TEST(LibraryRenderer, RefusesOrCountsRaysOutside) {
  const Pose far = Field::open(study_file("AP.af.h5")).frame().pose({}, {300.0, 0.0, 0.0});
  const Field throwing = Field::open(study_file("AP.af.h5"));
  std::vector<float> drr(throwing.pixel_count());
  EXPECT_THAT(message_of<InputError>([&] { throwing.drr(far, drr); }),
              HasSubstr("pose 0 = outside the field: "));
  const Field counting = Field::open(study_file("AP.af.h5"), {.outside = Outside::Zero});
  EXPECT_GT(counting.drr(far, drr), 0);
  EXPECT_EQ(counting.drr(counting.frame().pose({}, {}), drr), 0);
}

TEST(LibraryRenderer, RefusesBuffersAndPosesThatDoNotFit) {
  const Field field = Field::open(study_file("AP.af.h5"));
  std::vector<float> small(field.pixel_count() - 1);
  const Pose pose = field.frame().pose({}, {});
  EXPECT_THAT(message_of<InputError>([&] { field.drr(pose, small); }),
              HasSubstr("total_attenuation"));
  std::vector<float> drr(field.pixel_count());
  Pose scaled = pose;
  scaled.room_from_ct[0] = 2.0;
  EXPECT_THAT(message_of<InputError>([&] { field.drr(scaled, drr); }), HasSubstr("pose: "));
  EXPECT_THROW((void)field.frame().pose({std::numeric_limits<double>::quiet_NaN(), 0, 0}, {}),
               InputError);
  EXPECT_THROW((void)Field::open(study_file("AP.af.h5"), {.threads = -1}), InputError);
  EXPECT_THROW((void)Field::open(study_file("AP.af.h5"), {.look_up = "psychic"}), InputError);
}

TEST(LibraryErrors, AreThoseOfThePrograms) {
  EXPECT_THAT(message_of<FileError>([] { (void)Field::open(study_file("rig.toml")); }),
              HasSubstr("is not an HDF5 file"));
  EXPECT_THAT(message_of<FileError>([] { (void)Ct::read(study_file("nothing.nii")); }),
              HasSubstr("nothing.nii"));
  try {
    (void)Rig::read("no-such-rig.toml");
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), 4);
  }
}

TEST(LibraryCt, SharesVoxelsAndRefusesGridsThatAreNone) {
  const Ct ct = Ct::read(study_file("ct.nii.gz"));
  const Ct same = Ct::from_voxels(ct.grid(), nullptr, ct.hu());
  EXPECT_EQ(same.hu().data(), ct.hu().data());
  EXPECT_EQ(same.content_sha256(), ct.content_sha256());
  CtGrid grid = ct.grid();
  grid.size[0] += 1;
  EXPECT_THROW((void)Ct::from_voxels(grid, nullptr, ct.hu()), InputError);
  grid = ct.grid();
  // Products of 2^64, 2^64 and 2^90 voxels, which wrap to 0.
  for (const std::array<int, 3>& size : {std::array{1 << 22, 1 << 21, 1 << 21},
                                         {1 << 30, 1 << 30, 16},
                                         {1 << 30, 1 << 30, 1 << 30}}) {
    grid.size = size;
    EXPECT_THAT(message_of<InputError>([&] { (void)Ct::from_voxels(grid, nullptr, {}); }),
                HasSubstr("must be at most 4294967296 voxels"));
  }
  grid = ct.grid();
  grid.spacing_mm[1] = -1.0;
  EXPECT_THAT(message_of<InputError>([&] { (void)Ct::from_voxels(grid, nullptr, ct.hu()); }),
              HasSubstr("spacing"));
}

TEST(LibraryRig, IsReadBackToTheBit) {
  const Rig rig = Rig::read("c-arm-12in");
  const fs::path path = fs::path(testing::TempDir()) / "af-library-rig.toml";
  std::ofstream(path) << rig.to_toml();
  const Rig again = Rig::read(path.string());
  fs::remove(path);
  ASSERT_EQ(again.cameras.size(), rig.cameras.size());
  EXPECT_EQ(again.camera("AP").detector_origin_point, rig.camera("AP").detector_origin_point);
  EXPECT_THAT(message_of<InputError>([&] { (void)rig.camera("PA"); }), HasSubstr("AP"));
  // The isocentre is seen in the middle of the detector.
  EXPECT_THAT(rig.camera("AP").project(rig.isocenter_point),
              ElementsAre(testing::DoubleNear(127.5, 1e-9), testing::DoubleNear(127.5, 1e-9)));
}

nlohmann::json result_of(const std::string& folder) {
  std::ifstream file(study_file(folder) / "result.json");
  return nlohmann::json::parse(file);
}

class LibraryRegistrationOf : public testing::TestWithParam<std::string> {};

TEST_P(LibraryRegistrationOf, EndsWhereTheProgramEnds) {
  RegistrationOptions options;
  options.preset = GetParam();
  options.fields = {{"AP", study_file("AP.af.h5")}, {"LAT", study_file("LAT.af.h5")}};
  const RegistrationCase registration_case =
      RegistrationCase::load(study_file("study.toml"), "", options);
  EXPECT_EQ(registration_case.name(), "ellipsoids");
  const std::vector<CaseView> views = registration_case.views();
  ASSERT_THAT(views, SizeIs(2));
  EXPECT_EQ(views[1].camera.name, "LAT");
  const std::vector<float> xray = last_floats(study_file("LAT.mha"), views[1].xray.size());
  EXPECT_TRUE(std::equal(xray.begin(), xray.end(), views[1].xray.begin(), views[1].xray.end()));
  const Registration found =
      registration_case.run(registration_case.frame().pose({-1.0, 0.5, 2.5}, {0.5, 1.0, 4.0}));
  const nlohmann::json expected = result_of(GetParam());
  // Preset bone finds no bone's silhouette in ellipsoids, and both the library and the program say
  // so.
  const bool is_found = expected.contains("room_from_ct");
  EXPECT_EQ(is_found, GetParam() != "bone");
  const auto& pose = expected.at(is_found ? "room_from_ct" : "rejected_room_from_ct");
  for (std::size_t row = 0; row < 4; ++row)
    for (std::size_t column = 0; column < 4; ++column)
      EXPECT_EQ(found.pose.room_from_ct[4 * row + column], pose[row][column].get<double>());
  EXPECT_EQ(found.verdict, expected.at("verdict").get<std::string>());
  EXPECT_EQ(found.reason, expected.at("verdict_reason").get<std::string>());
  if (is_found) {
    EXPECT_EQ(found.similarity, expected.at("similarity").get<double>());
  }
  EXPECT_EQ(found.stop_reason, expected.at("stop_reason").get<std::string>());
  EXPECT_EQ(found.tre_mm, expected.at("tre_mm").get<double>());
  EXPECT_EQ(found.initial_tre_mm, expected.at("initial_tre_mm").get<double>());
  EXPECT_EQ(registration_case.tre_mm(found.pose), found.tre_mm);
  EXPECT_THAT(found.views, SizeIs(2));
}

INSTANTIATE_TEST_SUITE_P(EveryPreset,
                         LibraryRegistrationOf,
                         testing::ValuesIn(preset_names()),
                         [](const auto& preset) { return preset.param; });

TEST(LibraryRegistration, RegistersSeveralStartsAsTheProgram) {
  RegistrationOptions options;
  options.preset = "fast";
  options.fields = {{"AP", study_file("AP.af.h5")}, {"LAT", study_file("LAT.af.h5")}};
  const RegistrationCase registration_case =
      RegistrationCase::load(study_file("study.toml"), "ellipsoids", options);
  const Table starts = Table::read(study_file("starts.csv"));
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < starts.row_count(); ++i) {
    const auto at = [&](const char* column) { return starts.numbers(column)[i]; };
    poses.push_back(registration_case.frame().pose({at("rx_deg"), at("ry_deg"), at("rz_deg")},
                                                   {at("tx_mm"), at("ty_mm"), at("tz_mm")}));
  }
  const std::vector<Registration> found = registration_case.run_all(poses);
  const Table expected = Table::read(study_file("several/registrations.csv"));
  ASSERT_EQ(expected.row_count(), found.size());
  std::vector<double> tre_mm;
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_NEAR(found[i].parameters[0], expected.numbers("final_rx_deg")[i], 1e-6);
    EXPECT_NEAR(*found[i].tre_mm, expected.numbers("tre_mm")[i], 1e-6);
    tre_mm.push_back(*found[i].tre_mm);
  }
  const SuccessRate rate = success_rate(tre_mm);
  EXPECT_EQ(rate.trials, 2);
  EXPECT_EQ(rate.successes, 2);
  EXPECT_EQ(rate.rate, 1.0);
}

void expect_starts_of(const std::string& folder, const std::vector<PoseMode>& found) {
  const nlohmann::json expected = result_of(folder);
  std::vector<double> likenesses;
  for (const PoseMode& mode : found) likenesses.push_back(mode.likeness);
  EXPECT_EQ(nlohmann::json(likenesses), expected.at("start_search").at("likeness_per_start"));
  const auto& start = expected.at("start_room_from_ct");
  const Pose& pose = found.at(expected.at("start_index").get<std::size_t>()).pose;
  for (std::size_t row = 0; row < 4; ++row)
    for (std::size_t column = 0; column < 4; ++column)
      EXPECT_EQ(pose.room_from_ct[4 * row + column], start[row][column].get<double>());
}

TEST(LibraryRegistration, SearchesForTheStartsOfTheProgram) {
  RegistrationOptions options;
  options.preset = "fast";
  options.renderer = "raycast";
  options.threads = 2;
  const RegistrationCase cast = RegistrationCase::load(study_file("study.toml"), "", options);
  expect_starts_of(
      "searched",
      cast.search(
          {.modes = 3, .orientations = "any", .translation_mm = Vector3{20.0, 20.0, 20.0}}));
  options.renderer = "field";
  options.fields = {{"AP", study_file("AP.af.h5")}, {"LAT", study_file("LAT.af.h5")}};
  const RegistrationCase looked_up = RegistrationCase::load(study_file("study.toml"), "", options);
  expect_starts_of("searched-fields", looked_up.search());

  const auto refusal = [&](const SearchOptions& search) {
    return message_of<InputError>([&] { (void)looked_up.search(search); });
  };
  EXPECT_THAT(refusal({.modes = 0}), HasSubstr("modes = 0: must be at least 1 and at most 100"));
  EXPECT_THAT(refusal({.orientations = "upright"}), HasSubstr("must be one of field, flips, any"));
  EXPECT_THAT(refusal({.rotation_deg = Vector3{1.0, -2.0, 1.0}}), HasSubstr("rotation_deg = -2"));
  EXPECT_THAT(refusal({.orientations = "any"}),
              HasSubstr("; renderer raycast searches everywhere"));
}

TEST(LibraryRegistration, LeavesOutTheUncertaintyAndNothingElse) {
  RegistrationOptions options;
  options.preset = "fast";
  options.fields = {{"AP", study_file("AP.af.h5")}, {"LAT", study_file("LAT.af.h5")}};
  const RegistrationCase full = RegistrationCase::load(study_file("study.toml"), "", options);
  options.no_uncertainty = true;
  const RegistrationCase bare = RegistrationCase::load(study_file("study.toml"), "", options);
  const Pose start = full.frame().pose({-1.0, 0.5, 2.5}, {0.5, 1.0, 4.0});
  const Registration with = full.run(start);
  const Registration without = bare.run(start);
  // Without a predicted TRE, the confidence is a lower bound.
  EXPECT_GT(without.uncertainty.confidence, 0.0);
  EXPECT_LE(without.uncertainty.confidence, with.uncertainty.confidence);
  EXPECT_TRUE(std::isnan(without.uncertainty.tre_95_mm));
  EXPECT_TRUE(std::isnan(without.uncertainty.covariance[2][4]));
  EXPECT_EQ(without.pose.room_from_ct, with.pose.room_from_ct);
  EXPECT_EQ(without.verdict, with.verdict);
}

RegistrationOptions options_with_fields(const std::string& preset) {
  RegistrationOptions options;
  options.preset = preset;
  options.fields = {{"AP", study_file("AP.af.h5")}, {"LAT", study_file("LAT.af.h5")}};
  return options;
}

/// A folder with the study, but with the first X-ray's values changed.
class StudyOfAnotherXray {
 public:
  explicit StudyOfAnotherXray(std::size_t pixels)
      : folder_(fs::temp_directory_path() /
                ("library_test_" + std::to_string(std::random_device()()))),
        xray_(last_floats(study_file("AP.mha"), pixels)) {
    fs::create_directories(folder_);
    for (const char* name : {"study.toml", "rig.toml", "ct.nii.gz", "AP.mha", "LAT.mha"})
      fs::copy_file(study_file(name), folder_ / name);
    for (std::size_t i = 0; i < xray_.size(); ++i)
      xray_[i] = 0.9f * xray_[i] + 0.01f * static_cast<float>(i % 7);
    const std::size_t bytes = pixels * sizeof(float);
    std::fstream file(folder_ / "AP.mha", std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(-static_cast<std::streamoff>(bytes), std::ios::end);
    file.write(reinterpret_cast<const char*>(xray_.data()), static_cast<std::streamsize>(bytes));
  }
  ~StudyOfAnotherXray() { fs::remove_all(folder_); }
  StudyOfAnotherXray(const StudyOfAnotherXray&) = delete;
  StudyOfAnotherXray& operator=(const StudyOfAnotherXray&) = delete;

  [[nodiscard]] fs::path study() const { return folder_ / "study.toml"; }
  [[nodiscard]] const std::vector<float>& xray() const { return xray_; }

 private:
  fs::path folder_;
  std::vector<float> xray_;
};

void expect_same(const Registration& found, const Registration& expected) {
  EXPECT_EQ(found.pose.room_from_ct, expected.pose.room_from_ct);
  EXPECT_EQ(found.similarity, expected.similarity);
  EXPECT_EQ(found.verdict, expected.verdict);
  EXPECT_EQ(found.reason, expected.reason);
  EXPECT_EQ(found.evaluations, expected.evaluations);
  EXPECT_EQ(found.drr_count, expected.drr_count);
  EXPECT_EQ(found.uncertainty.covariance, expected.uncertainty.covariance);
  EXPECT_EQ(found.uncertainty.confidence, expected.uncertainty.confidence);
  ASSERT_EQ(found.views.size(), expected.views.size());
  for (std::size_t i = 0; i < found.views.size(); ++i) {
    EXPECT_EQ(found.views[i].coarse, expected.views[i].coarse);
    EXPECT_EQ(found.views[i].fine, expected.views[i].fine);
  }
}

TEST(LibraryRegistration, AnExchangedXrayIsRegisteredAsOneThatWasLoaded) {
  for (const char* preset : {"fast", "robust"}) {
    const RegistrationOptions options = options_with_fields(preset);
    RegistrationCase exchanged = RegistrationCase::load(study_file("study.toml"), "", options);
    const Pose start = exchanged.frame().pose({-1.0, 0.5, 2.5}, {0.5, 1.0, 4.0});
    const CaseView before = exchanged.views()[0];
    const std::vector<float> own(before.xray.begin(), before.xray.end());
    const Registration first = exchanged.run(start);
    const StudyOfAnotherXray other(own.size());
    const RegistrationCase fresh = RegistrationCase::load(other.study(), "", options);
    const Registration expected = fresh.run(start);
    EXPECT_NE(expected.pose.room_from_ct, first.pose.room_from_ct);

    EXPECT_THAT(exchanged.set_xray("AP", other.xray()), testing::IsEmpty());
    expect_same(exchanged.run(start), expected);
    EXPECT_EQ(exchanged.similarity(start), fresh.similarity(start));
    EXPECT_TRUE(std::ranges::equal(exchanged.views()[0].xray, other.xray()));
    EXPECT_TRUE(std::ranges::equal(before.xray, own)) << "of its owner";

    EXPECT_THAT(message_of<InputError>([&] { exchanged.set_xray("PA", own); }), HasSubstr("LAT"));
    EXPECT_THAT(
        message_of<InputError>([&] { exchanged.set_xray("AP", std::span(own).subspan(1)); }),
        HasSubstr("the camera's pixels"));
    EXPECT_THAT(message_of<InputError>(
                    [&] { exchanged.set_xray("AP", std::vector<float>(own.size(), 1.0f)); }),
                HasSubstr("constant"));
    expect_same(exchanged.run(start), expected);
    exchanged.set_xrays({{"AP", own}, {"LAT", exchanged.views()[1].xray}});
    expect_same(exchanged.run(start), first);
  }
}

TEST(LibraryRegistration, CasesShareFieldsThatAreOpen) {
  const fs::path folder =
      fs::temp_directory_path() / ("library_test_" + std::to_string(std::random_device()()));
  fs::create_directories(folder);
  RegistrationOptions options;
  for (const char* camera : {"AP", "LAT"}) {
    const fs::path path = folder / (std::string(camera) + ".af.h5");
    fs::copy_file(study_file(path.filename()), path);
    options.opened_fields.emplace(camera, Field::open(path));
  }
  fs::remove_all(folder);
  // The first needs fewer levels of the fields than the second, and the third adds none.
  std::vector<RegistrationCase> cases;
  for (const char* preset : {"fast", "robust", "fast"}) {
    options.preset = preset;
    cases.push_back(RegistrationCase::load(study_file("study.toml"), "", options));
    const RegistrationCase alone =
        RegistrationCase::load(study_file("study.toml"), "", options_with_fields(preset));
    const Pose start = alone.frame().pose({-1.0, 0.5, 2.5}, {0.5, 1.0, 4.0});
    expect_same(cases.back().run(start), alone.run(start));
  }
  options.opened_fields.emplace("PA", options.opened_fields.at("AP"));
  EXPECT_THAT(message_of<InputError>(
                  [&] { (void)RegistrationCase::load(study_file("study.toml"), "", options); }),
              HasSubstr("AP, LAT"));
  options.opened_fields.erase("PA");
  std::swap(options.opened_fields.at("AP"), options.opened_fields.at("LAT"));
  EXPECT_THAT(message_of<FileError>(
                  [&] { (void)RegistrationCase::load(study_file("study.toml"), "", options); }),
              HasSubstr("field of camera 'LAT'"));
}

TEST(LibraryRegistration, StartsAtTheNominalPoseWithoutLandmarks) {
  RegistrationOptions options;
  options.renderer = "raycast";
  const RegistrationCase loaded = RegistrationCase::load(study_file("study.toml"), "", options);
  EXPECT_FALSE(loaded.landmark_start().has_value());
  EXPECT_EQ(loaded.usual_start().room_from_ct, loaded.frame().pose({}, {}).room_from_ct);
}

TEST(LibraryRegistration, RefusesWhatTheProgramRefuses) {
  RegistrationOptions options;
  options.preset = "hasty";
  EXPECT_THAT(message_of<InputError>(
                  [&] { (void)RegistrationCase::load(study_file("study.toml"), "", options); }),
              HasSubstr("robust"));
  options.preset = "fast";
  EXPECT_THAT(message_of<InputError>(
                  [&] { (void)RegistrationCase::load(study_file("study.toml"), "", options); }),
              AllOf(HasSubstr("field = none: give fields={\"AP\": \"FIELD.h5\"}"),
                    HasSubstr("renderer=raycast")));
  EXPECT_THAT(message_of<InputError>(
                  [&] { (void)RegistrationCase::load(study_file("study.toml"), "knee", options); }),
              HasSubstr("ellipsoids"));
}

TEST(LibraryTable, NamesItsColumnsAndRefusesOthers) {
  const Table table = Table::read(study_file("several/registrations.csv"));
  EXPECT_THAT(table.columns(), testing::Contains("stop_reason"));
  EXPECT_THAT(message_of<InputError>([&] { (void)table.numbers("tre_cm"); }), HasSubstr("tre_mm"));
  EXPECT_THAT(message_of<FileError>([&] { (void)table.numbers("stop_reason"); }),
              HasSubstr("registrations.csv:2"));
}

TEST(LibraryEvaluation, MeasuresPosesAndImages) {
  Pose moved;
  moved.room_from_ct[3] = 3.0;
  moved.room_from_ct[7] = 4.0;
  const CtBox box{{-1.0, -1.0, -1.0}, {1.0, 1.0, 1.0}};
  EXPECT_NEAR(mean_tre_mm(moved, Pose{}, box), 5.0, 1e-12);
  EXPECT_THROW((void)mean_tre_mm(moved, Pose{}, CtBox{}), InputError);
  // Differences of 0.1 against a maximum of 1 are 20 dB.
  const std::vector<float> reference = {1.0F, 0.5F, 0.0F};
  const std::vector<float> drr = {0.9F, 0.6F, 7.0F};
  EXPECT_NEAR(psnr_db(drr, reference).value_or(0.0), 20.0, 1e-4);
  EXPECT_EQ(psnr_db(std::vector<float>{1.0F}, std::vector<float>{0.0F}), std::nullopt);
  EXPECT_THROW((void)psnr_db(drr, std::vector<float>{1.0F}), InputError);
}

}  // namespace
}  // namespace attenuation_fields
