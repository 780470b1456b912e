// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/scan_options.h"

#include "base/thread_pool.h"

namespace af::tools {

void ScanOptions::describe(Fields& field) {
  field("scan",
        scan,
        "scan.toml: geometry of a circular cone-beam scan, and the names of its image files")
      .input()
      .required();
  field("folder", folder, "Where the scan's images are; default: beside the scan's file");
  field("output", output, "Study folder to make; appears when complete")
      .as("-o,--output")
      .required();
  field("force", replaces_output, "Replace the folder if it exists");
  field(
      "most_px", most_px, "Images are binned until their larger side has at most this many pixels")
      .within(64, 4096);
  field("enlarge_small",
        enlarges_small,
        "Multiply a small scan's lengths, and so errors, by a whole number, which calibration.toml "
        "states, until the detector sees 60 mm");
  field("pairs",
        pairs,
        "Pairs of X-rays about 90 degrees apart; the first of each is a case of one view, too")
      .within(1, 1000);
  field("max_offset_rotation_deg",
        max_offset_rotation_deg,
        "Nominal poses are turned from the true one by a uniform draw of at most this about each "
        "axis, degrees")
      .within(0.0, 30.0);
  field("max_offset_translation_mm",
        max_offset_translation_mm,
        "... and moved by at most this along each axis, mm")
      .within(0.0, 100.0);
  field("mask_deviations",
        mask_deviations,
        "Mask places where an X-ray differs from its prediction by more than this many standard "
        "deviations; 0: no masks")
      .within(0.0, 1000.0);
  field("write_projections",
        writes_projections,
        "Write every view, too: projections.toml has the cases 'measured', for af-precompute "
        "--projections, and 'held-out', for af-evaluate held-out");
  field("seed", seed, "Seed of the nominal poses");
  field("threads", threads, "Threads; 0: every processor")
      .within(0, 1024)
      .not_recorded("results do not depend on it");
  field.start_group("Self-calibration");
  field("as_stated",
        is_as_stated,
        "No self-calibration: the stated geometry is exact (a calibrated or simulated scanner)");
  field.part(calibration);
  field.start_group("Reconstruction");
  field.part(fdk);
  field.at("voxel_mm").help =
      "Voxel of the reconstructed CT, mm; 0: one and a half detector pixels at the axis";
  field.name_like_options();
}

std::vector<std::string> problems(const ScanOptions& options) {
  return field_problems(options);
}

}  // namespace af::tools
