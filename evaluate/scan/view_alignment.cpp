// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/view_alignment.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "base/error.h"

namespace af {

namespace {

constexpr double kScalePerMedian = 1.4826;
constexpr double kCutoff = 3.0;  ///< robust standard deviations; beyond, a residual hardly counts

/// Central differences: by column, by row.
Eigen::Vector2d gradient(const Image2d& image, int column, int row) {
  const auto value = [&](int c, int r) {
    return static_cast<double>(
        image.at(std::clamp(c, 0, image.width - 1), std::clamp(r, 0, image.height - 1)));
  };
  return {0.5 * (value(column + 1, row) - value(column - 1, row)),
          0.5 * (value(column, row + 1) - value(column, row - 1))};
}

/// A pixel's residual: measured - gain * predicted, with its weight.
struct Residuals {
  double gain = 1.0;
  double scale = 1.0;
  std::vector<double> value;   ///< per counted pixel
  std::vector<double> weight;  ///< Geman and McClure's
};

double fitted_gain(const std::vector<std::size_t>& pixels,
                   const Image2d& measured,
                   const Image2d& predicted,
                   const std::vector<double>& weight) {
  double product = 0.0;
  double square = 1e-30;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const auto p = static_cast<double>(predicted.pixels[pixels[i]]);
    product += weight[i] * p * static_cast<double>(measured.pixels[pixels[i]]);
    square += weight[i] * p * p;
  }
  return product / square;
}

double robust_scale(const std::vector<double>& values) {
  std::vector<double> magnitudes(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) magnitudes[i] = std::abs(values[i]);
  const auto middle = magnitudes.begin() + static_cast<std::ptrdiff_t>(magnitudes.size() / 2);
  std::nth_element(magnitudes.begin(), middle, magnitudes.end());
  return std::max(1e-12, kScalePerMedian * *middle);
}

Residuals robust_residuals(const std::vector<std::size_t>& pixels,
                           const Image2d& measured,
                           const Image2d& predicted) {
  Residuals residuals;
  residuals.value.resize(pixels.size());
  residuals.weight.assign(pixels.size(), 1.0);
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    residuals.gain = fitted_gain(pixels, measured, predicted, residuals.weight);
    for (std::size_t i = 0; i < pixels.size(); ++i)
      residuals.value[i] = static_cast<double>(measured.pixels[pixels[i]]) -
                           residuals.gain * static_cast<double>(predicted.pixels[pixels[i]]);
    residuals.scale = robust_scale(residuals.value);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const double beyond = residuals.value[i] / (kCutoff * residuals.scale);
      residuals.weight[i] = 1.0 / ((1.0 + beyond * beyond) * (1.0 + beyond * beyond));
    }
  }
  return residuals;
}

/// Mean squares over the 9 x 9 pixels around each pixel.
std::vector<double> squares_around(const Image2d& image) {
  constexpr int kRadius = 4;
  const auto width = static_cast<std::size_t>(image.width);
  const auto height = static_cast<std::size_t>(image.height);
  // sums[row][column] covers all pixels above and to the left.
  std::vector<double> sums((width + 1) * (height + 1), 0.0);
  const auto sum = [&](std::size_t column, std::size_t row) -> double& {
    return sums[row * (width + 1) + column];
  };
  for (std::size_t row = 0; row < height; ++row)
    for (std::size_t column = 0; column < width; ++column) {
      const auto value = static_cast<double>(image.pixels[row * width + column]);
      sum(column + 1, row + 1) =
          value * value + sum(column, row + 1) + sum(column + 1, row) - sum(column, row);
    }
  std::vector<double> means(image.pixels.size());
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column) {
      const auto left = static_cast<std::size_t>(std::max(0, column - kRadius));
      const auto right = static_cast<std::size_t>(std::min(image.width, column + kRadius + 1));
      const auto above = static_cast<std::size_t>(std::max(0, row - kRadius));
      const auto below = static_cast<std::size_t>(std::min(image.height, row + kRadius + 1));
      const double inside =
          sum(right, below) - sum(left, below) - sum(right, above) + sum(left, above);
      means[static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column)] =
          std::max(0.0, inside) / static_cast<double>((right - left) * (below - above));
    }
  return means;
}

/// ViewAlignment::residual. Edges of what stands still are predicted to a tenth of the detail
/// around them. What moved leaves all of its detail where it is, or where it was.
std::vector<float> residual_over_expected(const std::vector<std::size_t>& pixels,
                                          const Image2d& predicted,
                                          const Residuals& residuals) {
  constexpr double kDetailShare = 0.1;
  const std::vector<double> detail = squares_around(predicted);
  std::vector<float> over(predicted.pixels.size(), 0.0F);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const double share = kDetailShare * residuals.gain;
    const double expected =
        std::sqrt(residuals.scale * residuals.scale + share * share * detail[pixels[i]]);
    over[pixels[i]] = static_cast<float>(residuals.value[i] / expected);
  }
  return over;
}

/// Mean of the robust residuals, relative to those of a prediction of nothing.
double relative_cost(const std::vector<std::size_t>& pixels,
                     const Image2d& measured,
                     const Residuals& residuals) {
  double rest = 0.0;
  double all = 1e-30;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const auto m = static_cast<double>(measured.pixels[pixels[i]]);
    rest += residuals.weight[i] * residuals.value[i] * residuals.value[i];
    all += residuals.weight[i] * m * m;
  }
  return rest / all;
}

}  // namespace

ViewAlignment align_view(const Image2d& measured,
                         const Image2d& predicted,
                         const std::vector<unsigned char>& is_counted,
                         const Eigen::Vector2d& beam_foot_px,
                         const Eigen::Vector2d& pixel_spacing_mm) {
  std::vector<std::size_t> pixels;
  for (std::size_t i = 0; i < is_counted.size(); ++i)
    if (is_counted[i] != 0) pixels.push_back(i);
  if (pixels.empty()) throw InputError("no pixel of a view counts: the scan shows no object");
  const Residuals residuals = robust_residuals(pixels, measured, predicted);

  // The parameters come first, then the gain.
  Eigen::Matrix4d normal = 1e-30 * Eigen::Matrix4d::Identity();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  Eigen::Vector2d slopes_product = Eigen::Vector2d::Zero();
  Eigen::Vector2d slopes_square = Eigen::Vector2d::Constant(1e-30);
  const double spacing_ratio = pixel_spacing_mm.y() / pixel_spacing_mm.x();
  const double inverse_variance = 1.0 / (residuals.scale * residuals.scale);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const int column = static_cast<int>(pixels[i] % static_cast<std::size_t>(predicted.width));
    const int row = static_cast<int>(pixels[i] / static_cast<std::size_t>(predicted.width));
    const Eigen::Vector2d slope = residuals.gain * gradient(predicted, column, row);
    const Eigen::Vector2d measured_slope = gradient(measured, column, row);
    // A point's image moves by (row, -column) from the foot per rad, in mm.
    const double right_of_foot = column - beam_foot_px.x();
    const double below_foot = row - beam_foot_px.y();
    const double turning =
        slope.y() * right_of_foot / spacing_ratio - slope.x() * below_foot * spacing_ratio;
    const Eigen::Vector4d jacobian(
        -slope.x(), -slope.y(), turning, static_cast<double>(predicted.pixels[pixels[i]]));
    const double weight = residuals.weight[i] * inverse_variance;
    normal += weight * jacobian * jacobian.transpose();
    right += weight * residuals.value[i] * jacobian;
    slopes_product += weight * slope.cwiseProduct(measured_slope);
    slopes_square += weight * slope.cwiseProduct(slope);
  }
  ViewAlignment alignment;
  const double gain_square = normal(3, 3);
  const ViewVector with_gain = normal.block<kViewParameters, 1>(0, 3);
  alignment.normal = normal.topLeftCorner<kViewParameters, kViewParameters>() -
                     with_gain * with_gain.transpose() / gain_square;
  alignment.right = right.head<kViewParameters>() - with_gain * right[3] / gain_square;
  const Eigen::Matrix2d shift_normal = alignment.normal.topLeftCorner<2, 2>();
  alignment.shift_px = shift_normal.ldlt().solve(Eigen::Vector2d(alignment.right.head<2>()));
  alignment.rotation_rad = alignment.normal.ldlt().solve(alignment.right)[2];
  alignment.response = slopes_product.cwiseQuotient(slopes_square);
  alignment.cost = relative_cost(pixels, measured, residuals);
  alignment.gain = residuals.gain;
  alignment.residual = residual_over_expected(pixels, predicted, residuals);
  return alignment;
}

}  // namespace af
