// SPDX-License-Identifier: Apache-2.0
#include "study/xray_reading.h"

#include <array>

#include "base/named_rows.h"
#include "base/toml_text.h"
#include "files/toml_reader.h"

namespace af {

namespace {

struct AirRow {
  const char* name;
  AirSource source;
};
constexpr std::array<AirRow, 3> kAirRows = {{{"percentile", AirSource::Percentile},
                                             {"open-beam", AirSource::OpenBeam},
                                             {"collimated-borders", AirSource::CollimatedBorders}}};

void read_air_level(TomlTableReader& reader, XrayReading& reading) {
  if (reader.has_number("air_level")) {
    reading.air = AirSource::Value;
    reading.air_level = reader.get_number("air_level", Presence::Required).value_or(1.0);
    if (!(reading.air_level > 0.0))
      reader.add_problem("air_level", "must be positive: the value of an unattenuated pixel");
    return;
  }
  const auto name = reader.get_string("air_level", Presence::Optional);
  if (!name) return;
  const AirRow* const row = find_row(kAirRows, *name);
  if (row != nullptr)
    reading.air = row->source;
  else
    reader.add_problem("air_level",
                       "must be a positive number or one of " + joined(names_of(kAirRows)));
}

void read_polarity(TomlTableReader& reader, XrayReading& reading) {
  const auto text = reader.get_string("xray_polarity", Presence::Optional);
  if (!text) return;
  if (*text == "as-stored")
    reading.polarity = XrayPolarity::AsStored;
  else if (*text == "inverted")
    reading.polarity = XrayPolarity::Inverted;
  else
    reader.add_problem("xray_polarity", "must be \"as-stored\" or \"inverted\"");
}

void read_spacing(TomlTableReader& reader, XrayReading& reading) {
  const auto text = reader.get_string("xray_spacing", Presence::Optional);
  if (!text) return;
  reading.ignores_spacing = *text == "ignore";
  if (*text != "ignore" && *text != "check")
    reader.add_problem("xray_spacing", "must be \"check\" or \"ignore\"");
}

void refuse_contradictions(TomlTableReader& reader, XrayDomain domain, const XrayReading& reading) {
  if (reading.flat && reading.air != AirSource::NotAsked)
    reader.add_problem("air_level",
                       "must not be given together with `flat`, which gives it for every pixel");
  if (reading.dark && reading.dark_level != 0.0)
    reader.add_problem("dark_level", "must not be given together with `dark`");
  if (domain == XrayDomain::Intensity) return;
  for (const char* key : {"air_level", "flat", "dark", "dark_level"})
    if (reader.has(key)) reader.add_problem(key, "is for xray_domain = \"intensity\" only");
}

}  // namespace

XrayReading read_xray_keys(TomlTableReader& reader,
                           XrayDomain domain,
                           const StudyPathReader& read_path) {
  XrayReading reading;
  reading.frame = reader.get_integer("xray_frame", Presence::Optional);
  if (reading.frame && *reading.frame < 1)
    reader.add_problem("xray_frame", "must be at least 1, the first frame");
  read_polarity(reader, reading);
  read_air_level(reader, reading);
  reading.flat = read_path("flat");
  reading.dark = read_path("dark");
  reading.dark_level = reader.get_number("dark_level", Presence::Optional).value_or(0.0);
  read_spacing(reader, reading);
  refuse_contradictions(reader, domain, reading);
  return reading;
}

std::string xray_keys_text(
    const XrayReading& reading,
    const std::function<std::string(const std::filesystem::path&)>& path_text) {
  std::string text;
  const auto add = [&](const char* key, const std::string& value) {
    text += std::string(key) + " = " + value + "\n";
  };
  if (reading.frame) add("xray_frame", std::to_string(*reading.frame));
  if (reading.polarity != XrayPolarity::ByHeader)
    add("xray_polarity",
        reading.polarity == XrayPolarity::AsStored ? "\"as-stored\"" : "\"inverted\"");
  if (reading.air == AirSource::Value) add("air_level", toml_number(reading.air_level));
  for (const AirRow& row : kAirRows)
    if (row.source == reading.air) add("air_level", toml_text(row.name));
  if (reading.flat) add("flat", toml_text(path_text(*reading.flat)));
  if (reading.dark) add("dark", toml_text(path_text(*reading.dark)));
  if (reading.dark_level != 0.0) add("dark_level", toml_number(reading.dark_level));
  if (reading.ignores_spacing) add("xray_spacing", "\"ignore\"");
  return text;
}

}  // namespace af
