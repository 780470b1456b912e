// SPDX-License-Identifier: Apache-2.0
#include "tools/inspect/inspection.h"

#include <algorithm>
#include <fstream>
#include <new>
#include <sstream>
#include <string_view>

#include "base/joined.h"
#include "ct/dicom_series.h"
#include "figures/ct_pictures.h"
#include "figures/study_pictures.h"
#include "files/foreign_file.h"
#include "files/input_file.h"
#include "files/output_file.h"
#include "images/image_header.h"
#include "ranks/progress_journal.h"
#include "study/case_gold_standard.h"
#include "study/matrix_text.h"
#include "study/node_ct.h"
#include "study/pose_file.h"
#include "study/rig_file.h"
#include "study/study_file.h"
#include "tools/inspect/inspect_kinds.h"

namespace af {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

/// Detectors with more pixels on a side are drawn smaller.
constexpr int kMostDetectorPixels = 1200;

constexpr std::string_view kHdf5Mark = "\x89HDF\r\n\x1a\n";

constexpr const char* kWhatWasTried =
    "; tried: DICOM folder, result folder, unfinished work (NAME.progress), HDF5 "
    "field, NIfTI, MetaImage, NRRD, TIFF, PNG, DICOM file, TOML rig, study or pose, JSON result, "
    "CSV table, pose as ITK's text, name of a shipped rig, and cameras as 3x4 matrices. Cameras "
    "and "
    "poses of other programs are converted by af-convert";

FileError not_recognised(const fs::path& path) {
  return {path.string(), "not recognised" + foreign_content(path) + kWhatWasTried};
}

std::string first_bytes(const fs::path& path, std::size_t count) {
  std::ifstream file = open_input_file(path);
  std::string bytes(count, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(count));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  return bytes;
}

bool is_text(std::string_view bytes) {
  return !bytes.empty() && std::all_of(bytes.begin(), bytes.end(), [](char c) {
    return static_cast<unsigned char>(c) >= ' ' || c == '\n' || c == '\r' || c == '\t';
  });
}

/// True when some line begins with `start` (after blanks).
bool has_line(std::string_view text, std::string_view start) {
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t first = text.find_first_not_of(" \t", at);
    if (first != std::string_view::npos && text.substr(first).starts_with(start)) return true;
    const std::size_t end = text.find('\n', at);
    if (end == std::string_view::npos) break;
    at = end + 1;
  }
  return false;
}

/// The bytes in which texts, and small HDF5 and DICOM files, have their marks.
constexpr std::size_t kMarkedBytes = 1u << 18;

void refuse_foreign(const fs::path& path, std::string_view beginning) {
  if (has_foreign_mark(beginning))
    throw needs_conversion({&path, 1}, "is no format of these programs", "", "converted.toml");
}

void inspect_text(const fs::path& path, const CtReadOptions& options, Inspection& inspection) {
  const std::string text = first_bytes(path, kMarkedBytes);
  if (!is_text(text)) throw not_recognised(path);
  if (has_line(text, "[[case]]")) {
    if (!options.text().empty() || !options.series_uid.empty())
      throw InputError(path.string() +
                       ": is a study, whose cases say how their CTs are read (ct_values, "
                       "ct_resample, ...); options of reading a CT must not be given with it");
    return inspect_study(path, inspection);
  }
  if (has_line(text, "[[camera]]") || is_matrix_text(text))
    return inspect_rig(path.string(), inspection);
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first != std::string::npos && text[first] == '{') return inspect_json(path, inspection);
  if (text.starts_with("#Insight Transform") || has_line(text, "room_from_ct"))
    return inspect_pose(path, inspection);
  if (path.extension() == ".csv") return inspect_csv(path, inspection);
  refuse_foreign(path, text);
  throw not_recognised(path);
}

/// HDF5 and DICOM files of other programs are refused before they are read as fields or images.
void inspect_file(const fs::path& path,
                  const CtReadOptions& options,
                  const Communicator& communicator,
                  Inspection& inspection) {
  if (first_bytes(path, kHdf5Mark.size()) == kHdf5Mark) {
    refuse_foreign(path, first_bytes(path, kMarkedBytes));
    return inspect_field(path, communicator, inspection);
  }
  const auto format = sniff_image_format(path);
  if (format == ImageFormat::Dicom) refuse_foreign(path, first_bytes(path, kMarkedBytes));
  if (format) return inspect_image(path, options, inspection);
  inspect_text(path, options, inspection);
}

/// The files of a folder that mean something to this project, in the order of their names.
std::vector<fs::path> known_files(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;  // for a link that leads nowhere or in circles
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    const bool known = name == "result.json" || name == "summary.json" ||
                       name == "registrations.csv" || name == "image-quality.csv" ||
                       name == "study.toml" || name == "rig.toml" || name == "pose.toml" ||
                       name.ends_with(".tfm") || name.ends_with(".af.h5");
    if (known && entry.is_regular_file(error)) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

void inspect_folder(const fs::path& folder,
                    const CtReadOptions& options,
                    const Communicator& communicator,
                    Inspection& inspection) {
  if (holds_dicom(folder)) return inspect_ct(folder, options, inspection);
  if (holds_progress_journal(folder)) {
    inspection.kind = "unfinished work";
    inspection.facts["next_step"] = "run the same command again to go on from here";
    return;
  }
  const std::vector<fs::path> files = known_files(folder);
  if (files.empty()) {
    const std::string what = fs::is_empty(folder) ? "not recognised (the folder is empty)"
                                                  : "not recognised: no file of it is known";
    throw FileError(folder.string(), what + kWhatWasTried);
  }
  inspection.kind = "folder of results";
  inspection.facts["has_report"] = fs::exists(folder / "report.html");
  inspection.facts["has_reproduce_script"] = fs::exists(folder / "reproduce.sh");
  for (const fs::path& file : files)
    inspection.items.push_back(inspect_path(file, options, communicator));
}

void inspect_anything(const fs::path& path,
                      const CtReadOptions& options,
                      const Communicator& communicator,
                      Inspection& inspection) {
  std::error_code error;
  if (fs::is_directory(path, error)) return inspect_folder(path, options, communicator, inspection);
  if (fs::is_regular_file(path, error))
    return inspect_file(path, options, communicator, inspection);
  const std::vector<std::string> rigs = builtin_rig_names();
  if (std::find(rigs.begin(), rigs.end(), path.string()) != rigs.end())
    return inspect_rig(path.string(), inspection);
  throw FileError(path.string(), fs::exists(path, error) ? "is no regular file" : "does not exist");
}

/// The name of a CT's file or folder without its endings: "ct" for ct.nii.gz.
std::string picture_stem(const fs::path& path) {
  const fs::path name = (path / "").parent_path().filename();
  const std::string text = name.string();
  return file_name_part(text.substr(0, text.find('.', 1)));
}

bool is_short_list(const ordered_json& json) {
  return json.is_array() && std::all_of(json.begin(), json.end(), [](const ordered_json& entry) {
           return entry.is_primitive() &&
                  (!entry.is_string() ||
                   entry.get_ref<const std::string&>().find('\n') == std::string::npos);
         });
}

std::string scalar_text(const ordered_json& json) {
  if (json.is_string()) return json.get<std::string>();
  if (json.is_number_float()) {
    std::ostringstream text;
    text.precision(8);
    text << json.get<double>();
    return text.str();
  }
  if (json.is_boolean()) return json.get<bool>() ? "yes" : "no";
  if (json.is_null()) return "none";
  return json.dump();
}

std::string indented(const std::string& text, const std::string& indent) {
  std::string result;
  for (const char c : text) {
    result += c;
    if (c == '\n') result += indent;
  }
  while (!result.empty() && (result.back() == ' ' || result.back() == '\n')) result.pop_back();
  return result;
}

void append_facts(const ordered_json& json, const std::string& indent, std::string& text);

void append_fact(const std::string& name,
                 const ordered_json& value,
                 const std::string& indent,
                 std::string& text) {
  if (is_short_list(value)) {
    text += indent + name + ": " + joined(value, ", ", scalar_text) + "\n";
  } else if (value.is_structured()) {
    text += indent + name + ":\n";
    append_facts(value, indent + "  ", text);
  } else {
    const std::string scalar = scalar_text(value);
    const bool has_lines = scalar.find('\n') != std::string::npos;
    text += indent + name + ":" + (has_lines ? "\n" + indent + "  " : " ") +
            indented(scalar, indent + "  ") + "\n";
  }
}

void append_facts(const ordered_json& json, const std::string& indent, std::string& text) {
  if (json.is_array()) {
    for (std::size_t i = 0; i < json.size(); ++i)
      append_fact(std::to_string(i + 1), json[i], indent, text);
    return;
  }
  for (const auto& [name, value] : json.items()) {
    std::string words = name;
    std::replace(words.begin(), words.end(), '_', ' ');
    append_fact(words, value, indent, text);
  }
}

std::string text_at(const Inspection& inspection, const std::string& indent) {
  std::string text = indent + inspection.path + ": " + inspection.kind +
                     (inspection.error.empty() ? "" : ", NOT USABLE") + "\n";
  if (!inspection.error.empty())
    text += indent + "  error: " + indented(inspection.error, indent + "  ") + "\n";
  append_facts(inspection.facts, indent + "  ", text);
  for (const std::string& warning : inspection.warnings)
    text.append(indent).append("  warning: ").append(warning).append("\n");
  for (const Inspection& item : inspection.items) text += text_at(item, indent + "  ");
  return text;
}

}  // namespace

Inspection inspect_path(const fs::path& path,
                        const CtReadOptions& options,
                        const Communicator& communicator) {
  Inspection inspection;
  inspection.path = path.string();
  try {
    inspect_anything(path, options, communicator, inspection);
  } catch (const Error& error) {
    inspection.error = error.what();
    inspection.exit_code = error.exit_code();
  } catch (const fs::filesystem_error& error) {
    inspection.error = error.what();
    inspection.exit_code = ExitCode::File;
  } catch (const std::bad_alloc&) {
    inspection.error = inspection.path + ": needs more memory than is available";
    inspection.exit_code = ExitCode::Input;
  }
  return inspection;
}

ExitCode worst_exit_code(const Inspection& inspection) {
  ExitCode worst = inspection.exit_code;
  for (const Inspection& item : inspection.items) worst = std::max(worst, worst_exit_code(item));
  return worst;
}

ordered_json to_json(const Inspection& inspection) {
  ordered_json json;
  json["path"] = inspection.path;
  json["kind"] = inspection.kind;
  json["ok"] = worst_exit_code(inspection) == ExitCode::Done;
  json["exit_code"] = static_cast<int>(worst_exit_code(inspection));
  if (!inspection.error.empty()) json["error"] = inspection.error;
  json["warnings"] = inspection.warnings;
  json["facts"] = inspection.facts;
  for (const Inspection& item : inspection.items) json["items"].push_back(to_json(item));
  return json;
}

std::string to_text(const Inspection& inspection) {
  return text_at(inspection, "");
}

DrawnPictures draw_pictures(const fs::path& study_or_ct,
                            const CtReadOptions& ct_reading,
                            const fs::path& folder) {
  DrawnPictures drawn;
  std::error_code error;
  const OutputLock lock = make_output_folder(folder);
  if (fs::is_directory(study_or_ct, error) || sniff_image_format(study_or_ct)) {
    const CtVolume ct = read_ct(study_or_ct, ct_reading);
    for (const fs::path& file : draw_ct_pictures(ct, {}, folder, picture_stem(study_or_ct)))
      drawn.text += file.string() + "\n";
    return drawn;
  }
  const Study study = read_study(study_or_ct);
  for (const StudyCase& study_case : study.cases) {
    const std::string stem = file_name_part(study_case.name);
    std::vector<std::string> warnings;
    const CtVolume ct = read_case_ct(study_case, &warnings);
    StudyPictures pictures = draw_study_pictures(
        study, study_case, ct.grid, cast_views(ct), kMostDetectorPixels, folder, stem);
    for (const fs::path& file :
         draw_ct_pictures(ct, {study_case.target_box_ct, study_case.landmarks_ct_mm}, folder, stem))
      pictures.files.push_back(file);
    drawn.text += "case " + study_case.name + "\n";
    for (const std::string& fact : pictures.facts) drawn.text += "  " + indented(fact, "  ") + "\n";
    for (const std::string& warning : warnings) drawn.text += "  warning: " + warning + "\n";
    for (const std::string& telltale : pictures.telltales)
      drawn.text += "  LOOK: " + telltale + "\n";
    for (const fs::path& file : pictures.files) drawn.text += "  " + file.string() + "\n";
    drawn.problems.insert(drawn.problems.end(), pictures.problems.begin(), pictures.problems.end());
  }
  return drawn;
}

std::string view_lines(const fs::path& study_path) {
  std::string lines;
  const Study study = read_study(study_path);
  for (const StudyCase& study_case : study.cases) {
    const std::string gold = gold_source(study, study_case);
    for (const StudyView& view : study_case.views)
      lines += study_case.name + '\t' + view.camera + '\t' + gold + '\n';
  }
  return lines;
}

std::string input_lines(const fs::path& study_path) {
  std::string lines;
  const Study study = read_study(study_path);
  for (const StudyCase& study_case : study.cases) {
    const auto add = [&](const fs::path& path) {
      lines += study_case.name + '\t' + path.string() + '\n';
    };
    add(study_case.ct);
    for (const fs::path& file : rig_files(study.rig_name_or_path)) add(file);
    for (const StudyView& view : study_case.views) {
      add(view.xray);
      for (const auto& path : {view.mask, view.reading.flat, view.reading.dark})
        if (path.has_value()) add(*path);
    }
  }
  return lines;
}

}  // namespace af
