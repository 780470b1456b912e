// SPDX-License-Identifier: Apache-2.0
#include "ct/ct_facts.h"

#include <optional>
#include <system_error>
#include <utility>

#include "base/build_id.h"
#include "base/number_text.h"
#include "base/stored_bytes.h"
#include "ct/ct_reader.h"
#include "ct/cut_faces.h"
#include "ct/dicom_series.h"
#include "files/input_guard.h"
#include "files/sha256.h"
#include "files/user_cache.h"
#include "images/dicom_elements.h"
#include "images/image_header.h"

namespace af {

namespace fs = std::filesystem;

namespace {

/// What is kept of a CT. Warnings name the path.
struct KeptFacts {
  CtFacts facts;
  std::vector<std::string> warnings;

  auto members() { return std::tie(facts, warnings); }
};

/// The names of the files that read_ct() looks at, each with the hash of its bytes and noted as an
/// input, or without a hash where it is skipped. None when the path is not a CT, which is left to
/// read_ct() to say.
std::optional<std::vector<std::string>> names_and_hashes(const fs::path& path) {
  std::vector<std::string> found;
  const auto add = [&](const fs::path& file, bool is_read) {
    found.push_back(file.string());
    if (is_read) note_input(file);
    found.push_back(is_read ? sha256_of_file(file.string()) : "");
  };
  if (std::error_code error; fs::is_directory(path, error)) {
    for (const fs::path& file : files_of(path))
      add(file, is_marked_dicom(file) || may_be_bare_dicom(file));
    return found;
  }
  const std::optional<ImageFormat> format = sniff_image_format(path);
  if (format != ImageFormat::MetaImage && format != ImageFormat::Nifti &&
      format != ImageFormat::Nrrd)
    return std::nullopt;
  add(path, true);
  if (const fs::path data_file = read_image_header(path, *format).data_file; data_file != path)
    add(data_file, true);
  return found;
}

/// The key under which the facts are kept: a hash of what they follow from. The program's build id
/// stands for all that decides what becomes of a file. There is no key where nothing is to be kept,
/// which includes one series among others, because all files would have to be hashed.
std::optional<std::string> key_of(const fs::path& path,
                                  const CtReadOptions& options,
                                  const AttenuationModel& model) {
  const std::string program = build_id();
  if (program.empty() || !options.series_uid.empty()) return std::nullopt;
  const auto files = names_and_hashes(path);
  if (!files) return std::nullopt;
  const std::vector<std::string> how = {"facts of a CT",
                                        program,
                                        path.string(),
                                        number_text(model.mu_water_per_mm),
                                        std::to_string(model.air_below_hu)};
  Sha256 hash;
  hash.update(bytes_of(how));
  hash.update(bytes_of(options));
  hash.update(bytes_of(*files));
  return hash.hex_digest();
}

std::string key_of_part(const std::string& key_of_facts, const CtBox& box_ct) {
  Sha256 hash;
  hash.update(bytes_of(key_of_facts));
  hash.update(bytes_of(box_ct));
  return hash.hex_digest();
}

}  // namespace

CtFacts facts_of(const CtVolume& ct, const AttenuationModel& model, const AttenuatingBox& box) {
  return {ct.grid, identity_of(ct), cut_points(ct, model, box)};
}

KnownCt read_known_ct(const fs::path& path,
                      const CtReadOptions& options,
                      const AttenuationModel& model,
                      const std::optional<CtBox>& box_ct,
                      std::vector<std::string>& warnings) {
  note_input(path);
  const std::optional<std::string> key = key_of(path, options, model);
  const std::string part_key = key && box_ct ? key_of_part(*key, *box_ct) : "";
  std::optional<KeptFacts> kept = key ? cached<KeptFacts>(*key) : std::nullopt;
  std::optional<VolumePart> part;
  if (!box_ct) part.emplace();
  if (kept && !part) part = cached<VolumePart>(part_key);
  if (!kept || !part) {
    kept.emplace();
    const CtVolume ct = read_ct(path, options, &kept->warnings);
    kept->facts = facts_of(ct, model, attenuating_box(ct, model));
    part = box_ct ? part_within(ct, model, *box_ct) : VolumePart();
    // The files may have been replaced meanwhile.
    if (key && key_of(path, options, model) == key) {
      keep_in_cache(*key, *kept);
      if (box_ct) keep_in_cache(part_key, *part);
    }
  }
  warnings.insert(warnings.end(), kept->warnings.begin(), kept->warnings.end());
  return {std::move(kept->facts), std::move(*part)};
}

CtFacts read_ct_facts(const fs::path& path,
                      const CtReadOptions& options,
                      const AttenuationModel& model,
                      std::vector<std::string>& warnings) {
  return read_known_ct(path, options, model, std::nullopt, warnings).facts;
}

}  // namespace af
