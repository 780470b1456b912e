// SPDX-License-Identifier: Apache-2.0
// Covariances of poses, against linear problems whose estimates can be drawn again and again.
#include "register/verdict/pose_covariance.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "geometry/tre.h"
#include "register/verdict/calibration.h"
#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, 6>;

PoseVector drawn(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  PoseVector vector;
  for (int k = 0; k < 6; ++k) vector[k] = normal(random);
  return vector;
}

/// Least squares y = A p + e, whose errors are equal within blocks of rows, as within one tile.
struct BlockProblem {
  static constexpr int kBlocks = 60;
  static constexpr int kRowsPerBlock = 5;
  Rows design{kBlocks * kRowsPerBlock, 6};
  std::vector<double> sigma;  ///< of every block

  explicit BlockProblem(std::mt19937_64& random) {
    for (int row = 0; row < design.rows(); ++row) design.row(row) = drawn(random).transpose();
    for (int block = 0; block < kBlocks; ++block) sigma.push_back(0.01 + 0.001 * block);
  }
  [[nodiscard]] Eigen::VectorXd errors(std::mt19937_64& random) const {
    std::normal_distribution<double> normal;
    Eigen::VectorXd result(design.rows());
    for (int block = 0; block < kBlocks; ++block)
      result.segment(block * kRowsPerBlock, kRowsPerBlock)
          .setConstant(sigma[static_cast<std::size_t>(block)] * normal(random));
    return result;
  }
  /// What -|y - A p|^2 / 2 says about p where the estimate leaves `residuals`.
  [[nodiscard]] PoseInformation information(const Eigen::VectorXd& residuals) const {
    PoseInformation information;
    information.curvature = design.transpose() * design;
    for (int block = 0; block < kBlocks; ++block) {
      const int first = block * kRowsPerBlock;
      const PoseVector score = design.middleRows(first, kRowsPerBlock).transpose() *
                               residuals.segment(first, kRowsPerBlock);
      information.scatter += score * score.transpose();
    }
    return information;
  }
};

TEST(PredictedTre, OfACovarianceThatIsNotKnownIsNotKnown) {
  const std::vector<Eigen::Vector3d> points{{1, 2, 3}};
  const PredictedTre tre = predicted_tre(PoseMatrix::Constant(std::nan("")), PoseFrame(), points);
  EXPECT_TRUE(std::isnan(tre.rms_mm));
  EXPECT_TRUE(std::isnan(tre.upper_95_mm));
}

TEST(PoseCovariance, PredictsTheSpreadOfRepeatedFits) {
  std::mt19937_64 random(3);
  const BlockProblem problem(random);
  constexpr int kRepeats = 4000;
  PoseMatrix spread = PoseMatrix::Zero();
  PoseMatrix predicted = PoseMatrix::Zero();
  int inside = 0;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    const Eigen::VectorXd errors = problem.errors(random);
    const PoseVector estimate = problem.design.colPivHouseholderQr().solve(errors);
    const auto covariance =
        sandwich_covariance(problem.information(errors - problem.design * estimate));
    ASSERT_TRUE(covariance.has_value());
    spread += estimate * estimate.transpose() / kRepeats;
    predicted += *covariance / kRepeats;
    if (squared_distance(*covariance, estimate) <= kPoseRegion95) ++inside;
  }
  // 4000 draws know a variance to 2 %; the sandwich of 60 blocks is some 10 % too small
  // (MacKinnon and White 1985).
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(predicted(k, k) / spread(k, k), 0.9, 0.1) << k;
  const double coverage = static_cast<double>(inside) / kRepeats;
  EXPECT_GT(coverage, 0.85);
  EXPECT_LT(coverage, 0.97);
}

TEST(PoseCovariance, IsTheInverseCurvatureWhereErrorsAreIndependentAndOfOneSize) {
  PoseInformation information;
  information.curvature = PoseVector(1, 2, 3, 4, 5, 6).asDiagonal();
  information.scatter = 0.25 * information.curvature;
  const auto covariance = sandwich_covariance(information);
  ASSERT_TRUE(covariance.has_value());
  EXPECT_TRUE(covariance->isApprox(0.25 * information.curvature.inverse(), 1e-12));
  information.curvature(5, 5) = -1.0;
  EXPECT_FALSE(sandwich_covariance(information).has_value());
}

TEST(PoseCovariance, OfAShiftedViewIsTheTranslationThatMendsIt) {
  // One view, all of the curvature: the shift moves the CT along the detector.
  PoseInformation information;
  information.curvature = PoseMatrix::Identity();
  information.view_curvatures = {PoseMatrix::Identity()};
  const View view = View::whole_detector(test::small_camera(false));
  const Eigen::Vector2d shift_mm(0.5, 0.8);
  const PoseMatrix covariance =
      shift_covariance(information, std::vector{view}, std::vector{shift_mm});
  PoseMatrix expected = PoseMatrix::Zero();
  expected(3, 3) = 0.25;  // columns along x
  expected(5, 5) = 0.64;  // rows along -z
  EXPECT_TRUE(covariance.isApprox(expected, 1e-12)) << covariance;
  // Two equal views that both know everything share the error.
  information.view_curvatures = {0.5 * PoseMatrix::Identity(), 0.5 * PoseMatrix::Identity()};
  const PoseMatrix shared =
      shift_covariance(information, std::vector{view, view}, std::vector{shift_mm, shift_mm});
  EXPECT_TRUE(shared.isApprox(0.5 * expected, 1e-12)) << shared;
}

TEST(PoseCovariance, IsKeptInDegreesAndMillimetres) {
  std::mt19937_64 random(5);
  PoseMatrix covariance = PoseMatrix::Zero();
  for (int i = 0; i < 10; ++i) {
    const PoseVector vector = drawn(random);
    covariance += vector * vector.transpose();
  }
  const auto stored = in_deg_mm(covariance);
  EXPECT_NEAR(stored[0], covariance(0, 0) * kDegPerRad * kDegPerRad, 1e-9 * stored[0]);
  EXPECT_DOUBLE_EQ(stored[20], covariance(5, 5));
  EXPECT_TRUE(from_deg_mm(stored).isApprox(covariance, 1e-12));
}

TEST(PredictedTre, IsThatOfDrawnPoses) {
  std::mt19937_64 random(7);
  PoseVector sizes;
  sizes << 0.004, 0.001, 0.002, 0.05, 0.4, 0.1;  // one direction much larger, as depth is
  const PoseMatrix covariance = sizes.cwiseAbs2().asDiagonal();
  const PoseFrame frame = PoseFrame::about(RigidTransform::Identity(), {5, 0, 0});
  std::vector<Eigen::Vector3d> points;
  for (const double x : {-30.0, 0.0, 30.0})
    for (const double y : {-20.0, 20.0})
      for (const double z : {-25.0, 25.0}) points.emplace_back(x, y, z);
  const PredictedTre predicted = predicted_tre(covariance, frame, points);
  constexpr int kDraws = 4000;
  double mean_square = 0.0;
  int below = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const PoseVector error = drawn(random).cwiseProduct(sizes);
    const RigidTransform pose =
        pose_from_parameters(frame, {Eigen::Vector3d(error.head<3>()), error.tail<3>()});
    double square = 0.0;
    for (const Eigen::Vector3d& point : points) square += (pose * point - point).squaredNorm();
    square /= static_cast<double>(points.size());
    mean_square += square / kDraws;
    if (std::sqrt(square) <= predicted.upper_95_mm) ++below;
  }
  EXPECT_NEAR(predicted.rms_mm, std::sqrt(mean_square), 0.02 * predicted.rms_mm);
  EXPECT_NEAR(static_cast<double>(below) / kDraws, 0.95, 0.01);
}

TEST(DepthAlongTheBeam, IsThatOfDrawnPoses) {
  std::mt19937_64 random(11);
  PoseVector sizes;
  sizes << 0.004, 0.001, 0.002, 0.05, 0.4, 3.0;
  const PoseMatrix covariance = sizes.cwiseAbs2().asDiagonal();
  const PoseFrame frame = PoseFrame::about(RigidTransform::Identity(), {5, 0, 0});
  const Eigen::Vector3d point(30, -20, 10);
  const Eigen::Vector3d source(0, 200, -600);
  const double predicted_mm = depth_95_mm(covariance, frame, point, source);
  constexpr int kDraws = 4000;
  int within = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const PoseVector error = drawn(random).cwiseProduct(sizes);
    const RigidTransform pose =
        pose_from_parameters(frame, {Eigen::Vector3d(error.head<3>()), error.tail<3>()});
    if (std::abs((pose * point - point).dot((point - source).normalized())) <= predicted_mm)
      ++within;
  }
  EXPECT_NEAR(static_cast<double>(within) / kDraws, 0.95, 0.01);
  // Across the beam nothing counts.
  PoseMatrix across = PoseMatrix::Zero();
  across(3, 3) = 100.0;
  EXPECT_EQ(depth_95_mm(across, PoseFrame(), {0, 0, 7}, {0, 0, -600}), 0.0);
  EXPECT_TRUE(std::isnan(
      depth_95_mm(PoseMatrix::Constant(std::nan("")), PoseFrame(), {1, 2, 3}, {0, 0, -600})));
}

TEST(Calibration, WidensWhatThePoseDoesNotExplain) {
  for (const char* similarity : {"rg", "gc", "mi"}) {
    CovarianceInflation last = {0.0, 0.0};
    for (const double share : {0.9, 0.5, 0.3}) {
      const CovarianceInflation inflation =
          covariance_inflation(similarity, std::vector<ViewValue>{{0.8, share}, {0.8, share}});
      EXPECT_GT(inflation.pose, last.pose) << similarity << ' ' << share;
      EXPECT_GE(inflation.tre, last.tre) << similarity << ' ' << share;
      EXPECT_GE(inflation.pose, 1.0);
      EXPECT_GE(inflation.pose, inflation.tre);
      last = inflation;
    }
  }
  const std::vector<ViewValue> bone{{0.8, 0.9, true}, {0.8, 0.9, true}};
  const std::vector<ViewValue> hidden_bone{{0.4, 0.3, true}, {0.4, 0.3, true}};
  EXPECT_GT(covariance_inflation("gc", bone).pose, 1.0);
  EXPECT_GT(covariance_inflation("gc", hidden_bone).pose, covariance_inflation("gc", bone).pose);
  // Within silhouettes the constants were fitted to one measure only.
  EXPECT_EQ(covariance_inflation("rg", bone).pose, covariance_inflation("ssd", bone).pose);
  EXPECT_TRUE(std::isnan(covariance_inflation("rg", {}).pose));
  EXPECT_TRUE(std::isnan(covariance_inflation("rg", {}).tre));
}

TEST(Calibration, CoarserSamplesShiftImagesMore) {
  EXPECT_EQ(interpolation_shift_mm(0.0), 0.0);
  EXPECT_GT(interpolation_shift_mm(1.0), 0.0);
  EXPECT_DOUBLE_EQ(interpolation_shift_mm(3.0), 3.0 * interpolation_shift_mm(1.0));
  // No DRR is a pixel off, or nobody would register by it.
  EXPECT_LT(interpolation_shift_mm(1.0), 0.1);
}

// One view has constants of its own. Its covariance is not comparable to that of two views.
TEST(Calibration, WidensOneViewByItsOwnConstants) {
  for (const char* similarity : {"rg", "gc", "mi"}) {
    double last = 0.0;
    for (const double share : {0.9, 0.5, 0.3}) {
      const double one =
          covariance_inflation(similarity, std::vector<ViewValue>{{0.8, share}}).pose;
      const ViewValue view = {0.8, share};
      const double two = covariance_inflation(similarity, std::vector<ViewValue>{view, view}).pose;
      EXPECT_GT(one, last) << similarity << ' ' << share;
      EXPECT_NE(one, two) << similarity << ' ' << share;
      EXPECT_GE(one, 1.0);
      last = one;
    }
  }
}

// At a right place one view explains what poses beside it do not. At a wrong one they explain half
// of it.
TEST(Calibration, ConfidenceOfOneViewLooksAtWhatPosesBesideExplain) {
  const auto confidence = [](double fine, double background) {
    return success_confidence({std::vector<ViewValue>{{0.8, fine, false, background}}, 30.0});
  };
  // The real skull under all stresses, pose 1: right and wrong ends (docs/robust-tuning.md).
  EXPECT_GT(confidence(0.095, 0.008), 0.8);
  EXPECT_LT(confidence(0.153, 0.061), confidence(0.095, 0.008));
  EXPECT_GT(confidence(0.5, 0.0), 0.99);
  EXPECT_LT(confidence(0.3, 0.29), 0.1);
  EXPECT_LT(confidence(0.3, 0.35), 0.1) << "poses beside it explain more";
  EXPECT_TRUE(std::isnan(confidence(0.3, std::nan(""))));
  // With one view the confidence does not ask about depth.
  const std::vector<ViewValue> values = {{0.8, 0.3, false, 0.1}};
  EXPECT_EQ(success_confidence({values, 0.1}), success_confidence({values, std::nan("")}));
}

TEST(Calibration, ConfidenceWithinSilhouettesFallsWithEveryDoubt) {
  const auto confidence = [](double fine_a, double fine_b, double tre_mm) {
    const std::vector<ViewValue> values = {{0.8, fine_a, true, 0.05}, {0.8, fine_b, true, 0.05}};
    return success_confidence({values, tre_mm});
  };
  // Values of drawn bones and of a real wrist (docs/howto/bones.md).
  EXPECT_GT(confidence(0.80, 0.75, 0.2), 0.99);
  EXPECT_GT(confidence(0.42, 0.44, 0.1), 0.9);
  EXPECT_LT(confidence(0.80, 0.75, 2.0), 0.5);
  EXPECT_LT(confidence(0.60, 0.55, 0.2), confidence(0.80, 0.75, 0.2));
  // One view shows nothing of the bone.
  for (const double tre_mm : {1e-6, 0.1, 1.0}) EXPECT_LT(confidence(0.80, 0.05, tre_mm), 0.05);
  EXPECT_TRUE(std::isnan(confidence(std::nan(""), std::nan(""), 0.1)));
}

TEST(Calibration, ConfidenceFallsWithEveryDoubt) {
  const auto confidence = [](double fine, double background, double tre_mm) {
    const ViewValue value = {0.8, fine, false, background};
    return success_confidence({std::vector<ViewValue>{value, value}, tre_mm});
  };
  const double none = std::nan("");
  const double best = confidence(0.5, 0.3, 0.2);
  EXPECT_GT(best, 0.9);
  EXPECT_LE(best, 1.0);
  EXPECT_LT(confidence(0.4, 0.3, 0.2), best);
  EXPECT_LT(confidence(0.5, 0.4, 0.2), best);
  EXPECT_LT(confidence(0.5, 0.3, 8.0), best);
  EXPECT_LT(confidence(0.5, 0.3, none), best);
  EXPECT_EQ(confidence(0.5, 0.3, none), confidence(0.5, 0.3, 1e6));
  EXPECT_GT(confidence(0.5, 0.3, 0.1), best);
  EXPECT_EQ(confidence(0.5, 0.3, 0.0), confidence(0.5, 0.3, 0.1));
  EXPECT_TRUE(std::isnan(confidence(0.5, none, 0.1)));
  EXPECT_TRUE(std::isnan(success_confidence({{}, 0.1})));
}

// A wrong vertebra: one view fits, the other shows hardly more than chance would. No predicted TRE
// makes up for it.
TEST(Calibration, AViewThatShowsNothingLeavesLittleConfidence) {
  const auto confidence = [](double fine_a, double fine_b, double tre_mm) {
    const std::vector<ViewValue> values = {{0.5, fine_a, false, 0.06}, {0.5, fine_b, false, 0.02}};
    return success_confidence({values, tre_mm});
  };
  for (const double tre_mm : {1e-6, 0.05, 0.1, 0.3, 1.0}) {
    EXPECT_LT(confidence(0.60, 0.02, tre_mm), 0.5);
    EXPECT_LT(confidence(0.60, 0.04, tre_mm), 0.9);
    EXPECT_LT(confidence(0.06, 0.58, tre_mm), 0.5);
    EXPECT_GT(confidence(0.32, 0.30, tre_mm), 0.99);  // of the same mean
  }
  EXPECT_LT(confidence(0.60, 0.04, 1.0), 0.5);
}

}  // namespace
}  // namespace af::registration
