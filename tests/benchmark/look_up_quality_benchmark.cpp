// SPDX-License-Identifier: Apache-2.0
// How good each way of looking up DRRs is without the codebook's loss, and how well its gradients
// agree with ray casting's.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include <CLI/CLI.hpp>

#include "base/hash_random.h"
#include "benchmark/benchmark_case.h"
#include "cli/app_main.h"
#include "ct/blurred_volume.h"
#include "drr/ray_cast_drr.h"
#include "drr/two_pass_af_drr.h"
#include "field/field_reading.h"
#include "precompute/casting/shear_warp_caster.h"
#include "support/central_differences.h"
#include "support/plane_products.h"
#include "xray/psnr.h"

namespace {

using namespace af;
using namespace af::benchmark;

/// A field's samples as they are cast: level 0 without vector quantisation.
std::shared_ptr<const FieldLevel> cast_level(const BenchmarkCase& benchmark_case) {
  const LightSlab& light_slab = benchmark_case.light_slab();
  const SlabAlignedVolume resampled(*benchmark_case.volume(), light_slab.slab_from_ct);
  const ShearWarpFieldCaster caster(resampled, light_slab, benchmark_case.quantizer());
  auto level = std::make_shared<FieldLevel>();
  level->field_geometry = light_slab;
  level->quantizer_step = benchmark_case.quantizer().step();
  level->slabs.push_back({light_slab.slabs[0], {}});
  const SlabGeometry& slab = light_slab.slabs[0];
  const std::size_t per_viewpoint = level->slabs[0].samples_per_viewpoint();
  std::vector<std::uint16_t> samples(level->viewpoint_count() * per_viewpoint + kFieldLevelPadding);
  std::vector<std::uint16_t> cast;
  for (const WorkUnit& unit : benchmark_case.units()) {
    cast.resize(unit.sample_count());
    caster.cast(unit, cast);
    const std::uint16_t* from = cast.data();
    for (int u = unit.u.begin; u < unit.u.end(); ++u)
      for (int v = unit.v.begin; v < unit.v.end(); ++v)
        for (int s = unit.s.begin; s < unit.s.end(); ++s)
          for (int t = unit.t.begin; t < unit.t.end(); ++t) {
            const auto viewpoint =
                static_cast<std::size_t>(u) * static_cast<std::size_t>(light_slab.v.nodes) +
                static_cast<std::size_t>(v);
            const auto node = static_cast<std::size_t>(t - slab.stored_t.begin) *
                                  static_cast<std::size_t>(slab.stored_s.count) +
                              static_cast<std::size_t>(s - slab.stored_s.begin);
            samples[viewpoint * per_viewpoint + node] = *from++;
          }
  }
  level->slabs[0].samples =
      LevelSamples({light_slab.u.nodes, light_slab.v.nodes, per_viewpoint}, std::move(samples));
  return level;
}

struct Way {
  std::string name;
  std::shared_ptr<const TwoPassAfDrr> renderer;
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// PSNR against ray casting at every pose.
double median_psnr_db(const Way& way,
                      const std::vector<RigidTransform>& poses,
                      const std::vector<Image2d>& references,
                      const View& view) {
  std::vector<double> values;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto quality =
        psnr(render_image(*way.renderer, poses[i], view).pixels, references[i].pixels);
    if (quality.has_value()) values.push_back(quality->psnr_db);
  }
  return values.empty() ? std::numeric_limits<double>::quiet_NaN() : median(values);
}

using SixNumbers = std::array<double, 6>;

struct GradientQuality {
  SixNumbers cosine_with_ray_casting{};
  SixNumbers relative_difference{};  ///< from central differences of the same renderer
};

GradientQuality gradient_quality(const Way& way,
                                 const std::vector<RigidTransform>& poses,
                                 const std::vector<std::vector<float>>& cast_gradients,
                                 const View& view,
                                 const Eigen::Vector3d& pivot) {
  const std::size_t pixels = view.pixel_count();
  const auto workspace = way.renderer->make_workspace();
  std::vector<float> value(pixels);
  std::vector<float> analytic(6 * pixels);
  std::vector<float> differences(6 * pixels);
  std::array<af::test::PlaneProducts, 6> with_cast{};
  std::array<af::test::PlaneProducts, 6> with_own{};
  // Small, since slopes jump at the borders of cells.
  const test::DifferenceSteps steps{5e-5, 0.005};
  for (std::size_t pose = 0; pose < cast_gradients.size(); ++pose) {
    way.renderer->render(poses[pose], view, *workspace, value, PoseGradients{pivot, analytic});
    test::central_difference_gradients(
        *way.renderer, poses[pose], view, *workspace, {pivot, differences}, steps);
    for (std::size_t p = 0; p < 6; ++p) {
      const auto plane = std::span<const float>(analytic).subspan(p * pixels, pixels);
      with_cast[p].add(plane,
                       std::span<const float>(cast_gradients[pose]).subspan(p * pixels, pixels));
      with_own[p].add(plane, std::span<const float>(differences).subspan(p * pixels, pixels));
    }
  }
  GradientQuality quality;
  for (std::size_t p = 0; p < 6; ++p) {
    quality.cosine_with_ray_casting[p] = with_cast[p].cosine();
    quality.relative_difference[p] = with_own[p].relative_distance();
  }
  return quality;
}

std::vector<Way> all_ways(const std::shared_ptr<const CompressedAttenuationField>& field,
                          const std::shared_ptr<const FieldLevel>& samples) {
  using enum AxisInterpolation;
  std::vector<Way> ways;
  for (const auto& [name, options] :
       {std::pair<const char*, TwoPassOptions>{"linear", {Linear, Linear}},
        {"cubic-sum", {Linear, Linear, true}},
        {"cubic", {Cubic, Linear}},
        {"cubic-uv", {Cubic, Cubic}}}) {
    ways.push_back({name, std::make_shared<const TwoPassAfDrr>(field, options)});
    ways.push_back({std::string(name) + ", unquantised",
                    std::make_shared<const TwoPassAfDrr>(samples, options)});
  }
  return ways;
}

/// The gradients of ray casting at the first poses.
std::vector<std::vector<float>> cast_gradients_at(const std::vector<RigidTransform>& poses,
                                                  std::size_t count,
                                                  const RayCastDrr& ray_cast,
                                                  const View& view,
                                                  const Eigen::Vector3d& pivot) {
  std::vector<std::vector<float>> gradients(count);
  const auto workspace = ray_cast.make_workspace();
  for (std::size_t i = 0; i < count; ++i) {
    gradients[i].resize(6 * view.pixel_count());
    // Larger than the ray caster's noise from its step of 1 mm.
    test::central_difference_gradients(
        ray_cast, poses[i], view, *workspace, {pivot, gradients[i]}, {2e-3, 0.5});
  }
  return gradients;
}

nlohmann::json report(const Way& way,
                      const std::vector<RigidTransform>& poses,
                      const std::vector<Image2d>& references,
                      const std::vector<std::vector<float>>& cast_gradients,
                      const View& view,
                      const Eigen::Vector3d& pivot) {
  const GradientQuality gradients = gradient_quality(way, poses, cast_gradients, view, pivot);
  const double psnr_db = median_psnr_db(way, poses, references, view);
  std::printf("%-22s %.2f dB, cosine", way.name.c_str(), psnr_db);
  for (const double cosine : gradients.cosine_with_ray_casting) std::printf(" %.3f", cosine);
  std::printf(", from differences");
  for (const double part : gradients.relative_difference) std::printf(" %.4f", part);
  std::printf("\n");
  return {{"median_psnr_db", psnr_db},
          {"gradient_cosine_with_ray_casting", gradients.cosine_with_ray_casting},
          {"gradient_relative_difference", gradients.relative_difference}};
}

void run(const CaseOptions& options, const std::string& field_path, const Communicator& world) {
  const BenchmarkCase benchmark_case(options);
  const auto field = read_field(field_path, world);
  const RayCastDrr ray_cast(benchmark_case.volume());
  const View& view = benchmark_case.view();
  const MotionRange& range = field->identity.range;
  const Eigen::Vector3d pivot = field->identity.frame.center_room_mm;
  std::vector<RigidTransform> poses;
  std::vector<Image2d> references;
  for (std::uint64_t i = 0; i < (options.is_quick ? 2u : 100u); ++i) {
    HashRandom random(1, i);
    std::array<double, 6> p{};
    for (double& value : p) value = random.uniform(-1.0, 1.0);
    PoseParameters parameters;
    parameters.rotation_rad = range.max_rotation_rad() * Eigen::Vector3d(p[0], p[1], p[2]);
    parameters.translation_mm = range.max_translation_mm() * Eigen::Vector3d(p[3], p[4], p[5]);
    poses.push_back(pose_from_parameters(field->identity.frame, parameters));
    references.push_back(render_image(ray_cast, poses.back(), view));
  }
  const std::size_t gradient_poses = options.is_quick ? 1 : 5;
  const auto cast_gradients = cast_gradients_at(poses, gradient_poses, ray_cast, view, pivot);
  nlohmann::json results;
  for (const Way& way : all_ways(field, cast_level(benchmark_case)))
    results[way.name] = report(way, poses, references, cast_gradients, view, pivot);
  // Levels of the field against those of ray casting, which blur the CT by as much.
  for (const auto& level : make_field_pyramid(field, 2)) {
    const RayCastDrr blurred(blurred_volume(*benchmark_case.volume(), level->blur_sigma_mm(true)));
    const View coarse = view.coarser(1 << level->level);
    std::vector<Image2d> blurred_references;
    for (const RigidTransform& pose : poses)
      blurred_references.push_back(render_image(blurred, pose, coarse));
    const Way way{"level " + std::to_string(level->level),
                  std::make_shared<const TwoPassAfDrr>(level)};
    results[way.name] = report(way,
                               poses,
                               blurred_references,
                               cast_gradients_at(poses, gradient_poses, blurred, coarse, pivot),
                               coarse,
                               pivot);
  }
  write_section(options.output,
                "look-up-quality",
                {{"case", benchmark_case.description_with_field()}, {"results", results}});
}

}  // namespace

// Only a defect in the declaration of options can throw here, and it may end the program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  CaseOptions options;
  std::string field_path;
  CLI::App app{
      "PSNR and gradients of every two-pass look-up, of a field and of its samples before the "
      "codebook."};
  bind_case(app, options);
  app.add_option("--field", field_path, "The field of --ct and --camera, one slab")->required();
  return cli::app_main(
      app, argc, argv, [&](const Communicator& world) { run(options, field_path, world); });
}
