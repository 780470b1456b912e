// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "files/csv_table.h"
#include "ranks/provenance.h"
#include "register/results/registration_columns.h"
#include "register/verdict/registration.h"

namespace af::registration {

/// What all records of a run share.
struct RunDescription {
  std::string case_name;
  std::string renderer;  ///< "field" or "raycast"
  Provenance provenance;
  nlohmann::json landmarks;  ///< what gave the start, with residuals; null for another start
  nlohmann::json search;     ///< what a search found, with likenesses; null without a search
  bool has_pictures = true;  ///< unset by --no-pictures: neither overlays nor slicer/
};

/// result.json: verdict, poses as 4x4 (`room_from_ct`, which read_pose() reads) and as six
/// parameters relative to the nominal pose about the ROI centre, uncertainty, similarity, counts,
/// stop reason, trace, seconds, TRE, provenance. Numbers that do not exist are null. A pose that is
/// "not found" has the key `rejected_room_from_ct`, so that read_pose() does not take it.
nlohmann::json result_json(const RegistrationRecord& record,
                           const RegistrationProblem& problem,
                           const RunDescription& run);

/// Writes a record into its row: everything that needs no gold pose, without the poses.
void set_result(const RegistrationRecord& record, RegistrationRow& row);

/// registrations.csv, with rows sorted by start index. Parameters are relative to the nominal pose,
/// as the column `relative_to` says.
CsvTable registrations_table(std::vector<RegistrationRecord> records,
                             const RegistrationProblem& problem,
                             const RunDescription& run);

/// Picture of one view at a pose: X-ray region, DRR (fitted to the X-ray's scale by least squares),
/// checkerboard of both, and their difference.
void write_overlay(const RegistrationView& view,
                   const RigidTransform& room_from_ct,
                   const std::string& heading,
                   const std::filesystem::path& path);

/// Writes result.json, pose.toml, result.tfm, VIEW-overlay.png and reproduce.sh into `folder`.
/// result.json comes last: when it exists, all do. A result that is "not found" gets no result.tfm,
/// and rejected-pose.toml instead of pose.toml, so that no script takes its pose for a result.
/// Without pictures, an earlier run's overlays are removed. \test
/// ResultFiles.WithoutPicturesNoneAreLeft
void write_result_files(const RegistrationRecord& record,
                        const RegistrationProblem& problem,
                        const RunDescription& run,
                        const std::filesystem::path& folder);

/// Writes what a whole run leaves in `folder`: registrations.csv if there were several starts, then
/// the files of the best record. Returns the summary for the terminal.
std::string write_run(const std::vector<RegistrationRecord>& records,
                      const RegistrationProblem& problem,
                      const RunDescription& run,
                      const std::filesystem::path& folder);

/// Names of files that a run replaces in its folder, independent of the cameras' names.
std::vector<std::string> result_file_names();
/// The pictures that a run replaces, one per view.
std::vector<std::string> overlay_file_names(const RegistrationProblem& problem);

}  // namespace af::registration
