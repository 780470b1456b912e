// SPDX-License-Identifier: Apache-2.0
// Seconds of one DRR looked up in a field, one core, beside casting it through the CT.
#include "base/error.h"
#include "base/hash_random.h"
#include "benchmark/alternating_rounds.h"
#include "benchmark/benchmark_case.h"
#include "benchmark/plastimatch_drr.h"
#include "cli/app_main.h"
#include "drr/af_drr.h"
#include "drr/ray_cast_drr.h"
#include "drr/two_pass_af_drr.h"
#include "io/field_file.h"

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
      parameters.rotation_rad[axis] = range.max_rotation_rad * (2.0 * random.uniform() - 1.0);
      parameters.translation_mm[axis] = range.max_translation_mm * (2.0 * random.uniform() - 1.0);
    }
    poses.push_back(pose_from_parameters(field.identity.frame, parameters));
  }
  return poses;
}

/// One run renders `poses` `repetitions` times; all contenders see the same poses.
Contender renderer_contender(const char* name,
                             const DrrRenderer& renderer,
                             const std::vector<RigidTransform>& poses,
                             const View& view,
                             int repetitions) {
  const auto workspace = std::shared_ptr<RenderWorkspace>(renderer.make_workspace());
  const auto image = std::make_shared<std::vector<float>>(view.pixel_count());
  const auto run = [&renderer, &poses, view, workspace, image, repetitions] {
    return seconds_of([&] {
      for (int i = 0; i < repetitions; ++i)
        for (const RigidTransform& pose : poses) renderer.render(pose, view, *workspace, *image);
    });
  };
  return {name, static_cast<double>(repetitions) * static_cast<double>(poses.size()), "DRRs", run};
}

void run(const CaseOptions& options,
         const std::string& field_path,
         const std::string& work,
         const Communicator& world) {
  const BenchmarkCase benchmark_case(options);
  FieldFileInfo info;
  const auto field = read_field(field_path, world, &info);
  const View view = View::whole_detector(field->identity.camera);
  const std::vector<RigidTransform> poses = random_poses(*field, options.is_quick ? 2 : 20);
  const std::vector<RigidTransform> few_poses = evenly_spread(poses, 2);
  const TwoPassAfDrr two_pass(field);
  const AfDrr quadrilinear(field);
  const RayCastDrr ray_cast(benchmark_case.volume());
  std::vector<Contender> contenders = {
      renderer_contender("TwoPassAfDrr", two_pass, poses, view, options.is_quick ? 1 : 20),
      renderer_contender("AfDrr, 16 taps", quadrilinear, poses, view, 1),
      renderer_contender("RayCastDrr", ray_cast, few_poses, view, 1)};
  const auto plastimatch = PlastimatchDrr::prepare(benchmark_case, work, options.is_quick ? 1 : 3);
  if (plastimatch)
    contenders.push_back({"plastimatch drr exact", 1.0 * plastimatch->drrs_per_call(), "DRRs", [&] {
                            return plastimatch->run();
                          }});
  const std::vector<Timing> timings = alternate(contenders, options.rounds);
  nlohmann::json ratios = nlohmann::json::array();
  for (std::size_t i = 1; i < timings.size(); ++i)
    ratios.push_back(speed_ratio(timings.front(), timings[i]));
  write_section(options.output,
                "drr-look-up",
                {{"case", benchmark_case.description()},
                 {"field_payload_sha256", info.payload_sha256},
                 {"slabs", field->light_slab.slabs.size()},
                 {"codewords", field->codebook.size()},
                 {"results", to_json(timings)},
                 {"ratios", ratios}});
}

}  // namespace

}  // namespace af::benchmark

// Only what CLI11 throws while the options are bound: a defect.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  af::benchmark::CaseOptions options;
  std::string field_path;
  std::string work;
  CLI::App app{"Seconds of one DRR looked up in a field, one core."};
  af::benchmark::bind_case(app, options);
  app.add_option("--field", field_path, "The field of --ct and --camera")->required();
  app.add_option("--work", work, "Folder for plastimatch's files")->required();
  return af::cli::app_main(app, argc, argv, [&](const af::Communicator& world) {
    af::benchmark::run(options, field_path, work, world);
  });
}
