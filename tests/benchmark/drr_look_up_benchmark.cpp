// SPDX-License-Identifier: Apache-2.0
// Seconds of one DRR on one core: looked up in a field, and cast through the CT.
#include <functional>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/hash_random.h"
#include "benchmark/alternating_rounds.h"
#include "benchmark/benchmark_case.h"
#include "benchmark/plastimatch_drr.h"
#include "cli/app_main.h"
#include "drr/ray_by_ray_af_drr.h"
#include "drr/ray_cast_drr.h"
#include "drr/two_pass_af_drr.h"
#include "field/field_reading.h"

namespace af::benchmark {

namespace {

/// Poses uniform in the field's motion box.
std::vector<RigidTransform> random_poses(const CompressedAttenuationField& field, int count) {
  std::vector<RigidTransform> poses;
  const MotionRange& range = field.identity.range;
  for (int i = 0; i < count; ++i) {
    HashRandom random(1, static_cast<std::uint64_t>(i));
    PoseParameters parameters;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      parameters.rotation_rad[axis] = range.max_rotation_rad() * (2.0 * random.uniform() - 1.0);
      parameters.translation_mm[axis] = range.max_translation_mm() * (2.0 * random.uniform() - 1.0);
    }
    poses.push_back(pose_from_parameters(field.identity.frame, parameters));
  }
  return poses;
}

/// Renders one pose into planes of the view's pixels.
using Draw = std::function<void(
    const RigidTransform& pose, RenderWorkspace& workspace, std::span<float> planes)>;

/// The poses that all contenders draw, and how often each is drawn in one run.
struct Series {
  const std::vector<RigidTransform>& poses;
  int repetitions;
};

Contender drawing_contender(const std::string& name,
                            const DrrRenderer& renderer,
                            const Series& series,
                            std::size_t values,
                            const Draw& draw) {
  const auto workspace = std::shared_ptr<RenderWorkspace>(renderer.make_workspace());
  const auto planes = std::make_shared<std::vector<float>>(values);
  const auto run = [series, workspace, planes, draw] {
    return seconds_of([&] {
      for (int i = 0; i < series.repetitions; ++i)
        for (const RigidTransform& pose : series.poses) draw(pose, *workspace, *planes);
    });
  };
  const double count =
      static_cast<double>(series.repetitions) * static_cast<double>(series.poses.size());
  return {name, count, "DRRs", run};
}

enum class Derivatives { None, OfThePose };

Contender renderer_contender(const std::string& name,
                             const DrrRenderer& renderer,
                             const Series& series,
                             const View& view,
                             Derivatives derivatives = Derivatives::None) {
  const std::size_t pixels = view.pixel_count();
  const bool has_gradients = derivatives == Derivatives::OfThePose;
  const Draw draw = [&renderer, view, pixels, has_gradients](
                        const RigidTransform& pose, RenderWorkspace& workspace, auto planes) {
    std::optional<PoseGradients> gradients;
    if (has_gradients) gradients = {Eigen::Vector3d::Zero(), planes.subspan(pixels)};
    renderer.render(pose, view, workspace, planes.first(pixels), gradients);
  };
  return drawing_contender(name, renderer, series, (has_gradients ? 7 : 1) * pixels, draw);
}

/// dU/dcolumn and dU/drow.
Contender gradient_image_contender(const std::string& name,
                                   const TwoPassAfDrr& renderer,
                                   const Series& series,
                                   const View& view) {
  const std::size_t pixels = view.pixel_count();
  return drawing_contender(
      name,
      renderer,
      series,
      2 * pixels,
      [&renderer, view, pixels](
          const RigidTransform& pose, RenderWorkspace& workspace, auto planes) {
        renderer.render_gradient_images(
            pose, view, workspace, planes.first(pixels), planes.last(pixels));
      });
}

/// The middle of the detector, 3/4 as wide and high.
View middle_of(const View& whole) {
  const RegionOfInterest& roi = whole.roi;
  return {whole.camera, {roi.width / 8, roi.height / 8, roi.width * 3 / 4, roi.height * 3 / 4}};
}

/// The whole detector seen by four times as many pixels along each axis.
View finer(const View& whole) {
  CameraGeometry camera = whole.camera;
  camera.detector_origin_point = camera.detector_point(-0.375, -0.375);
  camera.pixel_spacing_mm /= 4.0;
  camera.size_px *= 4;
  return View::whole_detector(camera);
}

struct LookUpOptions {
  CaseOptions of_case;
  std::string field;
  std::string work;
  std::string section = "drr-look-up";
};

void run(const LookUpOptions& of_look_up, const Communicator& world) {
  const CaseOptions& options = of_look_up.of_case;
  const BenchmarkCase benchmark_case(options);
  FieldFileInfo info;
  const auto field = read_field(of_look_up.field, world, &info);
  const View view = View::whole_detector(field->identity.camera);
  const std::vector<RigidTransform> poses = random_poses(*field, options.is_quick ? 2 : 20);
  const std::vector<RigidTransform> few_poses = evenly_spread(poses, 2);
  const auto samples = std::make_shared<const FieldLevel>(decode_field(field));
  // With a filter, every look-up reads decoded samples, so all share these.
  const bool has_filter = field->codebook.filter.has_value();
  const auto renderer = [&](const TwoPassOptions& look_up, int threads = 1) {
    auto pool = std::make_shared<ThreadPool>(threads);
    return has_filter ? TwoPassAfDrr(samples, look_up, std::move(pool))
                      : TwoPassAfDrr(field, look_up, std::move(pool));
  };
  const TwoPassAfDrr two_pass = renderer({});
  const TwoPassAfDrr cubic = renderer({AxisInterpolation::Cubic, AxisInterpolation::Linear});
  const TwoPassAfDrr cubic_uv = renderer({AxisInterpolation::Cubic, AxisInterpolation::Cubic});
  const auto pyramid = make_field_pyramid(field, 2);
  const TwoPassAfDrr decoded(samples);
  const TwoPassAfDrr cubic_sum(samples, {.sums_on_more_nodes = true});
  const TwoPassAfDrr half(pyramid[0]);
  const TwoPassAfDrr quarter(pyramid[1]);
  const View region = middle_of(view);
  const View fine = finer(view);
  const TwoPassAfDrr on_two_threads = renderer({}, 2);
  const RayByRayAfDrr quadrilinear(field);
  const RayCastDrr ray_cast(benchmark_case.volume());
  const Series series{poses, options.is_quick ? 1 : 20};
  const std::string region_name = "TwoPassAfDrr, region of 3/4";
  std::vector<Contender> contenders = {
      renderer_contender("TwoPassAfDrr", two_pass, series, view),
      renderer_contender("TwoPassAfDrr, cubic", cubic, series, view),
      renderer_contender("TwoPassAfDrr, cubic-uv", cubic_uv, series, view),
      renderer_contender(
          "TwoPassAfDrr, six gradients", two_pass, series, view, Derivatives::OfThePose),
      renderer_contender(
          "TwoPassAfDrr, cubic, six gradients", cubic, series, view, Derivatives::OfThePose),
      gradient_image_contender("TwoPassAfDrr, gradient images", two_pass, series, view),
      renderer_contender("TwoPassAfDrr, decoded, cubic-sum", cubic_sum, series, view),
      renderer_contender("TwoPassAfDrr, decoded, cubic-sum, six gradients",
                         cubic_sum,
                         series,
                         view,
                         Derivatives::OfThePose),
      renderer_contender(region_name, two_pass, series, region),
      renderer_contender(region_name + ", level 1", half, series, region.coarser(2)),
      renderer_contender(region_name + ", level 2", quarter, series, region.coarser(4)),
      renderer_contender("TwoPassAfDrr, 16 times the pixels", two_pass, {poses, 2}, fine),
      renderer_contender(
          "TwoPassAfDrr, 16 times the pixels, two threads", on_two_threads, {poses, 2}, fine),
      renderer_contender("RayByRayAfDrr, 16 taps", quadrilinear, {poses, 1}, view),
      renderer_contender("RayCastDrr", ray_cast, {few_poses, 1}, view),
      renderer_contender(
          "RayCastDrr, six gradients", ray_cast, {few_poses, 1}, view, Derivatives::OfThePose)};
  if (!has_filter) {
    contenders.push_back(renderer_contender("TwoPassAfDrr, decoded", decoded, series, view));
    contenders.push_back(renderer_contender(
        "TwoPassAfDrr, decoded, six gradients", decoded, series, view, Derivatives::OfThePose));
  }
  const auto plastimatch =
      PlastimatchDrr::prepare(benchmark_case, of_look_up.work, options.is_quick ? 1 : 3);
  if (plastimatch)
    contenders.push_back({"plastimatch drr exact", 1.0 * plastimatch->drrs_per_call(), "DRRs", [&] {
                            return plastimatch->run();
                          }});
  const std::vector<Timing> timings = alternate(contenders, options.rounds);
  nlohmann::json ratios = nlohmann::json::array();
  for (std::size_t i = 1; i < timings.size(); ++i)
    ratios.push_back(speed_ratio(timings.front(), timings[i]));
  write_section(options.output,
                of_look_up.section,
                {{"case", benchmark_case.description()},
                 {"field_payload_sha256", info.payload_sha256},
                 {"field", lattice_description(field->light_slab)},
                 {"codewords", field->codebook.size()},
                 {"results", to_json(timings)},
                 {"ratios", ratios}});
}

}  // namespace

}  // namespace af::benchmark

// Outside app_main only the declaration of options can throw, and that would be a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::benchmark::LookUpOptions options;
  CLI::App app{"Seconds of one DRR looked up in a field, one core."};
  af::benchmark::bind_case(app, options.of_case);
  app.add_option("--field", options.field, "The field of --ct and --camera")->required();
  app.add_option("--work", options.work, "Folder for plastimatch's files")->required();
  app.add_option("--section", options.section, "The section's name")->capture_default_str();
  return af::cli::app_main(
      app, argc, argv, [&](const af::Communicator& world) { af::benchmark::run(options, world); });
}
