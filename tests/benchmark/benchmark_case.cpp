// SPDX-License-Identifier: Apache-2.0
#include "benchmark/benchmark_case.h"

#include <cstdlib>
#include <fstream>
#include <sys/utsname.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include "base/build_info.h"
#include "base/error.h"
#include "base/vector_width.h"
#include "ct/ct_reader.h"
#include "geometry/slab_sizing.h"
#include "precompute/casting/shear_warp_caster.h"
#include "study/rig_file.h"
#include "support/itk_comparison.h"

namespace af::benchmark {

namespace {

std::string first_line_with(const std::filesystem::path& path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);)
    if (line.starts_with(key)) {
      const std::size_t colon = line.find(':');
      return colon == std::string::npos ? line
                                        : line.substr(line.find_first_not_of(" \t", colon + 1));
    }
  return "unknown";
}

}  // namespace

void bind_case(CLI::App& app, CaseOptions& options) {
  app.add_option("--ct", options.ct, "CT: image file or DICOM folder")->required();
  app.add_option("--rig", options.rig, "Cameras: a rig.toml or a shipped rig")
      ->capture_default_str();
  app.add_option("--camera", options.camera, "Which camera of the rig")->capture_default_str();
  app.add_option("--uv-nodes", options.uv_nodes, "Viewpoints along each side of the (u,v) plane")
      ->capture_default_str();
  app.add_option("--st-nodes", options.st_nodes, "Nodes along each side of the (s,t) plane")
      ->capture_default_str();
  app.add_option("--rounds", options.rounds, "How often every contender runs")
      ->capture_default_str();
  app.add_flag("--quick", options.is_quick, "Small amounts of work: shows that it works");
  app.add_option("-o,--output", options.output, "The section's JSON file")->required();
}

BenchmarkCase::BenchmarkCase(const CaseOptions& options)
    : options_(options), ct_(test::in_identity_direction(read_ct(options.ct))) {
  volume_ = std::make_shared<const AttenuationVolume>(ct_, AttenuationModel{});
  const CameraRig rig = read_rig(options.rig);
  view_ = View::whole_detector(rig.camera(options.camera));
  frame_ = {Eigen::Matrix3d::Identity(), ct_.grid.center_mm(), rig.isocenter_point};
  LightSlabSpec spec;
  spec.uv_nodes = options.uv_nodes;
  spec.st_nodes = options.st_nodes;
  light_slab_ =
      make_light_slab(view_.camera, frame_, MotionRange{}, volume_->corner_points(), spec);
}

AttenuationQuantizer BenchmarkCase::quantizer() const {
  return AttenuationQuantizer::for_maximum(volume_->max_total_attenuation());
}

std::vector<WorkUnit> BenchmarkCase::units() const {
  const FieldLattice lattice = light_slab_.lattice();
  return plan_units(lattice, plan_options_for_ranks(lattice, 1, kShearWarpPlan));
}

nlohmann::json BenchmarkCase::description() const {
  return {{"ct", std::filesystem::path(options_.ct).filename().string()},
          {"ct_content_sha256", identity_of(ct_).content_sha256},
          {"ct_voxels", ct_.grid.size},
          {"attenuating_voxels", volume_->grid().size},
          {"rig", options_.rig},
          {"camera", options_.camera},
          {"detector_px", {view_.roi.width, view_.roi.height}}};
}

nlohmann::json BenchmarkCase::description_with_field() const {
  nlohmann::json json = description();
  json["field"] = lattice_description(light_slab_);
  return json;
}

nlohmann::json lattice_description(const LightSlab& light_slab) {
  return {{"slabs", light_slab.slabs.size()},
          {"uv_nodes", {light_slab.u.nodes, light_slab.v.nodes}},
          {"st_nodes", {light_slab.slabs.front().s.nodes, light_slab.slabs.front().t.nodes}},
          {"stored_rays", light_slab.lattice().stored_node_count()},
          {"stored_tiles", light_slab.lattice().tile_count()}};
}

nlohmann::json machine_description() {
  utsname system{};
  uname(&system);
  const auto cache = [](int name) { return sysconf(name); };
  return {{"processor", first_line_with("/proc/cpuinfo", "model name")},
          {"cores", sysconf(_SC_NPROCESSORS_ONLN)},
          {"memory", first_line_with("/proc/meminfo", "MemTotal")},
          {"l1d_bytes", cache(_SC_LEVEL1_DCACHE_SIZE)},
          {"l2_bytes", cache(_SC_LEVEL2_CACHE_SIZE)},
          {"l3_bytes", cache(_SC_LEVEL3_CACHE_SIZE)},
          {"kernel", system.release},
          {"vector_bits", to_string(active_vector_width())},
          {"compiler", compiler_description()},
          {"version", program_version()}};
}

void write_section(const std::string& output, const std::string& name, nlohmann::json body) {
  body["section"] = name;
  body["machine"] = machine_description();
  const char* const commit = std::getenv("AF_BENCHMARK_COMMIT");
  body["commit"] = commit != nullptr ? commit : "unknown";
  std::ofstream file(output);
  file << body.dump(2) << '\n';
  if (!file.flush()) throw FileError(output, "cannot be written");
}

nlohmann::json read_json(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw FileError(path.string(), "cannot be read");
  try {
    return nlohmann::json::parse(file);
  } catch (const nlohmann::json::exception& error) {
    throw FileError(path.string(), error.what());
  }
}

}  // namespace af::benchmark
