// SPDX-License-Identifier: Apache-2.0
#include "drr/two_pass_af_drr.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/vector_width.h"
#include "drr/kept_images.h"
#include "drr/node_image_kernel.h"
#include "drr/node_images.h"
#include "drr/slab_sum.h"
#include "drr/warp_kernel.h"

namespace af {

namespace {

/// Kernels read rows beyond an image, and read and write up to two whole vectors beyond it.
constexpr int kRowsBeyond = 4;
constexpr std::size_t kImagePadding = 64;

std::ptrdiff_t rounded_up(std::ptrdiff_t count, std::ptrdiff_t multiple) {
  return (count + multiple - 1) / multiple * multiple;
}

/// Extra nodes of a slab around those that the rays hit, for its sum with others. A node of the sum
/// lies up to one of its own nodes outside, and needs two more on that side.
constexpr int kSumMargin = 3;

/// A node image's memory, grown when a larger one is needed and never shrunk.
class ImageBuffer {
 public:
  float* reserve(std::ptrdiff_t stride, int rows) {
    const auto size = static_cast<std::size_t>(stride * (rows + kRowsBeyond)) + kImagePadding;
    if (values_.size() < size) values_.resize(size);
    return values_.data();
  }

 private:
  std::vector<float> values_;
};

/// Value, and slopes along the source's x and z.
using ImageBuffers = std::array<ImageBuffer, 3>;

class Workspace final : public RenderWorkspace {
 public:
  BlendScratch scratch;
  ImageBuffers blended;
  SlabSumScratch sum_scratch;
  ImageBuffers summed;
  ImageBuffers fine;
  std::vector<float> row;
  bool reuses = false;
  KeptImages kept;

  void reuse_images(bool is_allowed) override {
    reuses = is_allowed;
    kept.forget();
  }
};

NodeImage image_of(const NodeImages& nodes, std::size_t i) {
  return {nodes.images[i], nodes.grid.stride, nodes.grid.s_count, nodes.grid.t_count};
}

NodeGrid grid_of(const SlabGeometry& slab, const Footprint& footprint, std::ptrdiff_t stride) {
  return {slab.s.position_mm(footprint.s().begin),
          slab.s.spacing_mm(),
          slab.t.position_mm(footprint.t().begin),
          slab.t.spacing_mm(),
          slab.st_plane_y_mm,
          static_cast<std::int32_t>(stride),
          footprint.s().count,
          footprint.t().count};
}

NodeGrid twice_as_fine(const NodeGrid& grid, std::ptrdiff_t stride) {
  NodeGrid fine = grid;
  fine.s_spacing_mm *= 0.5;
  fine.t_spacing_mm *= 0.5;
  fine.s_count = 2 * grid.s_count - 1;
  fine.t_count = 2 * grid.t_count - 1;
  fine.stride = static_cast<std::int32_t>(stride);
  return fine;
}

/// node = (source + reach * d_x / d_y - first) / spacing, multiplied through by d_y. This is affine
/// in the pixel.
Homography nodes_from_pixels(const NodeGrid& grid, const SlabRays& rays) {
  const double reach = grid.plane_y_mm - rays.source.y();
  const double s_offset = rays.source.x() - grid.s_first_mm;
  const double t_offset = rays.source.z() - grid.t_first_mm;
  Homography homography{};
  const std::array<const Eigen::Vector3d*, 3> directions{
      &rays.first, &rays.column_step, &rays.row_step};
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector3d& d = *directions[i];
    homography.s[i] = (s_offset * d.y() + reach * d.x()) / grid.s_spacing_mm;
    homography.t[i] = (t_offset * d.y() + reach * d.z()) / grid.t_spacing_mm;
    homography.d[i] = d.y();
  }
  return homography;
}

/// The values of a slab's images that the gradients of a pose need (PoseSlopes has the mechanics).
/// `source_move`: the source's motion since the images were made.
PoseSlopes pose_slopes(const NodeImages& slab,
                       const SlabRays& rays,
                       const Eigen::Vector3d& source_move,
                       const Eigen::Vector3d& source_from_pivot) {
  const Eigen::Matrix3d slab_from_room = rays.slab_from_room.linear();
  const NodeGrid& grid = slab.grid;
  const double reach = grid.plane_y_mm - rays.source.y();
  PoseSlopes slopes{};
  slopes.source_x = slab.images[1];
  slopes.source_z = slab.images[2];
  slopes.nodes_per_mm[0] = static_cast<float>(1.0 / grid.s_spacing_mm);
  slopes.nodes_per_mm[1] = static_cast<float>(1.0 / grid.t_spacing_mm);
  slopes.m_scale[0] = static_cast<float>(grid.s_spacing_mm / reach);
  slopes.m_scale[1] = static_cast<float>(grid.t_spacing_mm / reach);
  slopes.m_offset[0] = static_cast<float>((grid.s_first_mm - rays.source.x()) / reach);
  slopes.m_offset[1] = static_cast<float>((grid.t_first_mm - rays.source.z()) / reach);
  for (int i = 0; i < 3; ++i) slopes.source_move[i] = static_cast<float>(source_move[i]);
  // When the CT moves by t + omega x (x - p), it meets rays that move the other way.
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d direction = slab_from_room.col(axis);
    const Eigen::Vector3d arm = direction.cross(slab_from_room * source_from_pivot);
    for (int i = 0; i < 3; ++i) {
      slopes.translation_of_force[axis][i] = static_cast<float>(-direction[i]);
      slopes.rotation_of_moment[axis][i] = static_cast<float>(-reach * direction[i]);
      slopes.rotation_of_force[axis][i] = static_cast<float>(-arm[i]);
    }
  }
  return slopes;
}

/// What the second pass needs of the first.
struct BlendNeeds {
  int margin;  ///< nodes around those that the rays hit
  bool slopes;
};

/// First pass of slab k: images of the value and, when wanted, of its slopes along the source.
NodeImages blended_images(const ViewpointBlender& blender,
                          std::size_t k,
                          const SlabRays& rays,
                          const BlendNeeds& needs,
                          Workspace& workspace) {
  const Footprint footprint = blender.footprint(k, rays, needs.margin);
  const std::ptrdiff_t stride = rounded_up(footprint.s().count + 15, 16);
  BlendedImages images;
  images.stride = stride;
  images.value = workspace.blended[0].reserve(stride, footprint.t().count);
  if (needs.slopes) {
    images.source_x = workspace.blended[1].reserve(stride, footprint.t().count);
    images.source_z = workspace.blended[2].reserve(stride, footprint.t().count);
  }
  blender.blend(k, rays, footprint, workspace.scratch, images);
  return {grid_of(blender.slab(k), footprint, stride),
          {images.value, images.source_x, images.source_z}};
}

/// First pass of all slabs: the images of the only one, or the sum of all on the plane of
/// `sum_slab`.
NodeImages summed_images(const ViewpointBlender& blender,
                         const SlabGeometry& sum_slab,
                         const SlabRays& rays,
                         const BlendNeeds& needs,
                         Workspace& workspace) {
  workspace.kept.forget();  // its memory is used again
  if (blender.slab_count() == 1) return blended_images(blender, 0, rays, needs, workspace);
  const Footprint footprint(sum_slab, rays, {needs.margin, false});
  const std::ptrdiff_t stride = rounded_up(footprint.s().count, 16);
  std::array<float*, 3> images{};
  for (std::size_t i = 0; i < (needs.slopes ? 3u : 1u); ++i)
    images[i] = workspace.summed[i].reserve(stride, footprint.t().count);
  SlabSum sum(grid_of(sum_slab, footprint, stride), rays.source, images, workspace.sum_scratch);
  // A node of the sum is up to 1.25 of a slab's nodes wide.
  const BlendNeeds more{needs.margin + needs.margin / 4 + kSumMargin, needs.slopes};
  for (std::size_t k = 0; k < blender.slab_count(); ++k)
    sum.add(blended_images(blender, k, rays, more, workspace));
  return sum.images();
}

/// The same images with a node inserted between any two neighbours.
NodeImages upsampled(const NodeImages& slab, Workspace& workspace) {
  const auto upsample_image = select_kernel<UpsampleImage>(
      kernels_128::upsample_image, kernels_256::upsample_image, kernels_512::upsample_image);
  const NodeGrid& grid = slab.grid;
  const std::ptrdiff_t stride = 2 * rounded_up(grid.s_count, 16);
  NodeImages fine{twice_as_fine(grid, stride), {}};
  workspace.row.resize(
      std::max(workspace.row.size(), static_cast<std::size_t>(grid.s_count) + kImagePadding));
  for (std::size_t i = 0; i < 3; ++i) {
    if (slab.images[i] == nullptr) continue;
    float* to = workspace.fine[i].reserve(stride, fine.grid.t_count);
    upsample_image(slab.images[i],
                   grid.stride,
                   grid.s_count,
                   grid.t_count,
                   workspace.row.data(),
                   to,
                   fine.grid.stride);
    fine.images[i] = to;
  }
  return fine;
}

/// The node images of a DRR, and how far its source is from the one for which they were made.
struct LookedUpNodes {
  NodeImages images;
  Eigen::Vector3d source_move;
};

/// Runs what precedes the warp, or takes the images that an earlier DRR left.
LookedUpNodes looked_up_nodes(const ViewpointBlender& blender,
                              const SlabGeometry& sum_slab,
                              AxisInterpolation st,
                              const SlabRays& rays,
                              bool wants_slopes,
                              Workspace& workspace) {
  if (const auto move = workspace.kept.source_move(blender, rays))
    return {workspace.kept.images(), *move};
  const bool is_cubic = st == AxisInterpolation::Cubic;
  const bool keeps = workspace.reuses && wants_slopes;
  const int margin = (is_cubic ? kUpsampleReach - 1 : 0) + (keeps ? KeptImages::kMargin : 0);
  NodeImages nodes = summed_images(blender, sum_slab, rays, {margin, wants_slopes}, workspace);
  if (is_cubic) nodes = upsampled(nodes, workspace);
  if (keeps) workspace.kept.keep(nodes, is_cubic ? 2 : 1, rays);
  return {nodes, Eigen::Vector3d::Zero()};
}

/// Sobel's slopes of the value image along s and t. They replace the slopes along the source.
NodeImages with_sobel_slopes(const NodeImages& slab, Workspace& workspace) {
  const auto sobel_slopes = select_kernel<SobelSlopes>(
      kernels_128::sobel_slopes, kernels_256::sobel_slopes, kernels_512::sobel_slopes);
  const NodeGrid& grid = slab.grid;
  float* along_s = workspace.blended[1].reserve(grid.stride, grid.t_count);
  float* along_t = workspace.blended[2].reserve(grid.stride, grid.t_count);
  sobel_slopes(slab.images[0], grid.stride, grid.s_count, grid.t_count, along_s, along_t);
  return {grid, {slab.images[0], along_s, along_t}};
}

/// Calls work(PixelGrid) for bands of the view's rows, shared by the threads of a pool. Sharing the
/// first pass does not pay: it takes the same time for any detector.
template <typename Work>
void for_each_band(const View& view, ThreadPool& pool, const Work& work) {
  // Smaller bands gain little or lose, because another processor first has to fetch the node image.
  constexpr int kPixelsPerBand = 65536;
  const int rows = std::max(1, kPixelsPerBand / view.roi.width);
  pool.for_each_block(view.roi.height, rows, [&](int begin, int end) {
    work(PixelGrid{view.roi.width, begin, end});
  });
}

/// Nodes of a finer sum per node of a slab. Two interpolations in turn lose more than one. With
/// equally many nodes, cubic look-up lost up to 1.2 dB in the worst DRRs. With a quarter more it
/// lost nothing, and linear look-up gains 0.5 dB.
constexpr double kMoreNodesPerNode = 1.25;

/// The lattice of a sum of slabs, midway between the outermost planes. A ray's place on a plane is
/// an affine function of the plane's depth, so the edges lie between the slabs' edges too.
SlabGeometry sum_geometry(const ViewpointBlender& blender, const TwoPassOptions& options) {
  const bool has_more = options.sums_on_more_nodes || options.st == AxisInterpolation::Cubic;
  SlabGeometry sum = blender.slab(0);
  const SlabGeometry& last = blender.slab(blender.slab_count() - 1);
  sum.st_plane_y_mm = 0.5 * (sum.st_plane_y_mm + last.st_plane_y_mm);
  for (GridAxis SlabGeometry::*axis : {&SlabGeometry::s, &SlabGeometry::t}) {
    (sum.*axis).first_mm = 0.5 * ((sum.*axis).first_mm + (last.*axis).first_mm);
    (sum.*axis).last_mm = 0.5 * ((sum.*axis).last_mm + (last.*axis).last_mm);
    const int nodes = std::max((sum.*axis).nodes, (last.*axis).nodes);
    const double per_node = has_more ? kMoreNodesPerNode : 1.0;
    (sum.*axis).nodes = 1 + static_cast<int>(std::ceil(per_node * (nodes - 1)));
  }
  sum.y_high_mm = last.y_high_mm;
  return sum;
}

}  // namespace

TwoPassAfDrr::TwoPassAfDrr(std::unique_ptr<const ViewpointBlender> blender,
                           const TwoPassOptions& options,
                           std::shared_ptr<ThreadPool> pool)
    : blender_(std::move(blender)),
      sum_slab_(sum_geometry(*blender_, options)),
      options_(options),
      pool_(pool ? std::move(pool) : std::make_shared<ThreadPool>()) {}

TwoPassAfDrr::TwoPassAfDrr(std::shared_ptr<const CompressedAttenuationField> field,
                           const TwoPassOptions& options,
                           std::shared_ptr<ThreadPool> pool)
    : TwoPassAfDrr(make_viewpoint_blender(std::move(field), options.uv), options, std::move(pool)) {
}

TwoPassAfDrr::TwoPassAfDrr(std::shared_ptr<const FieldLevel> level,
                           const TwoPassOptions& options,
                           std::shared_ptr<ThreadPool> pool)
    : TwoPassAfDrr(make_viewpoint_blender(std::move(level), options.uv), options, std::move(pool)) {
}

std::unique_ptr<RenderWorkspace> TwoPassAfDrr::make_workspace() const {
  return std::make_unique<Workspace>();
}

RenderStatus TwoPassAfDrr::render(const RigidTransform& room_from_ct,
                                  const View& view,
                                  RenderWorkspace& workspace,
                                  std::span<float> total_attenuation,
                                  const std::optional<PoseGradients>& gradients) const {
  const std::size_t pixels = view.pixel_count();
  check(total_attenuation.size() == pixels, "one value per pixel of the view");
  check(!gradients || gradients->planes.size() == 6 * pixels,
        "six gradient planes of the view's size");
  auto& scratch = dynamic_cast<Workspace&>(workspace);
  const SlabRays rays(blender_->field_geometry(), room_from_ct, view);
  const auto blank_outside = [&] {
    return rays.blank_outside(total_attenuation,
                              gradients ? gradients->planes : std::span<float>{});
  };
  if (!rays.all_cross()) return {blank_outside()};
  const auto warp_image = select_kernel<WarpImage>(
      kernels_128::warp_image, kernels_256::warp_image, kernels_512::warp_image);
  const auto warp_moved_image = select_kernel<WarpMovedImage>(
      kernels_128::warp_moved_image, kernels_256::warp_moved_image, kernels_512::warp_moved_image);
  const auto warp_with_pose_slopes =
      select_kernel<WarpWithPoseSlopes>(kernels_128::warp_with_pose_slopes,
                                        kernels_256::warp_with_pose_slopes,
                                        kernels_512::warp_with_pose_slopes);
  const LookedUpNodes nodes =
      looked_up_nodes(*blender_, sum_slab_, options_.st, rays, gradients.has_value(), scratch);
  const NodeImage values = image_of(nodes.images, 0);
  const Homography homography = nodes_from_pixels(nodes.images.grid, rays);
  Eigen::Vector3d source_from_pivot = Eigen::Vector3d::Zero();
  if (gradients) source_from_pivot = view.camera.source_point - gradients->pivot_room_point;
  const PoseSlopes slopes = pose_slopes(nodes.images, rays, nodes.source_move, source_from_pivot);
  const bool has_moved = !nodes.source_move.isZero(0.0);
  for_each_band(view, *pool_, [&](const PixelGrid& band) {
    float* const to = total_attenuation.data();
    if (gradients)
      warp_with_pose_slopes(values,
                            slopes,
                            homography,
                            band,
                            to,
                            gradients->planes.data(),
                            static_cast<std::int64_t>(pixels));
    else if (has_moved)
      warp_moved_image(values, slopes, homography, band, to);
    else
      warp_image(values, homography, band, to);
  });
  if (rays.all_inside()) return {};
  return {blank_outside()};
}

std::int64_t TwoPassAfDrr::rays_outside(const RigidTransform& room_from_ct,
                                        const View& view) const {
  return SlabRays(blender_->field_geometry(), room_from_ct, view).count_outside();
}

RenderStatus TwoPassAfDrr::render_gradient_images(const RigidTransform& room_from_ct,
                                                  const View& view,
                                                  RenderWorkspace& workspace,
                                                  std::span<float> column_gradient,
                                                  std::span<float> row_gradient) const {
  check(column_gradient.size() == view.pixel_count() && row_gradient.size() == view.pixel_count(),
        "one value per pixel of the view");
  auto& scratch = dynamic_cast<Workspace&>(workspace);
  const SlabRays rays(blender_->field_geometry(), room_from_ct, view);
  if (!rays.all_cross()) return {rays.blank_outside(column_gradient, row_gradient)};
  const auto warp_slopes = select_kernel<WarpSlopes>(
      kernels_128::warp_slopes, kernels_256::warp_slopes, kernels_512::warp_slopes);
  const NodeImages nodes =
      with_sobel_slopes(summed_images(*blender_, sum_slab_, rays, {1, false}, scratch), scratch);
  const Homography homography = nodes_from_pixels(nodes.grid, rays);
  for_each_band(view, *pool_, [&](const PixelGrid& band) {
    warp_slopes(image_of(nodes, 1),
                nodes.images[2],
                homography,
                band,
                column_gradient.data(),
                row_gradient.data());
  });
  if (rays.all_inside()) return {};
  return {rays.blank_outside(column_gradient, row_gradient)};
}

}  // namespace af
