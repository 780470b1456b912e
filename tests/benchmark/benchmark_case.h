// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/app_forward.h"
#include "drr/drr_renderer.h"
#include "field/attenuation_quantizer.h"
#include "geometry/light_slab.h"
#include "precompute/casting/slab_aligned_volume.h"
#include "precompute/casting/unit_tiles.h"
#include "precompute/casting/work_unit.h"

namespace af::benchmark {

/// The options that every benchmark program has.
struct CaseOptions {
  std::string ct;
  std::string rig = "c-arm-12in";
  std::string camera = "AP";
  int uv_nodes = 64;  ///< the paper's field
  int st_nodes = 256;
  int rounds = 5;
  bool is_quick = false;  ///< seconds instead of minutes: shows that it works, not how fast
  std::string output;     ///< the section's JSON
};

void bind_case(CLI::App& app, CaseOptions& options);

/// A CT and a camera, and the field geometry that af-precompute would choose for them. The CT is
/// brought to identity direction, because the casters of ITK and plastimatch need it.
class BenchmarkCase {
 public:
  explicit BenchmarkCase(const CaseOptions& options);

  [[nodiscard]] const CtVolume& ct() const { return ct_; }
  [[nodiscard]] const std::shared_ptr<const AttenuationVolume>& volume() const { return volume_; }
  [[nodiscard]] const View& view() const { return view_; }
  [[nodiscard]] const PoseFrame& frame() const { return frame_; }
  [[nodiscard]] const LightSlab& light_slab() const { return light_slab_; }
  [[nodiscard]] AttenuationQuantizer quantizer() const;
  [[nodiscard]] std::vector<WorkUnit> units() const;  ///< as one rank would cast them
  /// The CT and the camera.
  [[nodiscard]] nlohmann::json description() const;
  /// The same, and the field geometry.
  [[nodiscard]] nlohmann::json description_with_field() const;

 private:
  CaseOptions options_;
  CtVolume ct_;
  std::shared_ptr<const AttenuationVolume> volume_;
  PoseFrame frame_;
  View view_;
  LightSlab light_slab_;
};

/// Picks `count` of the values, evenly spread.
template <typename Value>
std::vector<Value> evenly_spread(const std::vector<Value>& values, std::size_t count) {
  std::vector<Value> spread;
  const std::size_t taken = count < values.size() ? count : values.size();
  for (std::size_t i = 0; i < taken; ++i)
    spread.push_back(values[(2 * i + 1) * values.size() / (2 * taken)]);
  return spread;
}

/// Nodes of a field.
nlohmann::json lattice_description(const LightSlab& light_slab);

/// Processor, its caches, memory, kernel, vector width, compiler and commit.
nlohmann::json machine_description();

/// Writes {"section": name, "machine": ..., "commit": that of AF_BENCHMARK_COMMIT, ...body}.
void write_section(const std::string& output, const std::string& name, nlohmann::json body);

nlohmann::json read_json(const std::filesystem::path& path);

}  // namespace af::benchmark
