// SPDX-License-Identifier: Apache-2.0
// What objectives say about poses, and what registrations of noisy X-rays make of it.
#include "register/verdict/uncertainty_estimator.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "register/method/presets.h"
#include "register/verdict/calibration.h"
#include "register/verdict/pose_covariance.h"
#include "register/verdict/pose_examiner.h"
#include "register/verdict/pose_information.h"
#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

/// A pixel is a linear function of the pose's parameters about `frame`: a sum of squared
/// differences is then a quadratic function of them.
class LinearRenderer final : public DrrRenderer {
 public:
  explicit LinearRenderer(PoseFrame frame) : frame_(std::move(frame)) {}

  static double slope(std::size_t pixel, std::size_t k) {
    return std::sin(1.0 + static_cast<double>(pixel) * (0.37 + 0.11 * static_cast<double>(k))) /
           (k < 3 ? 0.02 : 1.0);
  }
  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& /*workspace*/,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients) const override {
    const PoseParameters parameters = parameters_from_pose(frame_, room_from_ct);
    PoseVector point;
    point << parameters.rotation_rad, parameters.translation_mm;
    for (std::size_t pixel = 0; pixel < view.pixel_count(); ++pixel) {
      double value = 1.0;
      for (std::size_t k = 0; k < 6; ++k) {
        value += slope(pixel, k) * point[static_cast<Eigen::Index>(k)];
        if (gradients.has_value())
          gradients->planes[k * view.pixel_count() + pixel] = static_cast<float>(slope(pixel, k));
      }
      total_attenuation[pixel] = static_cast<float>(value);
    }
    return {};
  }
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override {
    return std::make_unique<RenderWorkspace>();
  }
  [[nodiscard]] const char* name() const override { return "linear"; }

 private:
  PoseFrame frame_;
};

/// -|x - d|^2 over the pixels, and its derivative; nothing normalised.
class PlainSquares final : public DifferentiableMeasure {
 public:
  explicit PlainSquares(std::vector<float> xray) : xray_(std::move(xray)) {}

  [[nodiscard]] double evaluate(std::span<const float> drr,
                                SimilarityWorkspace& /*workspace*/) const override {
    double sum = 0.0;
    for (std::size_t i = 0; i < drr.size(); ++i)
      sum -= std::pow(static_cast<double>(xray_[i] - drr[i]), 2);
    return sum;
  }
  double evaluate_with_derivative(std::span<const float> drr,
                                  std::span<float> derivative,
                                  SimilarityWorkspace& workspace) const override {
    for (std::size_t i = 0; i < drr.size(); ++i) derivative[i] = 2.0f * (xray_[i] - drr[i]);
    return evaluate(drr, workspace);
  }
  [[nodiscard]] std::unique_ptr<SimilarityWorkspace> make_workspace() const override {
    return std::make_unique<SimilarityWorkspace>();
  }

 private:
  std::vector<float> xray_;
};

TEST(PoseInformation, OfAQuadraticObjectiveIsItsHessian) {
  const PoseFrame frame;
  const View view = {test::small_camera(false), {0, 0, 24, 24}};
  std::vector<float> xray(view.pixel_count(), 1.0f);
  std::mt19937_64 random(1);
  std::normal_distribution<float> noise(0.0f, 0.1f);
  for (float& value : xray) value += noise(random);
  MultiViewObjective objective({{view,
                                 std::make_shared<LinearRenderer>(frame),
                                 std::make_shared<PlainSquares>(xray),
                                 std::nullopt}});
  PoseVector sizes = PoseVector::Ones();
  sizes.head<3>().setConstant(1.0 / 50.0);
  PoseMatrix basis = sizes.asDiagonal();
  basis(3, 4) = 3.0;  // not the parameters themselves
  const auto information = information_at(objective, frame, basis, 4);
  ASSERT_TRUE(information.has_value());
  PoseMatrix hessian = PoseMatrix::Zero();
  std::vector<PoseVector> scores(16, PoseVector::Zero());
  for (std::size_t pixel = 0; pixel < view.pixel_count(); ++pixel) {
    PoseVector slopes;
    for (std::size_t k = 0; k < 6; ++k)
      slopes[static_cast<Eigen::Index>(k)] = LinearRenderer::slope(pixel, k);
    hessian += 2.0 * slopes * slopes.transpose();
    const std::size_t tile = pixel / 24 / 6 * 4 + pixel % 24 / 6;
    scores[tile] += 2.0 * static_cast<double>(xray[pixel] - 1.0f) * slopes;
  }
  PoseMatrix scatter = PoseMatrix::Zero();
  for (const PoseVector& score : scores) scatter += score * score.transpose();
  // Float pixels over steps of 0.2 mm.
  EXPECT_TRUE(information->curvature.isApprox(hessian, 1e-4));
  EXPECT_TRUE(information->scatter.isApprox(scatter, 1e-4));
}

TEST(BentCurvature, KeepsDirectionsThatAreKnown) {
  PoseVector sizes;
  sizes << 100, 50, 20, 10, 5, -3;
  const PoseMatrix bent = bent_curvature(sizes.asDiagonal(), PoseMatrix::Identity());
  sizes[5] = kLeastRelativeCurvature * 100;
  EXPECT_TRUE(bent.isApprox(PoseMatrix(sizes.asDiagonal()), 1e-12));
  // The same matrix in other parameters.
  PoseMatrix basis = PoseMatrix::Identity();
  basis(0, 3) = 2.0;
  basis(5, 1) = -0.5;
  const PoseMatrix back = basis.inverse();
  sizes[5] = -3;
  const PoseMatrix skew = bent_curvature(back.transpose() * sizes.asDiagonal() * back, basis);
  EXPECT_TRUE(skew.isApprox(back.transpose() * bent * back, 1e-12));
  EXPECT_TRUE(bent_curvature(-PoseMatrix::Identity(), PoseMatrix::Identity()).isZero());
}

TEST(BentCurvature, RaisesWhatDrownsInScatter) {
  PoseVector sizes;
  sizes << 100, 50, 20, 3, 2.5, -3;
  PoseVector gradients;  // standard deviations, per mm
  gradients << 60, 60, 60, 2, 4, 60;
  const PoseMatrix scatter = gradients.cwiseAbs2().asDiagonal();
  const PoseMatrix bent = bent_curvature(sizes.asDiagonal(), PoseMatrix::Identity(), scatter);
  sizes.tail<3>() << 3, 4 / kScatterLengthMm, 100 * kDrownedCurvature;
  EXPECT_TRUE(bent.isApprox(PoseMatrix(sizes.asDiagonal()), 1e-12)) << bent;
}

/// Sums of squares from start to end, at one resolution.
RegistrationOptions squares() {
  RegistrationOptions options = preset_options("paper");
  StageOptions stage;
  stage.similarity.name = "ssd";
  stage.optimizer = "gauss-newton";
  stage.search.initial_step_mm = 2.0;
  stage.search.final_step_mm = 0.001;
  options.chains = {{"squares", {stage}}};
  return options;
}

TEST(UncertaintyEstimator, ForetellsTheSpreadOfNoisyXrays) {
  const test::SmallCase small = test::small_case();
  const std::vector<RegistrationView> clean = small.problem->views;
  const PoseFrame frame = PoseFrame::about(small.gold_room_from_ct, small.problem->center_ct_mm);
  std::mt19937_64 random(11);
  std::normal_distribution<float> noise(0.0f, 0.02f);
  constexpr int kRepeats = 40;
  PoseMatrix spread = PoseMatrix::Zero();
  PoseMatrix predicted = PoseMatrix::Zero();
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    const auto problem = std::make_shared<RegistrationProblem>(*small.problem);
    for (RegistrationView& view : problem->views)
      for (float& value : view.xray.pixels) value += noise(random);
    Registration registration(problem, squares());
    const RegistrationResult result = registration.search(small.gold_room_from_ct);
    const UncertaintyReport report =
        UncertaintyEstimator(problem, squares(), {}).report(result, std::vector<ViewValue>{{1, 1}});
    ASSERT_TRUE(std::isfinite(report.covariance_deg_mm[0]));
    predicted += from_deg_mm(report.covariance_deg_mm) / report.inflation / kRepeats;
    const PoseParameters error = parameters_from_pose(frame, result.room_from_ct);
    PoseVector error_rad_mm;
    error_rad_mm << error.rotation_rad, error.translation_mm;
    spread += error_rad_mm * error_rad_mm.transpose() / kRepeats;
  }
  // 40 repeats know a variance to 22 %, and a few pixels of 3 mm with rays sampled at 2 mm make a
  // rough objective: standard deviations within a factor of two.
  for (int k = 0; k < 6; ++k) {
    EXPECT_GT(predicted(k, k) / spread(k, k), 0.25) << k;
    EXPECT_LT(predicted(k, k) / spread(k, k), 4.0) << k;
  }
}

TEST(UncertaintyEstimator, ForetellsHowLittleOneViewShowsOfDepth) {
  test::SmallCase small = test::small_case();
  small.problem->views.resize(1);
  RegistrationView& view = small.problem->views.front();
  // Seen obliquely, so that no axis of the room is the beam.
  const Eigen::AngleAxisd turn(0.7, Eigen::Vector3d(0.3, 0.2, 1.0).normalized());
  CameraGeometry& camera = view.view.camera;
  for (Eigen::Vector3d* vector : {&camera.source_point,
                                  &camera.detector_origin_point,
                                  &camera.column_direction,
                                  &camera.row_direction})
    *vector = turn * *vector;
  view.xray = render_image(*view.renderer, small.gold_room_from_ct, View::whole_detector(camera));
  const Eigen::Vector3d target_ct_mm = small.problem->center_ct_mm + Eigen::Vector3d(5, -3, 2);
  small.problem->target_points_ct = {target_ct_mm - Eigen::Vector3d::UnitX(),
                                     target_ct_mm + Eigen::Vector3d::UnitX()};
  const Eigen::Vector3d beam = camera.column_direction.cross(camera.row_direction).normalized();
  const Image2d clean = view.xray;
  const PoseFrame frame = PoseFrame::about(small.gold_room_from_ct, small.problem->center_ct_mm);
  std::mt19937_64 random(19);
  std::normal_distribution<float> noise(0.0f, 0.02f);
  constexpr int kRepeats = 40;
  double depth_variance = 0.0, predicted_depth_variance = 0.0, predicted_variance_across = 0.0;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    const auto problem = std::make_shared<RegistrationProblem>(*small.problem);
    for (float& value : problem->views.front().xray.pixels) value += noise(random);
    const RegistrationResult result =
        Registration(problem, squares()).search(small.gold_room_from_ct);
    const UncertaintyReport report =
        UncertaintyEstimator(problem, squares(), {}).report(result, std::vector<ViewValue>{{1, 1}});
    ASSERT_TRUE(std::isfinite(report.covariance_deg_mm[0]));
    const PoseMatrix sandwich = from_deg_mm(report.covariance_deg_mm) / report.inflation;
    EXPECT_NEAR(report.depth_95_mm /
                    depth_95_mm(report.tre_inflation * sandwich,
                                PoseFrame::about(result.room_from_ct, problem->center_ct_mm),
                                target_ct_mm,
                                camera.source_point),
                1.0,
                1e-6);
    const Eigen::Matrix3d covariance = sandwich.bottomRightCorner<3, 3>();
    const Eigen::Vector3d error = parameters_from_pose(frame, result.room_from_ct).translation_mm;
    depth_variance += std::pow(beam.dot(error), 2) / kRepeats;
    predicted_depth_variance += beam.dot(covariance * beam) / kRepeats;
    predicted_variance_across +=
        camera.row_direction.dot(covariance * camera.row_direction) / kRepeats;
  }
  EXPECT_GT(predicted_depth_variance, 100.0 * predicted_variance_across);
  // As with two views above.
  EXPECT_GT(predicted_depth_variance / depth_variance, 0.25);
  EXPECT_LT(predicted_depth_variance / depth_variance, 4.0);
}

TEST(UncertaintyEstimator, SaysNothingWithoutAnEnd) {
  const test::SmallCase small = test::small_case();
  RegistrationResult nothing;
  nothing.similarity = std::nan("");
  nothing.stop_reason = StopReason::StartInadmissible;
  UncertaintyEstimator estimator(small.problem, squares(), {});
  const UncertaintyReport report = estimator.report(nothing, {});
  EXPECT_TRUE(std::isnan(report.covariance_deg_mm[0]));
  EXPECT_EQ(report.confidence, 0.0);
  RegistrationResult no_better;
  no_better.room_from_ct = small.gold_room_from_ct;
  no_better.similarity = 1.0;
  no_better.chain = "squares";
  const std::vector<ViewValue> good = {{0.9, 0.9, false, 0.1}, {0.9, 0.9, false, 0.1}};
  EXPECT_GT(estimator.report(no_better, good).confidence, 0.99);
  no_better.stop_reason = StopReason::NoBetterThanNoDrr;
  EXPECT_EQ(estimator.report(no_better, good).confidence, 0.0);
}

TEST(UncertaintyEstimator, LeftOutStatesALowerBoundOfTheConfidenceAlone) {
  const test::SmallCase small = test::small_case();
  RegistrationResult result;
  result.room_from_ct = small.gold_room_from_ct;
  result.similarity = 1.0;
  result.chain = "squares";
  const std::vector<ViewValue> values = {{0.5, 0.3, false, 0.1}, {0.5, 0.3, false, 0.1}};
  UncertaintyOptions none;
  none.is_left_out = true;
  const UncertaintyReport left_out =
      UncertaintyEstimator(small.problem, squares(), none).report(result, values);
  EXPECT_EQ(left_out.confidence, success_confidence({values, std::nan("")}));
  EXPECT_TRUE(std::isnan(left_out.covariance_deg_mm[0]));
  EXPECT_TRUE(std::isnan(left_out.tre_rms_mm));
  EXPECT_LE(left_out.confidence,
            UncertaintyEstimator(small.problem, squares(), {}).report(result, values).confidence);
}

TEST(UncertaintyEstimator, TakesRobustGradientsWhereAMeasureHasNoDerivative) {
  const test::SmallCase small = test::small_case();
  RegistrationOptions options = preset_options("paper");  // the paper's, with pattern intensity
  options.use_similarity("pi");
  RegistrationResult result;
  result.room_from_ct = small.gold_room_from_ct;
  result.similarity = 1.0;
  result.chain = options.chains.front().name;
  UncertaintyEstimator estimator(small.problem, options, {});
  const UncertaintyReport report =
      estimator.report(result, std::vector<ViewValue>{{0.9, 0.9, false, 0.15}});
  EXPECT_TRUE(std::isfinite(report.covariance_deg_mm[0]));
  // How much of the X-rays is explained moves the confidence, whatever the calibration makes of
  // this small case.
  const UncertaintyReport worse =
      estimator.report(result, std::vector<ViewValue>{{0.3, 0.15, false, 0.15}});
  EXPECT_GT(worse.confidence, 0.0);
  EXPECT_GT(report.confidence, 2.0 * worse.confidence);
}

TEST(UncertaintyEstimator, CalibratesTresByThemselves) {
  const test::SmallCase small = test::small_case();
  const auto problem = std::make_shared<RegistrationProblem>(*small.problem);
  const Eigen::Vector3d& center = problem->center_ct_mm;
  problem->target_points_ct = {center, center + Eigen::Vector3d(20, 5, -10)};
  std::mt19937_64 random(13);
  std::normal_distribution<float> noise(0.0f, 0.02f);
  for (RegistrationView& view : problem->views)
    for (float& value : view.xray.pixels) value += noise(random);
  RegistrationOptions options = squares();
  options.chains[0].stages[0].similarity.name = "rg";
  RegistrationResult result;
  result.room_from_ct = small.gold_room_from_ct;
  result.similarity = 1.0;
  result.chain = options.chains[0].name;
  const UncertaintyReport report =
      UncertaintyEstimator(problem, options, {}).report(result, std::vector<ViewValue>{{0.9, 0.9}});
  EXPECT_LT(report.tre_inflation, report.inflation);
  const PredictedTre tre =
      predicted_tre(from_deg_mm(report.covariance_deg_mm) * report.tre_inflation / report.inflation,
                    PoseFrame::about(result.room_from_ct, center),
                    problem->target_points_ct);
  ASSERT_GT(tre.rms_mm, 0.0);
  EXPECT_NEAR(report.tre_rms_mm, tre.rms_mm, 1e-9 * tre.rms_mm);
  EXPECT_NEAR(report.tre_95_mm, tre.upper_95_mm, 1e-9 * tre.upper_95_mm);
  EXPECT_TRUE(std::isnan(report.depth_95_mm)) << "two views show depth";
}

// All starts share this shift, so residuals do not show it. It is added whatever the pose explains.
TEST(UncertaintyEstimator, AddsWhatInterpolationShifts) {
  const test::SmallCase small = test::small_case();
  const auto problem = std::make_shared<RegistrationProblem>(*small.problem);
  problem->target_points_ct = {problem->center_ct_mm};
  RegistrationResult result;
  result.room_from_ct = small.gold_room_from_ct;
  result.similarity = 1.0;
  result.chain = "squares";
  const auto at_spacing = [&](double spacing_mm, double calibration_px = 0.0) {
    for (RegistrationView& view : problem->views) view.sample_spacing_mm = spacing_mm;
    UncertaintyOptions uncertainty;
    uncertainty.calibration_error_px = calibration_px;
    return UncertaintyEstimator(problem, squares(), uncertainty)
        .report(result, std::vector<ViewValue>{{0.9, 0.9, false, 0.1}});
  };
  const UncertaintyReport none = at_spacing(0.0);
  const UncertaintyReport fine = at_spacing(1.0);
  const UncertaintyReport coarse = at_spacing(2.0);
  ASSERT_TRUE(std::isfinite(none.covariance_deg_mm[0]));
  EXPECT_GT(fine.tre_95_mm, none.tre_95_mm);
  EXPECT_GT(coarse.tre_95_mm, fine.tre_95_mm);
  EXPECT_EQ(coarse.confidence, none.confidence);
  EXPECT_EQ(coarse.inflation, none.inflation);
  const PoseMatrix stated = from_deg_mm(none.covariance_deg_mm);
  const PoseMatrix by_fine = from_deg_mm(fine.covariance_deg_mm) - stated;
  EXPECT_TRUE((from_deg_mm(coarse.covariance_deg_mm) - stated).isApprox(4.0 * by_fine, 1e-6));
  // A calibration error that shifts images as much does the same. Pixels are 3 mm, at 650 of 1000
  // mm.
  const double as_much_px = interpolation_shift_mm(1.0) / (3.0 * 0.65);
  EXPECT_TRUE((from_deg_mm(at_spacing(0.0, as_much_px).covariance_deg_mm) - stated)
                  .isApprox(by_fine, 1e-6));
}

TEST(UncertaintyEstimator, SaysNothingWhereNoViewCanBeJudged) {
  const test::SmallCase small = test::small_case();
  RegistrationResult result;
  result.room_from_ct = small.gold_room_from_ct;
  result.similarity = 1.0;
  result.chain = "squares";
  const std::vector<ViewValue> unjudged{{std::nan(""), std::nan("")}};
  const UncertaintyReport report =
      UncertaintyEstimator(small.problem, squares(), {}).report(result, unjudged);
  EXPECT_TRUE(std::isnan(report.covariance_deg_mm[0]));
  EXPECT_TRUE(std::isnan(report.inflation));
  EXPECT_TRUE(std::isnan(report.tre_inflation));
  EXPECT_TRUE(std::isnan(report.tre_rms_mm));
  EXPECT_TRUE(std::isnan(report.tre_95_mm));
}

/// The report on the gold pose by gradient correlation. A `silhouette_mm` of 0 takes the whole
/// region.
UncertaintyReport report_at_gold(const test::SmallCase& small,
                                 double silhouette_mm,
                                 int pixel_step = 1) {
  RegistrationOptions options = squares();
  StageOptions& stage = options.chains.front().stages.front();
  stage.similarity.name = "gc";
  stage.silhouette_mm = silhouette_mm;
  stage.pixel_step = pixel_step;
  RegistrationResult result;
  result.room_from_ct = small.gold_room_from_ct;
  result.similarity = 1.0;
  result.chain = "squares";
  const bool in_silhouette = silhouette_mm > 0.0;
  return UncertaintyEstimator(small.problem, options, {})
      .report(result, std::vector<ViewValue>{{0.8, 0.8, in_silhouette, 0.1}});
}

/// Adds stripes, which no DRR has, where nothing of the image is nearer than `far_px`.
void add_stripes_beside(Image2d& image, int far_px) {
  const Image2d bones = image;
  for (int row = 0; row < bones.height; ++row)
    for (int column = 0; column < bones.width; ++column) {
      bool is_far = true;
      for (int y = std::max(0, row - far_px); y < std::min(bones.height, row + far_px + 1); ++y)
        for (int x = std::max(0, column - far_px); x < std::min(bones.width, column + far_px + 1);
             ++x)
          is_far = is_far && bones.at(x, y) == 0.0f;
      if (is_far) image.at(column, row) += static_cast<float>(column % 3);
    }
}

TEST(UncertaintyEstimator, LooksWithinSilhouettesWhereTheStageDoes) {
  // The margin is 2.6 pixels, gradients reach one farther.
  constexpr double kMarginMm = 5.0;
  constexpr int kFarPx = 5;
  const test::SmallCase small = test::small_case(test::bones_in_a_corner());
  const test::SmallCase striped = test::small_case(test::bones_in_a_corner());
  std::mt19937_64 random(17);
  std::normal_distribution<float> noise(0.0f, 0.02f);
  for (std::size_t i = 0; i < small.problem->views.size(); ++i) {
    Image2d& plain = small.problem->views[i].xray;
    Image2d& with_stripes = striped.problem->views[i].xray;
    add_stripes_beside(with_stripes, kFarPx);
    EXPECT_NE(with_stripes.pixels, plain.pixels);
    for (std::size_t pixel = 0; pixel < plain.pixels.size(); ++pixel) {
      const float value = noise(random);
      plain.pixels[pixel] += value;
      with_stripes.pixels[pixel] += value;
    }
  }
  const UncertaintyReport within = report_at_gold(small, kMarginMm);
  ASSERT_GT(within.covariance_deg_mm[0], 0.0);
  EXPECT_TRUE(std::isfinite(within.confidence));
  EXPECT_EQ(report_at_gold(striped, kMarginMm).covariance_deg_mm, within.covariance_deg_mm);
  const UncertaintyReport over_region = report_at_gold(small, 0.0);
  const UncertaintyReport over_stripes = report_at_gold(striped, 0.0);
  ASSERT_GT(over_region.covariance_deg_mm[0], 0.0);
  ASSERT_GT(over_stripes.covariance_deg_mm[0], 0.0);
  EXPECT_NE(over_stripes.covariance_deg_mm, over_region.covariance_deg_mm);
}

TEST(UncertaintyEstimator, SaysNothingWhereTooLittleOfTheSilhouetteIsSeen) {
  const test::SmallCase small = test::small_case(test::bones_in_a_corner());
  // 6 x 6 pixels a view are enough for a region, not for a silhouette.
  EXPECT_TRUE(std::isfinite(report_at_gold(small, 0.0, 6).covariance_deg_mm[0]));
  EXPECT_TRUE(std::isnan(report_at_gold(small, 5.0, 6).covariance_deg_mm[0]));
}

TEST(UncertaintyEstimator, SaysNothingByValuesOfAnotherKindThanItsStage) {
  const test::SmallCase small = test::small_case(test::bones_in_a_corner());
  RegistrationOptions options = squares();
  RegistrationResult result;
  result.room_from_ct = small.gold_room_from_ct;
  result.similarity = 1.0;
  result.chain = "squares";
  UncertaintyEstimator estimator(small.problem, options, {});
  const std::vector<ViewValue> of_region{{0.8, 0.8, false, 0.1}};
  const std::vector<ViewValue> in_silhouettes{{0.8, 0.8, true, 0.1}};
  EXPECT_TRUE(std::isfinite(estimator.report(result, of_region).covariance_deg_mm[0]));
  EXPECT_TRUE(std::isnan(estimator.report(result, in_silhouettes).covariance_deg_mm[0]));
}

TEST(UncertaintyEstimator, IsSilentWhereTheMeasureThatStandsInRefusesTheXray) {
  const test::SmallCase small = test::small_case();
  for (RegistrationView& view : small.problem->views)
    std::fill(view.xray.pixels.begin(), view.xray.pixels.end(), 1.0f);
  RegistrationOptions options = preset_options("paper");
  options.use_similarity("pi");
  RegistrationResult result;
  result.room_from_ct = small.gold_room_from_ct;
  result.similarity = 1.0;
  result.chain = options.chains.front().name;
  const UncertaintyReport report = UncertaintyEstimator(small.problem, options, {})
                                       .report(result, std::vector<ViewValue>{{0.9, 0.9}});
  EXPECT_TRUE(std::isnan(report.covariance_deg_mm[0]));
}

}  // namespace
}  // namespace af::registration
