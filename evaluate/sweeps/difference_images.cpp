// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/difference_images.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <utility>

#include "drr/ray_cast_drr.h"
#include "drr/two_pass_af_drr.h"
#include "field/field_reading.h"
#include "figures/picture.h"
#include "files/csv_cells.h"
#include "files/output_file.h"
#include "ranks/root_only.h"
#include "study/node_ct.h"
#include "study/shared_inputs.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

const std::vector<double>& paper_levels_db() {
  static const std::vector<double> levels = {36.0, 40.0, 44.0};
  return levels;
}

/// Rank 0 knows the comparisons, but all ranks need the choice. A DRR that is nearest to several
/// levels is shown once.
Shared<std::vector<SweepDrr>> shared_choice(const std::vector<SettingResult>& results,
                                            const Communicator& world) {
  const auto choose = [&] {
    std::vector<SweepDrr> chosen = drrs_at_levels(results, paper_levels_db());
    chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
    return chosen;
  };
  return on_root(world, choose).share();
}

std::string setting_text(const PrecomputeOptions& setting) {
  return "(u,v) " + std::to_string(setting.design().uv_nodes) + ", (s,t) " +
         std::to_string(setting.design().st_nodes) + ", " +
         std::to_string(setting.design().codewords) + " codewords";
}

void write_files(const std::vector<SettingResult>& results,
                 const std::vector<SweepDrr>& drrs,
                 const std::vector<PicturePanel>& panels,
                 const std::filesystem::path& folder) {
  const SettingResult& first = results[drrs.front().result];
  write_picture(panels,
                2,
                first.target() + ", pose " + std::to_string(drrs.front().pose) +
                    ": field - ray casting at " + std::to_string(drrs.size()) +
                    " qualities, in one window",
                folder / "difference-images.png");
  const CsvTable table = csv_table(drrs, [&](const SweepDrr& drr) -> CsvCells {
    const SettingResult& result = results[drr.result];
    return {{"psnr_db", result.comparisons[drr.pose].psnr_db},
            {"case", result.setting.case_name},
            {"camera", result.setting.camera},
            {"pose_index", drr.pose},
            {"uv_nodes", result.setting.design().uv_nodes},
            {"st_nodes", result.setting.design().st_nodes},
            {"codewords", result.setting.design().codewords},
            {"training_fraction", training_share(result.setting)}};
  });
  write_text_file(folder / "difference-images.csv", table.to_text());
}

/// The DRR of the best field, then the differences. Rank 0 has the comparisons.
std::vector<PicturePanel> panels_of(const std::vector<SettingResult>& results,
                                    const std::vector<SweepDrr>& drrs,
                                    const std::vector<Image2d>& field_images,
                                    const Image2d& reference) {
  const auto top =
      static_cast<double>(*std::max_element(reference.pixels.begin(), reference.pixels.end()));
  constexpr double kWindowShare = 0.05;
  std::vector<PicturePanel> panels = {{field_images.back(),
                                       0.0,
                                       top,
                                       "Field DRR",
                                       setting_text(results[drrs.back().result].setting),
                                       {},
                                       {}}};
  for (std::size_t i = 0; i < drrs.size(); ++i) {
    Image2d difference = field_images[i];
    for (std::size_t pixel = 0; pixel < difference.pixels.size(); ++pixel)
      difference.pixels[pixel] -= reference.pixels[pixel];
    const SettingResult& result = results[drrs[i].result];
    panels.push_back({std::move(difference),
                      -kWindowShare * top,
                      kWindowShare * top,
                      "PSNR " + fixed_text(result.comparisons[drrs[i].pose].psnr_db, 1) + " dB",
                      setting_text(result.setting),
                      PicturePanel::Colors::Diverging,
                      {}});
  }
  return panels;
}

}  // namespace

std::vector<SweepDrr> drrs_at_levels(const std::vector<SettingResult>& results,
                                     const std::vector<double>& levels_db) {
  std::map<std::pair<std::string, std::size_t>, std::vector<SweepDrr>> by_pose;
  for (std::size_t r = 0; r < results.size(); ++r)
    for (std::size_t pose = 0; pose < results[r].comparisons.size(); ++pose)
      if (std::isfinite(results[r].comparisons[pose].psnr_db))
        by_pose[{results[r].target(), pose}].push_back({r, pose});
  std::vector<SweepDrr> best;
  double least_distance_db = std::numeric_limits<double>::infinity();
  for (const auto& [key, drrs] : by_pose) {
    std::vector<SweepDrr> nearest;
    double distance_db = 0.0;
    for (const double level : levels_db) {
      const auto distance = [&](const SweepDrr& drr) {
        return std::abs(results[drr.result].comparisons[drr.pose].psnr_db - level);
      };
      nearest.push_back(
          *std::min_element(drrs.begin(), drrs.end(), [&](const SweepDrr& a, const SweepDrr& b) {
            return distance(a) < distance(b);
          }));
      distance_db += distance(nearest.back());
    }
    if (!(distance_db < least_distance_db)) continue;
    least_distance_db = distance_db;
    best = nearest;
  }
  return best;
}

json write_difference_images(const std::vector<SettingResult>& results,
                             double drr_step_mm,
                             const std::filesystem::path& folder,
                             const Communicator& world) {
  const std::vector<SweepDrr> drrs = shared_choice(results, world);
  if (drrs.empty()) return nullptr;
  std::vector<std::string> warnings;
  const PrecomputeOptions& setting = results[drrs.front().result].setting;
  // The CT is read as the setting says.
  const NodeCt ct = read_ct_per_node(
      setting.ct.empty()
          ? shared_study(setting.study, world)->find_case(setting.case_name).ct.string()
          : setting.ct,
      setting.ct_reading,
      setting.attenuation,
      world,
      warnings);
  std::vector<Image2d> field_images;
  Image2d reference;
  for (const SweepDrr& drr : drrs) {
    const auto field = read_field(results[drr.result].setting.output, world);
    do_on_root(world, [&] {
      const View view = View::whole_detector(field->identity.camera);
      const RigidTransform pose = pose_from_parameters(
          field->identity.frame, results[drr.result].comparisons[drr.pose].parameters);
      field_images.push_back(render_image(TwoPassAfDrr(field), pose, view));
      if (reference.pixels.empty())
        reference = render_image(RayCastDrr(ct.volume, {drr_step_mm}), pose, view);
    });
  }
  json written;
  do_on_root(world, [&] {
    write_files(results, drrs, panels_of(results, drrs, field_images, reference), folder);
    json images = json::array();
    for (const SweepDrr& drr : drrs)
      images.push_back({{"psnr_db", results[drr.result].comparisons[drr.pose].psnr_db}});
    written = {{"file", "difference-images.png"},
               {"target", results[drrs.front().result].target()},
               {"pose_index", drrs.front().pose},
               {"images", images}};
  });
  return written;
}

}  // namespace af::evaluation
