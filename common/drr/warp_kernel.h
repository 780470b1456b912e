// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// Node coordinates of detector pixels: s(c, r) = S / D and t = T / D. Each of S, T and D is
/// affine: [0] + c [1] + r [2].
struct Homography {
  double s[3];
  double t[3];
  double d[3];
};

/// Image of (s,t) nodes: s fastest, at least 2 x 2. Readable for four rows and 32 values beyond its
/// end.
struct NodeImage {
  const float* values;
  int32_t stride;  ///< from row to row
  int32_t s_count;
  int32_t t_count;
};

/// Where resampled pixels go: a band of rows of a row-major image.
struct PixelGrid {
  int32_t columns;
  int32_t row_begin;
  int32_t row_end;
};

/// Resamples a node image bilinearly. Coordinates are clamped to the image.
using WarpImage = void (*)(const NodeImage& image,
                           const Homography& homography,
                           const PixelGrid& grid,
                           float* values);

/// Turns slopes of node images into derivatives by motions of the CT. In the slab frame a ray
/// through `source` meets the node plane at source + reach (m_x, 1, m_z). The ray's motion changes
/// a pixel as forces do work along a motion. The forces are F = (I_x, ., I_z) at the node plane
/// (the image's slopes per mm) and G at the source (the blended viewpoints' slopes), both
/// perpendicular to the ray.
struct PoseSlopes {
  const float* source_x;  ///< G_x, per mm, a node image like the value's
  const float* source_z;  ///< G_z
  float nodes_per_mm[2];  ///< along s, t
  float m_scale[2];       ///< m_x = m_scale[0] s + m_offset[0], and m_z likewise from t
  float m_offset[2];
  float source_move[3];  ///< mm that the source has moved since the images were made
  /// One row per room axis: the coefficients that F + G, (m_x, 1, m_z) x F and again F + G have in
  /// the derivatives.
  float translation_of_force[3][3];
  float rotation_of_moment[3][3];
  float rotation_of_force[3][3];
};

/// The same for images that were made for another source. PoseSlopes::source_move corrects the
/// values along the slopes.
using WarpMovedImage = void (*)(const NodeImage& image,
                                const PoseSlopes& slopes,
                                const Homography& homography,
                                const PixelGrid& grid,
                                float* values);

/// The same, corrected likewise, with six planes of rows x columns derivatives, `plane_stride`
/// values apart, in the order of PoseGradients.
using WarpWithPoseSlopes = void (*)(const NodeImage& image,
                                    const PoseSlopes& slopes,
                                    const Homography& homography,
                                    const PixelGrid& grid,
                                    float* values,
                                    float* planes,
                                    int64_t plane_stride);

/// Resamples two node images, which are the slopes per node along s and t, to slopes per pixel
/// along columns and rows.
using WarpSlopes = void (*)(const NodeImage& s_slopes,
                            const float* t_slopes,
                            const Homography& homography,
                            const PixelGrid& grid,
                            float* column_slopes,
                            float* row_slopes);

#define AF_DECLARE_KERNELS(space)                          \
  namespace space {                                        \
  void warp_image(const NodeImage& image,                  \
                  const Homography& homography,            \
                  const PixelGrid& grid,                   \
                  float* values);                          \
  void warp_moved_image(const NodeImage& image,            \
                        const PoseSlopes& slopes,          \
                        const Homography& homography,      \
                        const PixelGrid& grid,             \
                        float* values);                    \
  void warp_with_pose_slopes(const NodeImage& image,       \
                             const PoseSlopes& slopes,     \
                             const Homography& homography, \
                             const PixelGrid& grid,        \
                             float* values,                \
                             float* planes,                \
                             int64_t plane_stride);        \
  void warp_slopes(const NodeImage& s_slopes,              \
                   const float* t_slopes,                  \
                   const Homography& homography,           \
                   const PixelGrid& grid,                  \
                   float* column_slopes,                   \
                   float* row_slopes);                     \
  }
AF_DECLARE_KERNELS(kernels_128)
AF_DECLARE_KERNELS(kernels_256)
AF_DECLARE_KERNELS(kernels_512)
#undef AF_DECLARE_KERNELS

}  // namespace af
