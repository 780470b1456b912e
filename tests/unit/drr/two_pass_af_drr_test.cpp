// SPDX-License-Identifier: Apache-2.0
#include "drr/two_pass_af_drr.h"

#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/vector_width.h"
#include "drr/field_renderer.h"
#include "drr/ray_by_ray_af_drr.h"
#include "support/central_differences.h"
#include "unit/drr/small_fields.h"

namespace af {
namespace {

constexpr TwoPassOptions kLinear;
constexpr TwoPassOptions kCubicSum{.sums_on_more_nodes = true};
constexpr TwoPassOptions kCubicInSt{AxisInterpolation::Cubic, AxisInterpolation::Linear};
constexpr TwoPassOptions kCubic{AxisInterpolation::Cubic, AxisInterpolation::Cubic};

/// Everything a renderer can make of one view.
struct Outputs {
  std::vector<float> values, planes, column_gradient, row_gradient;

  bool operator==(const Outputs&) const = default;
};

Outputs all_outputs(const TwoPassAfDrr& renderer,
                    const RigidTransform& pose,
                    const View& view,
                    RenderWorkspace& workspace) {
  const std::size_t pixels = view.pixel_count();
  Outputs outputs{std::vector<float>(pixels),
                  std::vector<float>(6 * pixels),
                  std::vector<float>(pixels),
                  std::vector<float>(pixels)};
  const PoseGradients gradients{Eigen::Vector3d(10.0, -20.0, 30.0), outputs.planes};
  renderer.render(pose, view, workspace, outputs.values, gradients);
  renderer.render_gradient_images(
      pose, view, workspace, outputs.column_gradient, outputs.row_gradient);
  return outputs;
}

/// |a - b| / |b| over elements [begin, end).
double relative_difference(const std::vector<float>& a,
                           const std::vector<float>& b,
                           std::size_t begin,
                           std::size_t end) {
  double difference = 0.0;
  double norm = 0.0;
  for (std::size_t i = begin; i < end; ++i) {
    difference += std::pow(static_cast<double>(a[i]) - static_cast<double>(b[i]), 2);
    norm += std::pow(static_cast<double>(b[i]), 2);
  }
  return std::sqrt(difference / norm);
}

TEST(TwoPassAfDrr, EveryVectorWidthGivesTheSameBits) {
  for (const TwoPassOptions& options : {kLinear, kCubicSum, kCubicInSt, kCubic})
    for (const int slabs : {1, 2}) {
      const auto field = small_field(waves, slabs, 7, 51);
      const TwoPassAfDrr compressed(field, options);
      const TwoPassAfDrr level(make_field_pyramid(field, 1).front(), options);
      // Pixels 1, 1.5 and 4 times as far apart as nodes: kernels read these in different ways.
      const View whole = View::whole_detector(small_camera());
      View apart = whole;
      apart.camera.pixel_spacing_mm *= 1.5;
      apart.camera.detector_origin_point = apart.camera.detector_point(-3.0, -2.5);
      apart.roi = {5, 4, 20, 16};
      for (const View& view : {whole, apart, whole.coarser(4)})
        for (const TwoPassAfDrr* renderer : {&compressed, &level}) {
          const RigidTransform pose = pose_from_parameters({}, small_pose(8));
          const auto workspace = renderer->make_workspace();
          Outputs first;
          for (const VectorWidth width : supported_vector_widths()) {
            force_vector_width(width);
            const Outputs outputs = all_outputs(*renderer, pose, view, *workspace);
            if (first.values.empty()) first = outputs;
            EXPECT_EQ(outputs, first) << to_string(width) << " bits";
          }
          force_vector_width(std::nullopt);
        }
    }
}

TEST(TwoPassAfDrr, MeanRemovedTilesGiveTheBitsOfPlainOnes) {
  for (const TwoPassOptions& options : {kLinear, kCubic})
    for (const int slabs : {1, 2}) {
      const auto plain = small_field(waves, slabs, 7, 51);
      const auto with_means = mean_removed(*plain, 48);
      ASSERT_TRUE(problems(*with_means).empty()) << problems(*with_means).front();
      const TwoPassAfDrr expected(plain, options);
      const TwoPassAfDrr found(with_means, options);
      const View view = View::whole_detector(small_camera());
      const RigidTransform pose = pose_from_parameters({}, small_pose(8));
      for (const VectorWidth width : supported_vector_widths()) {
        force_vector_width(width);
        EXPECT_EQ(all_outputs(found, pose, view, *found.make_workspace()),
                  all_outputs(expected, pose, view, *expected.make_workspace()))
            << to_string(width);
      }
      force_vector_width(std::nullopt);
    }
}

/// The same tile everywhere, whose levels go beyond both ends.
TEST(TwoPassAfDrr, LevelsOfMeanRemovedTilesAreLimited) {
  for (const int mean : {96, 65520}) {
    const auto field = small_field(waves, 1, 6, 24);
    Tile shape{};
    for (std::size_t i = 0; i < shape.size(); ++i)
      shape[i] = static_cast<std::uint16_t>(kShapeZero + (i % 2 == 0 ? 700 : -700));
    field->codebook = {{Tile{}, shape}, 48};
    std::vector<std::uint16_t> values(2 * field->slabs[0].indices.size(), 1);
    for (std::size_t i = 0; i < values.size(); ++i)
      if (i / 12 % 2 == 1) values[i] = static_cast<std::uint16_t>(mean);
    field->slabs[0].indices = SharedArray<std::uint16_t>(values);
    ASSERT_TRUE(problems(*field).empty()) << problems(*field).front();
    const float low = field->quantizer_step * (mean == 96 ? 0.0f : 64820.0f);
    const float high = field->quantizer_step * (mean == 96 ? 796.0f : 65535.0f);
    EXPECT_EQ(field->node_value(0, {0, 0, 0, 0}), high);
    EXPECT_EQ(field->node_value(0, {1, 2, 4, 7}), low);
    const View view = View::whole_detector(small_camera());
    const auto of_field = [&](const DrrRenderer& renderer) {
      std::vector<float> drr(view.pixel_count());
      renderer.render(RigidTransform::Identity(), view, *renderer.make_workspace(), drr);
      return drr;
    };
    const auto expected = of_field(RayByRayAfDrr(field, FieldInterpolation::Quadrilinear));
    for (const VectorWidth width : supported_vector_widths()) {
      force_vector_width(width);
      const FieldLevel decoded = decode_field(field);
      for (const std::uint16_t sample : decoded.slabs[0].samples.view().first(24 * 24))
        ASSERT_TRUE(static_cast<float>(sample) * field->quantizer_step == low ||
                    static_cast<float>(sample) * field->quantizer_step == high);
      const auto found = of_field(TwoPassAfDrr(field, kLinear));
      constexpr float kRounding = 0.02f;  // of floats around 16384
      for (std::size_t i = 0; i < found.size(); ++i)
        ASSERT_NEAR(found[i], expected[i], kRounding) << to_string(width);
    }
    force_vector_width(std::nullopt);
  }
}

TEST(FieldRenderer, ADecodedFieldIsLookedUpAsTheFieldIs) {
  const auto field = small_field(waves, 2, 6, 24);
  const auto decoded = std::make_shared<const FieldLevel>(decode_field(field));
  const View view = View::whole_detector(small_camera());
  const RigidTransform pose = pose_from_parameters({}, small_pose(3));
  std::vector<Image2d> images;
  for (const char* look_up : {"linear", "cubic-sum", "cubic", "cubic-uv"}) {
    images.push_back(render_image(*make_field_renderer(field, look_up), pose, view));
    const Image2d image = render_image(*make_field_renderer(decoded, look_up), pose, view);
    constexpr float kRounding = 0.02f;  // of floats around 16384
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      ASSERT_NEAR(image.pixels[i], images.back().pixels[i], kRounding) << look_up;
  }
  for (std::size_t i = 1; i < images.size(); ++i) EXPECT_NE(images[i].pixels, images[i - 1].pixels);
  for (const char* look_up : {"nearest", "quadrilinear", "psychic"})
    EXPECT_THROW((void)make_field_renderer(decoded, look_up), InputError) << look_up;
}

TEST(TwoPassAfDrr, AnyNumberOfThreadsGivesTheSameBits) {
  // Pixels enough for several bands.
  View view = View::whole_detector(small_camera());
  view.camera.pixel_spacing_mm /= 16.0;
  view.camera.size_px *= 16;
  view.roi = {0, 0, view.camera.size_px.x(), view.camera.size_px.y()};
  const RigidTransform pose = pose_from_parameters({}, small_pose(8));
  for (const TwoPassOptions& options : {kLinear, kCubicSum, kCubicInSt}) {
    const auto field = small_field(waves, 2, 7, 41);
    const auto level = make_field_pyramid(field, 1).front();
    const TwoPassAfDrr alone(field, options);
    const TwoPassAfDrr level_alone(level, options);
    for (const int threads : {2, 5}) {
      const auto pool = std::make_shared<ThreadPool>(threads);
      const TwoPassAfDrr shared(field, options, pool);
      const TwoPassAfDrr level_shared(level, options, pool);
      EXPECT_EQ(all_outputs(shared, pose, view, *shared.make_workspace()),
                all_outputs(alone, pose, view, *alone.make_workspace()));
      EXPECT_EQ(all_outputs(level_shared, pose, view, *level_shared.make_workspace()),
                all_outputs(level_alone, pose, view, *level_alone.make_workspace()));
    }
  }
}

TEST(TwoPassAfDrr, AWorkspaceLeavesNoTrace) {
  // Nodes that no ray needs are not written: what an earlier pose left there must not matter.
  for (const TwoPassOptions& options : {kLinear, kCubicSum, kCubic}) {
    const auto field = small_field(waves, 2, 7, 41);
    const TwoPassAfDrr renderer(field, options);
    const TwoPassAfDrr level(make_field_pyramid(field, 1).front(), options);
    const View view{small_camera(), {4, 3, 20, 18}};
    const auto workspace = renderer.make_workspace();
    for (std::uint64_t i = 0; i < 20; ++i) {
      PoseParameters parameters = small_pose(i);
      parameters.rotation_rad.y() = (i % 2 == 0 ? 0.14 : -0.14);  // about the beam
      const RigidTransform pose = pose_from_parameters({}, parameters);
      for (const TwoPassAfDrr* each : {&renderer, &level})
        EXPECT_EQ(all_outputs(*each, pose, view, *workspace),
                  all_outputs(*each, pose, view, *each->make_workspace()));
    }
  }
}

TEST(TwoPassAfDrr, ValueIsTheSameWithAndWithoutGradients) {
  const auto field = small_field(waves, 2, 7, 21);
  const View view = View::whole_detector(small_camera());
  const RigidTransform pose = pose_from_parameters({}, small_pose(2));
  for (const TwoPassOptions& options : {kLinear, kCubic}) {
    const TwoPassAfDrr renderer(field, options);
    EXPECT_EQ(all_outputs(renderer, pose, view, *renderer.make_workspace()).values,
              render_image(renderer, pose, view).pixels);
  }
}

TEST(TwoPassAfDrr, LargeMagnificationAndSteepRowsAgreeWithQuadrilinearLookup) {
  // 16 pixels span more than 16 nodes, or many rows: lanes are gathered instead of picked. A field
  // without u-s and v-t products is bilinear between nodes, and both look-ups must agree.
  const auto bilinear = [](const RayNodes& n) {
    return 4000 + 30 * n.u + 50 * n.v + 70 * n.s + 20 * n.t + n.s * n.t;
  };
  const auto field = small_field(bilinear, 1, 5, 151);
  CameraGeometry turned = small_camera();
  std::swap(turned.column_direction, turned.row_direction);
  turned.detector_origin_point = {-69.0, 370.0, 90.0};
  CameraGeometry oblique = small_camera();
  oblique.column_direction = Eigen::Vector3d(1.0, 0.0, 0.5).normalized();
  oblique.row_direction = Eigen::Vector3d(0.5, 0.0, -1.0).normalized();
  oblique.pixel_spacing_mm = {0.8, 0.8};
  oblique.detector_origin_point = {-20.0, 370.0, 5.0};
  for (const CameraGeometry& camera : {small_camera(), turned, oblique}) {
    const View view = View::whole_detector(camera);
    for (std::uint64_t i = 0; i < 5; ++i) {
      const RigidTransform pose = pose_from_parameters({}, small_pose(i));
      const Image2d expected = render_image(RayByRayAfDrr(field), pose, view);
      const Image2d image = render_image(TwoPassAfDrr(field), pose, view);
      // Single-precision node coordinates (150 nodes, 1e-5) times 220 levels a node of 10^4.
      constexpr float kTolerance = 2e-6f;
      for (std::size_t p = 0; p < image.pixels.size(); ++p)
        ASSERT_NEAR(image.pixels[p], expected.pixels[p], kTolerance * expected.pixels[p]);
    }
  }
}

TEST(TwoPassAfDrr, GradientsAgreeWithCentralDifferences) {
  // Slopes jump at the borders between cells: in a share of pixels of about twice the step over the
  // spacing (0.02 mm of 14 mm nodes, as wide as the pixels) the difference mixes two slopes.
  // Single-precision noise is 1e-7 of the value over 1e-6 of it per step.
  const test::DifferenceSteps steps{1e-4, 0.05};
  constexpr double kRelativeTolerance = 0.03;
  for (const TwoPassOptions& options : {kLinear, kCubicSum, kCubicInSt, kCubic})
    for (const int slabs : {1, 2}) {
      const auto field = small_field(waves, slabs, 7, 41);
      const TwoPassAfDrr fine(field, options);
      const TwoPassAfDrr level(make_field_pyramid(field, 1).front(), options);
      for (const TwoPassAfDrr* renderer : {&fine, &level}) {
        const View view{small_camera(), {3, 2, 20, 15}};
        const RigidTransform pose = pose_from_parameters({}, small_pose(6));
        const auto workspace = renderer->make_workspace();
        const Outputs outputs = all_outputs(*renderer, pose, view, *workspace);
        std::vector<float> differences(outputs.planes.size());
        test::central_difference_gradients(*renderer,
                                           pose,
                                           view,
                                           *workspace,
                                           {Eigen::Vector3d(10.0, -20.0, 30.0), differences},
                                           steps);
        const std::size_t pixels = view.pixel_count();
        for (std::size_t parameter = 0; parameter < 6; ++parameter)
          EXPECT_LT(relative_difference(
                        outputs.planes, differences, parameter * pixels, (parameter + 1) * pixels),
                    kRelativeTolerance)
              << "parameter " << parameter << ", " << slabs << " slabs";
      }
    }
}

TEST(TwoPassAfDrr, GradientsOfAMultilinearFieldEqualThoseOfQuadrilinearLookup) {
  const auto field = small_field(
      [](const RayNodes& n) {
        return 4000 + 30 * n.u + 50 * n.v + 70 * n.s + 20 * n.t + n.s * n.t + 5 * n.u * n.v;
      },
      2,
      5,
      21);
  const View view{small_camera(), {3, 2, 20, 15}};
  const RigidTransform pose = pose_from_parameters({}, small_pose(6));
  std::vector<float> values(view.pixel_count());
  std::vector<float> expected(6 * view.pixel_count());
  const RayByRayAfDrr exact(field);
  const Eigen::Vector3d pivot(10.0, -20.0, 30.0);
  exact.render(pose, view, *exact.make_workspace(), values, PoseGradients{pivot, expected});
  const TwoPassAfDrr renderer(field);
  const Outputs outputs = all_outputs(renderer, pose, view, *renderer.make_workspace());
  // The slope along the source's depth is taken at the pixel instead of its four nodes: within a
  // cell of 14 mm, 2 % of the source's distance, times the small (u,v) part.
  constexpr double kRelativeTolerance = 2e-3;
  for (std::size_t parameter = 0; parameter < 6; ++parameter)
    EXPECT_LT(
        relative_difference(
            outputs.planes, expected, parameter * values.size(), (parameter + 1) * values.size()),
        kRelativeTolerance)
        << "parameter " << parameter;
}

TEST(TwoPassAfDrr, CroppedFieldEqualsOneThatStoresItsZeros) {
  // The footprint reaches beyond the stored nodes, on any side, in part or altogether.
  for (const auto& [s, t] : {std::pair<NodeRange, NodeRange>{{14, 12}, {16, 10}},
                             {{2, 6}, {30, 8}},
                             {{34, 7}, {20, 2}},
                             {{12, 2}, {0, 41}}}) {
    const auto is_stored = [&](const RayNodes& n) {
      return n.s >= s.begin && n.s < s.end() && n.t >= t.begin && n.t < t.end();
    };
    const auto whole =
        small_field([&](const RayNodes& n) { return is_stored(n) ? waves(n) : 0.0; }, 1, 5, 41);
    const auto cropped = small_field(waves, 1, 5, 41);
    crop_stored(*cropped, s, t);
    for (const TwoPassOptions& options : {kLinear, kCubic}) {
      const TwoPassAfDrr expected(whole, options);
      const TwoPassAfDrr renderer(cropped, options);
      const TwoPassAfDrr level(std::make_shared<const FieldLevel>(decode_field(cropped)), options);
      const TwoPassAfDrr level_of_whole(std::make_shared<const FieldLevel>(decode_field(whole)),
                                        options);
      for (std::uint64_t i = 0; i < 30; ++i) {
        const RigidTransform pose = pose_from_parameters({}, small_pose(i));
        const View view{small_camera(), {3, 2, 25, 20}};
        const auto workspace = renderer.make_workspace();
        EXPECT_EQ(all_outputs(renderer, pose, view, *workspace),
                  all_outputs(expected, pose, view, *workspace));
        EXPECT_EQ(all_outputs(level, pose, view, *workspace),
                  all_outputs(level_of_whole, pose, view, *workspace));
      }
    }
  }
}

TEST(TwoPassAfDrr, OutsideRaysHaveNoGradient) {
  const auto field = small_field(waves, 2, 7, 21);
  const View view = View::whole_detector(small_camera());
  const RigidTransform pose = pose_partly_outside();
  const TwoPassAfDrr renderer(field);
  const Outputs outputs = all_outputs(renderer, pose, view, *renderer.make_workspace());
  int outside = 0;
  for (std::size_t i = 0; i < outputs.values.size(); ++i) {
    if (outputs.values[i] != 0.0f) continue;
    ++outside;
    for (std::size_t plane = 0; plane < 6; ++plane)
      EXPECT_EQ(outputs.planes[plane * outputs.values.size() + i], 0.0f);
    EXPECT_EQ(outputs.column_gradient[i], 0.0f);
    EXPECT_EQ(outputs.row_gradient[i], 0.0f);
  }
  EXPECT_GT(outside, 0);
  EXPECT_LT(outside, static_cast<int>(outputs.values.size()));
}

TEST(TwoPassAfDrr, CountsTheRaysThatRenderingCounts) {
  const auto field = small_field(waves, 2, 7, 21);
  const View view = View::whole_detector(small_camera());
  const TwoPassAfDrr renderer(field);
  const RayByRayAfDrr literal(field);
  PoseParameters turned;
  turned.rotation_rad = {2.0, 0.0, 0.0};
  for (const RigidTransform& pose : {pose_from_parameters({}, small_pose(3)),
                                     pose_partly_outside(),
                                     pose_from_parameters({}, turned)}) {
    std::int64_t outside = 0;
    render_image(renderer, pose, view, &outside);
    EXPECT_EQ(renderer.rays_outside(pose, view), outside);
    EXPECT_EQ(literal.rays_outside(pose, view), outside);
  }
}

TEST(FieldRenderer, SearchesSumSeveralSlabsThatAreMeantForCubicLookUp) {
  EXPECT_EQ(look_up_of_searches("cubic", 2), "cubic-sum");
  EXPECT_EQ(look_up_of_searches("cubic", 1), "cubic");
  EXPECT_EQ(look_up_of_searches("linear", 8), "linear");
  EXPECT_EQ(look_up_of_searches("cubic-uv", 8), "cubic-uv");
}

TEST(TwoPassAfDrr, ASumOnMoreNodesIsTheLinearLookUpOfOneSlab) {
  const auto field = small_field(waves, 1, 7, 41);
  const View view = View::whole_detector(small_camera());
  const RigidTransform pose = pose_from_parameters({}, small_pose(3));
  const TwoPassAfDrr linear(field, kLinear), sum(field, kCubicSum);
  EXPECT_EQ(all_outputs(sum, pose, view, *sum.make_workspace()),
            all_outputs(linear, pose, view, *linear.make_workspace()));
}

TEST(TwoPassAfDrr, CubicInterpolationIsMoreAccurateOnASmoothField) {
  // A wave of 9 nodes along s and t: between nodes, linear interpolation errs by up to
  // (2 pi / 9)^2 / 8 = 6 % of it, the cubic ones by some tenths of that. On a sum with nodes 4/5 as
  // far apart it errs by 16/25 of that.
  constexpr double kWaveNumber = 2.0 * std::numbers::pi / 9.0;
  const auto wave = [](const RayNodes& n) {
    return std::sin(kWaveNumber * n.s) * std::sin(kWaveNumber * n.t);
  };
  const auto level = [&](const RayNodes& n) { return std::round(20000 + 10000 * wave(n)); };
  CameraGeometry camera = small_camera();
  camera.pixel_spacing_mm = {1.7, 1.7};
  camera.detector_origin_point = {-25.0, 370.0, 20.0};
  const View view = View::whole_detector(camera);
  const RigidTransform pose = pose_from_parameters({}, small_pose(1));
  const auto rms_error = [&](int slabs, const TwoPassOptions& options) {
    const auto field = small_field(level, slabs, 5, 41);
    const RigidTransform slab_from_room = field->light_slab.slab_from_ct * pose.inverse();
    const Image2d image = render_image(TwoPassAfDrr(field, options), pose, view);
    double squares = 0.0;
    for (int row = 0; row < image.height; ++row)
      for (int column = 0; column < image.width; ++column) {
        const Ray ray = camera.ray(column, row);
        double expected = 0.0;
        for (const SlabGeometry& slab : field->light_slab.slabs) {
          const RayNodes nodes = *field->light_slab.intersect(
              {slab_from_room * ray.origin_point, slab_from_room.linear() * ray.direction}, slab);
          expected += 0.25 * (20000 + 10000 * wave(nodes));
        }
        squares += std::pow(static_cast<double>(image.at(column, row)) - expected, 2);
      }
    return std::sqrt(squares / static_cast<double>(view.pixel_count()));
  };
  constexpr double kLeastGain = 2.5;  // the last step remains linear
  for (const int slabs : {1, 2})
    EXPECT_GT(rms_error(slabs, kLinear), kLeastGain * rms_error(slabs, kCubicInSt)) << slabs;
  constexpr double kLeastGainOfTheSum = 1.4;  // of 25/16
  EXPECT_GT(rms_error(2, kLinear), kLeastGainOfTheSum * rms_error(2, kCubicSum));
}

TEST(TwoPassAfDrr, CubicInterpolationReproducesALinearField) {
  // Including the outermost viewpoints, beyond which the field continues linearly.
  const auto linear = [](const RayNodes& n) {
    return 4096 + 64 * (3 * n.u + 5 * n.v + 8 * n.s - 4 * n.t);
  };
  const auto field = small_field(linear, 2, 4, 41);
  const View view{small_camera(), {10, 8, 10, 8}};  // away from the edge of (s,t)
  for (std::uint64_t i = 0; i < 10; ++i) {
    const RigidTransform pose = pose_from_parameters({}, small_pose(i));
    const Image2d expected = render_image(TwoPassAfDrr(field, kLinear), pose, view);
    const Image2d image = render_image(TwoPassAfDrr(field, kCubic), pose, view);
    constexpr float kTolerance = 1e-5f;  // single precision over a few dozen operations
    for (std::size_t p = 0; p < image.pixels.size(); ++p)
      EXPECT_NEAR(image.pixels[p], expected.pixels[p], kTolerance * expected.pixels[p]);
  }
}

TEST(TwoPassAfDrr, GradientImagesEqualDifferencesOfASmoothDrr) {
  // Where the blended image is bilinear in (s,t), Sobel's smoothing changes nothing, and central
  // differences over two pixels are exact but for the perspective within them.
  const auto field = small_field(
      [](const RayNodes& n) {
        return 4000 + 30 * n.u + 50 * n.v + 70 * n.s + 20 * n.t + n.s * n.t;
      },
      2,
      5,
      41);
  const TwoPassAfDrr renderer(field);
  const View view{small_camera(), {5, 4, 20, 15}};
  for (std::uint64_t i = 0; i < 5; ++i) {
    const RigidTransform pose = pose_from_parameters({}, small_pose(i));
    const Image2d drr = render_image(renderer, pose, view);
    const Outputs outputs = all_outputs(renderer, pose, view, *renderer.make_workspace());
    std::array<double, 2> difference{};
    std::array<double, 2> norm{};
    for (int row = 1; row + 1 < drr.height; ++row)
      for (int column = 1; column + 1 < drr.width; ++column) {
        const auto at = static_cast<std::size_t>(row * drr.width + column);
        const std::array<double, 2> expected{
            0.5 * static_cast<double>(drr.at(column + 1, row) - drr.at(column - 1, row)),
            0.5 * static_cast<double>(drr.at(column, row + 1) - drr.at(column, row - 1))};
        const std::array<float, 2> gradient{outputs.column_gradient[at], outputs.row_gradient[at]};
        for (std::size_t axis = 0; axis < 2; ++axis) {
          difference[axis] += std::pow(static_cast<double>(gradient[axis]) - expected[axis], 2);
          norm[axis] += std::pow(expected[axis], 2);
        }
      }
    constexpr double kRelativeTolerance = 2e-3;
    for (std::size_t axis = 0; axis < 2; ++axis)
      EXPECT_LT(std::sqrt(difference[axis] / norm[axis]), kRelativeTolerance);
  }
}

}  // namespace
}  // namespace af
