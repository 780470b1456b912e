// SPDX-License-Identifier: Apache-2.0
#include "register/results/slicer_folder.h"

#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>

#include <gtest/gtest.h>

#include "files/output_file.h"
#include "images/image_header.h"
#include "study/pose_file.h"
#include "support/test_paths.h"
#include "unit/register/method/registration_cases.h"
#include "xray/image_file.h"

namespace af::registration {
namespace {

using nlohmann::json;

StudyCase some_case() {
  StudyCase study_case;
  study_case.name = "ellipsoids";
  study_case.ct = "/data/ct.nii.gz";
  study_case.target_box_ct = {{-10, -20, -30}, {30, 20, 10}};
  study_case.fiducials_ct_mm = {{1, 2, 3}, {4, 5, -6}};
  return study_case;
}

json markup(const std::filesystem::path& path) {
  return json::parse(read_text_file(path)).at("markups").at(0);
}

TEST(SlicerFiles, AreWhatItkAndJsonReadBack) {
  const test::ScratchFolder folder;
  const test::SmallCase small = test::small_case();
  write_slicer_folder(*small.problem, small.gold_room_from_ct, some_case(), folder.path());

  // Written with the shortest digits that read back: only the inverse rounds.
  constexpr double kRounding = 1e-12;
  EXPECT_TRUE(read_pose(folder / "ct-to-room.tfm").isApprox(small.gold_room_from_ct, kRounding));
  const json fiducials = markup(folder / "fiducials.mrk.json");
  EXPECT_EQ(fiducials.at("coordinateSystem"), "LPS");
  EXPECT_EQ(fiducials.at("controlPoints").at(1).at("position"), json({4.0, 5.0, -6.0}));
  const json box = markup(folder / "target-box.mrk.json");
  EXPECT_EQ(box.at("type"), "ROI");
  EXPECT_EQ(box.at("center"), json({10.0, 0.0, -10.0}));
  EXPECT_EQ(box.at("size"), json({40.0, 40.0, 40.0}));
  EXPECT_NE(read_text_file(folder / "README.md").find("/data/ct.nii.gz"), std::string::npos);
}

TEST(SlicerFiles, PutImagesOnTheirDetectorsInTheRoom) {
  const test::ScratchFolder folder;
  const test::SmallCase small = test::small_case();
  write_slicer_folder(*small.problem, small.gold_room_from_ct, some_case(), folder.path());
  for (const RegistrationView& view : small.problem->views) {
    const CameraGeometry& camera = view.view.camera;
    const std::filesystem::path xray = folder / ("xray-" + camera.name + ".nrrd");
    EXPECT_EQ(read_image(xray).pixels, view.xray.pixels);
    // The X-rays of this case are DRRs at this very pose.
    EXPECT_EQ(read_image(folder / ("drr-" + camera.name + ".nrrd")).pixels, view.xray.pixels);
    const ImageHeader header = read_image_header(xray, ImageFormat::Nrrd);
    constexpr double kWrittenDigitsMm = 1e-9;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto row = static_cast<Eigen::Index>(axis);
      EXPECT_NEAR(
          header.image.origin_mm[axis], camera.detector_origin_point[row], kWrittenDigitsMm);
      EXPECT_NEAR(header.image.directions[0][axis], camera.column_direction[row], kWrittenDigitsMm);
      EXPECT_NEAR(header.image.directions[1][axis], camera.row_direction[row], kWrittenDigitsMm);
      EXPECT_NEAR(header.image.directions[2][axis], camera.beam_direction()[row], kWrittenDigitsMm);
    }
    EXPECT_NEAR(header.image.spacing_mm[0], camera.pixel_spacing_mm.x(), kWrittenDigitsMm);
  }
}

TEST(SlicerFiles, OfACaseWithoutFiducialsHaveNone) {
  const test::ScratchFolder folder;
  const test::SmallCase small = test::small_case();
  StudyCase study_case = some_case();
  study_case.fiducials_ct_mm.clear();
  write_slicer_folder(*small.problem, small.gold_room_from_ct, study_case, folder.path());
  EXPECT_FALSE(std::filesystem::exists(folder / "fiducials.mrk.json"));
}

TEST(SlicerFiles, AreRemovedButNothingElse) {
  const test::ScratchFolder folder;
  const test::SmallCase small = test::small_case();
  write_slicer_folder(*small.problem, small.gold_room_from_ct, some_case(), folder / "slicer");
  write_text_file(folder / "slicer/scene.mrml", "somebody's");
  remove_slicer_files(*small.problem, folder / "slicer");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder / "slicer"), {}), 1);
  EXPECT_TRUE(std::filesystem::exists(folder / "slicer/scene.mrml"));
  std::filesystem::remove(folder / "slicer/scene.mrml");
  remove_slicer_files(*small.problem, folder / "slicer");
  EXPECT_FALSE(std::filesystem::exists(folder / "slicer"));
}

}  // namespace
}  // namespace af::registration
