// SPDX-License-Identifier: Apache-2.0
#include "evaluate/image_quality/measure_held_out.h"

#include <cmath>
#include <iostream>
#include <memory>
#include <optional>

#include "base/error.h"
#include "base/thread_pool.h"
#include "drr/field_renderer.h"
#include "drr/opened_field.h"
#include "drr/ray_cast_drr.h"
#include "evaluate/report/report_program.h"
#include "evaluate/report/table_paths.h"
#include "files/csv_cells.h"
#include "files/output_file.h"
#include "ranks/root_only.h"
#include "ranks/terminal.h"
#include "study/node_ct.h"
#include "study/shared_inputs.h"
#include "study/xray_reader.h"
#include "xray/gaussian_blur.h"
#include "xray/psnr.h"

namespace af::evaluation {
namespace {

/// Standard deviation of the Gaussian by which images are smoothed for the second PSNR.
constexpr double kSmoothingPx = 1.5;

/// Ray casting or a field, which predicts X-rays.
struct Predictor {
  std::string name;
  std::shared_ptr<const DrrRenderer> renderer;
};

/// One X-ray and one prediction of it.
struct HeldOutRow {
  std::string case_name;
  std::string camera;
  std::string predictor;
  double psnr_db;
  double smoothed_psnr_db;
};

struct HeldOutRows {
  std::vector<HeldOutRow> rows;
  int views_outside = 0;  ///< views whose rays some field lacks
};

/// PSNR over chosen pixels. NaN when the X-ray shows nothing there.
double psnr_over(const Image2d& predicted,
                 const Image2d& measured,
                 const std::vector<std::size_t>& pixels) {
  std::vector<float> drr;
  std::vector<float> reference;
  for (const std::size_t pixel : pixels) {
    drr.push_back(predicted.pixels[pixel]);
    reference.push_back(measured.pixels[pixel]);
  }
  const std::optional<Psnr> result = psnr(drr, reference);
  return result ? result->psnr_db : std::nan("");
}

/// Pixels of the region that no mask hides and whose rays the CT attenuates.
std::vector<std::size_t> judged_pixels(const ViewXray& xray,
                                       const RegionOfInterest& region,
                                       const Image2d& cast) {
  std::vector<std::size_t> pixels;
  for (int row = region.row; row < region.row + region.height; ++row)
    for (int column = region.column; column < region.column + region.width; ++column) {
      const std::size_t pixel =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(cast.width) +
          static_cast<std::size_t>(column);
      const bool is_used = xray.mask.pixels.empty() || xray.mask.pixels[pixel] != 0.0F;
      if (is_used && cast.pixels[pixel] > 0.0F) pixels.push_back(pixel);
    }
  return pixels;
}

/// The whole detector. The region's pixels are rendered, the others are 0.
Image2d rendered_region(const DrrRenderer& renderer,
                        const RigidTransform& room_from_ct,
                        const View& view) {
  const Image2d part = render_image(renderer, room_from_ct, view);
  Image2d whole(view.camera.size_px.x(), view.camera.size_px.y());
  for (int row = 0; row < part.height; ++row)
    for (int column = 0; column < part.width; ++column)
      whole.at(view.roi.column + column, view.roi.row + row) = part.at(column, row);
  return whole;
}

void judge_view(const Study& study,
                const StudyCase& study_case,
                const StudyView& study_view,
                const std::vector<Predictor>& predictors,
                HeldOutRows& found) {
  const View view = {study.rig.camera(study_view.camera), study_view.roi};
  const RigidTransform& pose = *study_case.gold_room_from_ct;
  for (const Predictor& predictor : predictors)
    if (predictor.renderer->rays_outside(pose, view) > 0) {
      ++found.views_outside;
      return;
    }
  const ViewXray xray = read_view_xray(study_view, view.camera);
  std::vector<Image2d> drrs;
  drrs.reserve(predictors.size());
  for (const Predictor& predictor : predictors)
    drrs.push_back(rendered_region(*predictor.renderer, pose, view));
  const std::vector<std::size_t> pixels = judged_pixels(xray, view.roi, drrs.front());
  const auto judged_part = [&](const Image2d& whole) {
    Image2d part(whole.width, whole.height);
    for (const std::size_t pixel : pixels) part.pixels[pixel] = whole.pixels[pixel];
    return part;
  };
  // No DRR is rendered beyond the region, so smoothing must not take the X-ray from there either.
  const Image2d measured = judged_part(xray.attenuation);
  const Image2d smooth_measured = gaussian_blur(measured, kSmoothingPx);
  for (std::size_t i = 0; i < predictors.size(); ++i) {
    const Image2d predicted = judged_part(drrs[i]);
    found.rows.push_back(
        {study_case.name,
         study_view.camera,
         predictors[i].name,
         psnr_over(predicted, measured, pixels),
         psnr_over(gaussian_blur(predicted, kSmoothingPx), smooth_measured, pixels)});
  }
}

CsvTable rows_table(const std::vector<HeldOutRow>& rows) {
  return csv_table(rows, [](const HeldOutRow& row) -> CsvCells {
    return {{"case", row.case_name},
            {"camera", row.camera},
            {"prediction", row.predictor},
            {"psnr_db", row.psnr_db},
            {"smoothed_psnr_db", row.smoothed_psnr_db},
            {"smoothing_px", kSmoothingPx}};
  });
}

/// Collective. Ray casting first, then the fields under the names of their files.
std::vector<Predictor> load_predictors(const HeldOutOptions& options, const Communicator& world) {
  const auto pool = std::make_shared<ThreadPool>(thread_count(options.threads));
  std::vector<Predictor> fields;
  std::vector<std::string> warnings;
  std::optional<FieldIdentity> identity;
  for (const std::filesystem::path& path : options.fields) {
    const OpenedField field(path, world);
    if (!identity) identity = field.identity();
    all_or_none(world, [&] {
      require_same_ct(path.string(), identity->ct, "that of the first field", field.identity().ct);
    });
    fields.push_back({path.filename().string(), field.renderer(options.look_up, pool)});
  }
  const NodeCt ct = read_ct_per_node(options.ct,
                                     options.ct_reading,
                                     {identity->mu_water_per_mm, identity->air_below_hu},
                                     world,
                                     warnings);
  for (const std::string& text : warnings) warn(world, text);
  all_or_none(world, [&] {
    require_same_ct(
        options.fields.front().string(), ct.facts.identity, options.ct.string(), identity->ct);
  });
  std::vector<Predictor> predictors = {
      {"ray casting", std::make_shared<const RayCastDrr>(ct.volume, options.ray_caster, pool)}};
  predictors.insert(predictors.end(), fields.begin(), fields.end());
  return predictors;
}

}  // namespace

void HeldOutOptions::describe(Fields& field_list) {
  field_list("study", study, "study.toml of X-rays whose cases state gold_room_from_ct")
      .input()
      .required();
  field_list("case", cases, "Case of the study, may be repeated (default: all)");
  field_list("field", fields, "Field file, once per field to compare; all of one CT")
      .one_at_a_time()
      .input()
      .required();
  field_list("ct", ct, "The CT that the fields were made from").input().required();
  field_list.part(ct_reading);
  field_list.part(ray_caster);
  field_list(
      "look_up", look_up, "How DRRs are looked up [the field's own way]. " + field_look_up_help())
      .choice(field_look_up_names());
  field_list("threads", threads, "Threads; 0: every processor").within(0, 1024);
  field_list("output",
             output,
             "Markdown file to write, by af-report; a CSV of the same name is written beside it")
      .as("-o,--output");
}

std::vector<std::string> problems(const HeldOutOptions& options) {
  std::vector<std::string> found = field_problems(options);
  for (std::string& problem : table_problems(options.output)) found.push_back(std::move(problem));
  return found;
}

namespace {

void run_held_out(const HeldOutOptions& options,
                  const std::string& /*command_line*/,
                  const Communicator& world) {
  const std::filesystem::path csv = csv_beside(options.output);
  all_or_none(world, [&] {
    throw_if_any(problems(options));
    if (!world.is_root()) return;
    announce_output(csv);
    announce_output(options.output);
  });
  const Shared<Study> study = shared_study(options.study, world);
  const std::vector<const StudyCase*> chosen = all_or_none(world, [&] {
    std::vector<const StudyCase*> cases = study->chosen_cases(options.cases);
    for (const StudyCase* study_case : cases)
      if (!study_case->gold_room_from_ct)
        throw InputError("case '" + study_case->name + "': gold_room_from_ct",
                         "none",
                         "must be in the study",
                         study->path.string());
    return cases;
  });
  const std::vector<Predictor> predictors = load_predictors(options, world);
  do_on_root(world, [&] {
    HeldOutRows found;
    for (const StudyCase* study_case : chosen)
      for (const StudyView& view : study_case->views)
        judge_view(study, *study_case, view, predictors, found);
    if (found.rows.empty())
      throw InputError(
          "study", options.study.string(), "no view has all rays of its region in the fields");
    write_text_file(csv, rows_table(found.rows).to_text());
    draw_results({csv.string()}, world);
    if (found.views_outside > 0)
      std::cout << found.views_outside
                << " views are left out: a field does not hold all rays of their regions.\n";
  });
}

}  // namespace

cli::SubCommand held_out_command(CLI::App& app) {
  return cli::sub_command(
      app,
      "held-out",
      "How well fields and ray casting predict X-rays of known pose: PSNR, per view and as a table",
      run_held_out);
}

}  // namespace af::evaluation
