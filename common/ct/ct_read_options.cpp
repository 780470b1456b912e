// SPDX-License-Identifier: Apache-2.0
#include "ct/ct_read_options.h"

#include <cmath>
#include <set>

#include "base/joined.h"
#include "base/number_text.h"
#include "base/parsed_number.h"

namespace af {

std::optional<std::pair<double, double>> label_of(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) return std::nullopt;
  const auto label = finite_number(text.substr(0, equals));
  const auto hu = finite_number(text.substr(equals + 1));
  if (!label || !hu || *label != std::round(*label) || std::abs(*hu) > 32767.0) return std::nullopt;
  return std::pair{*label, *hu};
}

void CtReadOptions::describe(Fields& field) {
  field("series", series_uid, "DICOM series UID, when the CT's folder has several").input();
  field("resample", resamples, "Accept a CT of a tilted gantry or of uneven slices, by resampling");
  field("values",
        values,
        "What voxels hold: hu; mu: attenuation per mm; raw: numbers that --raw-slope-per-mm and "
        "--raw-offset-per-mm scale; labels: see --label-hu")
      .choice({"hu", "mu", "raw", "labels"});
  field("raw_slope_per_mm", raw_slope_per_mm, "With --values raw: attenuation per unit, 1/mm")
      .finite();
  field("raw_offset_per_mm", raw_offset_per_mm, "With --values raw: attenuation of 0, 1/mm")
      .finite();
  field("values_water_mu_per_mm",
        values_water_mu_per_mm,
        "With --values mu or raw: the attenuation that becomes 0 HU, 1/mm")
      .above(0.0)
      .at_most(1.0);
  field("label_hu",
        label_hu,
        "With --values labels: HU of a label, such as 3=700; may be repeated; other labels are air")
      .one_at_a_time();
  field("body_only",
        keeps_body_only,
        "Replace everything but the body (table, head holder, cables) with air");
}

void describe_beside_ct(Fields& field, CtReadOptions& options) {
  field.part(options);
  for (const Field& part : fields_of(options)) field.at(part.name).needs({"--ct"});
}

std::vector<std::string> problems(const CtReadOptions& options) {
  std::vector<std::string> found = field_problems(options);
  if ((options.values == "raw") != (options.raw_slope_per_mm != 0.0))
    found.push_back("raw_slope_per_mm = " + number_text(options.raw_slope_per_mm) +
                    ": must be given with values = raw, and with nothing else");
  if (options.values != "raw" && options.raw_offset_per_mm != 0.0)
    found.push_back("raw_offset_per_mm = " + number_text(options.raw_offset_per_mm) +
                    ": is for values = raw");
  if ((options.values == "labels") == options.label_hu.empty())
    found.push_back("label_hu = " + (options.label_hu.empty() ? "none" : joined(options.label_hu)) +
                    ": must be given with values = labels, and must not be given otherwise");
  for (const std::string& text : options.label_hu)
    if (!label_of(text))
      found.push_back("label_hu = " + text + ": must be LABEL=HU, such as 3=700");
  std::set<double> labels;
  for (const std::string& text : options.label_hu)
    if (const auto label = label_of(text); label && !labels.insert(label->first).second)
      found.push_back("label_hu = " + text + ": its label has a value already");
  return found;
}

std::string CtReadOptions::text() const {
  std::vector<std::string> parts;
  if (resamples) parts.emplace_back("resampled if tilted or uneven");
  const std::string water = " (0 HU is " + number_text(values_water_mu_per_mm) + " per mm)";
  if (values == "mu") parts.push_back("values are mu per mm" + water);
  if (values == "raw")
    parts.push_back("mu = " + number_text(raw_slope_per_mm) + " * value + " +
                    number_text(raw_offset_per_mm) + " per mm" + water);
  if (values == "labels") parts.push_back("labels " + joined(label_hu) + " HU");
  if (keeps_body_only) parts.emplace_back("body only");
  return joined(parts, "; ");
}

}  // namespace af
