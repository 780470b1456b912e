// SPDX-License-Identifier: Apache-2.0
#include "field/field_layout.h"

#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "base/file_name.h"
#include "field/field_writing.h"
#include "files/sha256.h"

namespace af::field_layout {

namespace {

constexpr std::uint64_t kMaxNameBytes = 4096;
constexpr const char* kBoneText = "bone";

DatasetRule step_rule() {
  return {"/codebook/quantizer_step", ElementType::Float32, {1}, false, "1 per level", "none"};
}

DatasetRule codewords_rule() {
  return {"/codebook/codewords",
          ElementType::UInt16,
          {kMaxCodewords, kTileElements},
          true,
          "level",
          "tile (u, v, s, t)"};
}

DatasetRule mean_step_rule() {
  return {kMeanStepDataset, ElementType::Int32, {1}, false, "level", "none"};
}

DatasetRule tile_filter_rule() {
  return {kTileFilterDataset,
          ElementType::Float32,
          {kTileElements, kFilterInputs},
          false,
          "1",
          "Hadamard coefficient of a tile, input"};
}

/// Rules of the codebook's datasets, in the order of the payload hash.
std::vector<DatasetRule> codebook_rules(const CodebookParts& parts) {
  std::vector<DatasetRule> rules = {step_rule(), codewords_rule()};
  if (parts.has_means) rules.push_back(mean_step_rule());
  if (parts.has_filter) rules.push_back(tile_filter_rule());
  return rules;
}

/// The values of a field's geometry, which must have as many slabs as the file.
StoredValues stored_values(LightSlab& planes) {
  StoredValues values("/geometry/");
  values.matrix("slab_from_ct", planes.slab_from_ct.matrix(), "mm", "slab from ct");
  values.numbers("uv_plane_y_mm", {&planes.uv_plane_y_mm}, "mm", "slab");
  values.numbers("u_extent_mm", {&planes.u.first_mm, &planes.u.last_mm}, "mm", "slab x");
  values.numbers("v_extent_mm", {&planes.v.first_mm, &planes.v.last_mm}, "mm", "slab z");
  values.numbers("uv_nodes", {&planes.u.nodes, &planes.v.nodes}, "1", "lattice");
  for (std::size_t k = 0; k < planes.slabs.size(); ++k) {
    SlabGeometry& slab = planes.slabs[k];
    NodeRange& s = slab.stored_s;
    NodeRange& t = slab.stored_t;
    values.start_group("/geometry/slab_" + std::to_string(k) + "/");
    values.numbers("st_plane_y_mm", {&slab.st_plane_y_mm}, "mm", "slab");
    // The last slab ends where all attenuation does.
    double& high = k + 1 < planes.slabs.size() ? slab.y_high_mm : planes.attenuation_end_y_mm;
    values.numbers("y_range_mm", {&slab.y_low_mm, &high}, "mm", "slab").may_be_infinite = true;
    values.numbers("s_extent_mm", {&slab.s.first_mm, &slab.s.last_mm}, "mm", "slab x");
    values.numbers("t_extent_mm", {&slab.t.first_mm, &slab.t.last_mm}, "mm", "slab z");
    values.numbers("st_nodes", {&slab.s.nodes, &slab.t.nodes}, "1", "lattice");
    values.numbers("stored_range", {&s.begin, &s.count, &t.begin, &t.count}, "node", "lattice");
  }
  return values;
}

/// An identity as files hold it. Two numbers state the motion range. For a range that two numbers
/// cannot state (range_rules()), they state the largest part that they can.
struct StoredIdentity {
  FieldIdentity identity;
  double max_rotation_rad = 0.0;
  double max_translation_mm = 0.0;

  StoredIdentity() = default;
  explicit StoredIdentity(const FieldIdentity& whole) : identity(whole) {
    const MotionRange part = whole.range.symmetric_part();
    max_rotation_rad = part.max_rotation_rad();
    max_translation_mm = part.max_translation_mm();
  }
};

StoredValues stored_values(StoredIdentity& stored) {
  FieldIdentity& identity = stored.identity;
  CameraGeometry& camera = identity.camera;
  StoredValues values("/identity/");
  values.text("camera_name", camera.name, kMaxNameBytes);
  values.matrix("source_point", camera.source_point, "mm", "room");
  values.matrix("detector_origin_point", camera.detector_origin_point, "mm", "room");
  values.matrix("column_direction", camera.column_direction, "1", "room");
  values.matrix("row_direction", camera.row_direction, "1", "room");
  values.matrix("pixel_spacing_mm", camera.pixel_spacing_mm, "mm", "detector");
  values.matrix("size_px", camera.size_px, "px", "detector");
  values.matrix("nominal_rotation", identity.frame.rotation, "1", "room from ct");
  values.matrix("center_ct_mm", identity.frame.center_ct_mm, "mm", "ct");
  values.matrix("center_room_mm", identity.frame.center_room_mm, "mm", "room");
  values.numbers("max_rotation_rad", {&stored.max_rotation_rad}, "rad", "room");
  values.numbers("max_translation_mm", {&stored.max_translation_mm}, "mm", "room");
  CtGrid& ct = identity.ct.grid;
  values.text("ct_content_sha256", identity.ct.content_sha256, kSha256Digits);
  values.numbers("ct_size_voxels", {&ct.size[0], &ct.size[1], &ct.size[2]}, "1", "ct");
  values.matrix("ct_origin_mm", ct.origin_mm, "mm", "ct");
  values.matrix("ct_spacing_mm", ct.spacing_mm, "mm", "ct");
  values.matrix("ct_direction", ct.direction, "1", "ct");
  values.numbers("mu_water_per_mm", {&identity.mu_water_per_mm}, "1/mm", "none");
  values.numbers("air_below_hu", {&identity.air_below_hu}, "HU", "none");
  return values;
}

/// The bounds of a range that two numbers cannot state.
StoredValues stored_values(MotionRange& range) {
  StoredValues values("/range/");
  values.matrix("low_rad", range.low.rotation_rad, "rad", "room");
  values.matrix("high_rad", range.high.rotation_rad, "rad", "room");
  values.matrix("low_mm", range.low.translation_mm, "mm", "room");
  values.matrix("high_mm", range.high.translation_mm, "mm", "room");
  return values;
}

template <typename Struct>
void append_datasets(Struct described, std::vector<Dataset>& datasets) {
  append_datasets(stored_values(described), datasets);
}

/// What must hold before the indices can even be looked for. Without planes, when there are none.
std::vector<std::string> header_problems(const FieldIdentity& identity,
                                         const Codebook& codebook,
                                         float quantizer_step,
                                         const LightSlab* light_slab) {
  std::vector<std::string> found = problems(codebook);
  const auto append = [&](const std::vector<std::string>& more) {
    found.insert(found.end(), more.begin(), more.end());
  };
  append(problems(identity.camera));
  append(problems(identity.range));
  if (!is_plain_file_name(identity.camera.name))
    found.emplace_back("camera_name: must be usable in a file name");
  append(rigidity_problems(identity.frame.nominal_room_from_ct().matrix()));
  if (light_slab != nullptr) append(problems(*light_slab));
  if (!(quantizer_step > 0.0f && std::isfinite(quantizer_step)))
    found.emplace_back("quantizer_step: must be positive and finite");
  if (!(identity.mu_water_per_mm > 0.0)) found.emplace_back("mu_water_per_mm: must be positive");
  return found;
}

/// Sets the identity from the first datasets, and returns the others.
std::span<const Dataset> set_identity(std::span<const Dataset> datasets,
                                      const std::string& path,
                                      FieldIdentity& identity) {
  StoredIdentity stored;
  datasets = set_values(stored_values(stored), datasets, path);
  identity = stored.identity;
  identity.range = {stored.max_rotation_rad, stored.max_translation_mm};
  return datasets;
}

/// Sets the codebook from the datasets of shared_rules().
void set_codebook(std::span<const Dataset> datasets,
                  const std::string& path,
                  float& quantizer_step,
                  Codebook& codebook) {
  check(datasets.size() >= shared_rules({}), "a dataset per rule");
  for (const Dataset& more : datasets.subspan(shared_rules({}))) {
    if (more.rule.name == kMeanStepDataset) {
      codebook.mean_step = values_of<std::int32_t>(more, path).at(0);
      if (!codebook.has_means())
        throw FileError(path, more.rule.name, "at least 1", std::to_string(codebook.mean_step));
    } else {
      check(more.rule.name == kTileFilterDataset, "a rule of a codebook");
      const auto weights = values_of<float>(more, path);
      check(weights.size() == kTileElements * kFilterInputs, "a weight of every input");
      codebook.filter.emplace();
      std::memcpy(&codebook.filter->weights, weights.data(), weights.size() * sizeof(float));
    }
  }
  quantizer_step = values_of<float>(datasets[0], path)[0];
  const auto levels = values_of<std::uint16_t>(datasets[1], path);
  codebook.codewords.resize(levels.size() / kTileElements);
  if (!levels.empty()) std::memcpy(codebook.codewords.data(), levels.data(), levels.size() * 2);
}

void append_codebook(float quantizer_step,
                     const Codebook& codebook,
                     std::vector<Dataset>& datasets) {
  datasets.push_back(dataset_of<float>(step_rule(), std::span(&quantizer_step, 1)));
  const Tile* first = codebook.codewords.data();
  datasets.push_back(dataset_of<std::uint16_t>(
      codewords_rule(), std::span(first->data(), codebook.size() * kTileElements)));
  const std::int32_t mean_step = codebook.mean_step;
  if (codebook.has_means())
    datasets.push_back(dataset_of<std::int32_t>(mean_step_rule(), std::span(&mean_step, 1)));
  if (codebook.filter)
    datasets.push_back(dataset_of<float>(
        tile_filter_rule(),
        std::span(codebook.filter->weights.front().data(), kTileElements * kFilterInputs)));
}

int count_within(const Dataset& dataset, int most, const std::string& path) {
  const int count = values_of<std::int32_t>(dataset, path).at(0);
  if (count < 1 || count > most)
    throw FileError(
        path, dataset.rule.name, "1 ... " + std::to_string(most), std::to_string(count));
  return count;
}

/// One line per dataset that takes part in the payload hash.
std::string payload_line(const DatasetRule& rule, const std::string& sha256) {
  std::string line = rule.name + " " + to_string(rule.type);
  for (const std::uint64_t extent : rule.extents) line += " " + std::to_string(extent);
  return line + " " + sha256 + "\n";
}

}  // namespace

CodebookParts parts_of(const Codebook& codebook) {
  return {codebook.has_means(), codebook.filter.has_value()};
}

DatasetRule slab_count_rule() {
  return {"/geometry/slab_count", ElementType::Int32, {1}, false, "1", "none"};
}

std::vector<DatasetRule> member_rules(int slab_count) {
  LightSlab light_slab;
  light_slab.slabs.resize(static_cast<std::size_t>(slab_count));
  StoredIdentity identity;
  std::vector<DatasetRule> rules = {slab_count_rule()};
  append_rules(stored_values(light_slab), rules);
  append_rules(stored_values(identity), rules);
  return rules;
}

std::vector<DatasetRule> payload_rules(int slab_count, const CodebookParts& parts) {
  std::vector<DatasetRule> rules = member_rules(slab_count);
  for (DatasetRule& rule : codebook_rules(parts)) rules.push_back(std::move(rule));
  return rules;
}

DatasetRule index_rule(const FieldLattice& lattice, std::size_t slab, bool has_means) {
  const std::array<int, 4> tiles = lattice.slabs[slab].tile_counts();
  DatasetRule rule{"/field/slab_" + std::to_string(slab),
                   ElementType::UInt16,
                   {tiles.begin(), tiles.end()},
                   false,
                   "codeword",
                   "tiles (u, v, s, t)"};
  if (!has_means) return rule;
  rule.extents[2] *= 2;
  rule.units = "codeword, mean level";
  rule.frame = "tiles (u, v, s, t); along s a row of codewords, then that of the means";
  rule.rows_per_tile = 2;
  return rule;
}

std::vector<DatasetRule> index_rules(const FieldLattice& lattice, bool has_means) {
  std::vector<DatasetRule> rules;
  for (std::size_t k = 0; k < lattice.slabs.size(); ++k)
    rules.push_back(index_rule(lattice, k, has_means));
  return rules;
}

std::vector<DatasetRule> index_rules(const CompressedAttenuationField& field) {
  return index_rules(field.lattice(), field.codebook.has_means());
}

DatasetRule codewords_rule(const DatasetRule& tiles) {
  DatasetRule rule = tiles;
  rule.name += "/codewords";
  rule.extents[2] /= tiles.rows_per_tile;
  rule.units = "codeword";
  rule.frame = "tiles (u, v, s, t)";
  rule.rows_per_tile = 1;
  return rule;
}

DatasetRule means_rule(const DatasetRule& tiles) {
  DatasetRule rule = codewords_rule(tiles);
  rule.name = tiles.name + "/means";
  std::swap(rule.extents[2], rule.extents[3]);
  rule.units = "level";
  rule.frame = "tiles (u, v, t, s); along t differences, but every " +
               std::to_string(kMeanRunTiles) + "th the level itself";
  return rule;
}

DatasetRule material_rule() {
  constexpr std::uint64_t kMostBytes = 64;
  return {"/material", ElementType::Text, {kMostBytes}, true, "1", "none"};
}

std::vector<Dataset> material_datasets(FieldMaterial material) {
  if (material == FieldMaterial::All) return {};
  return {text_dataset(material_rule(), kBoneText)};
}

FieldMaterial material_of(const Dataset& dataset, const std::string& path) {
  const std::string text = text_of(dataset);
  if (text != kBoneText) throw FileError(path, dataset.rule.name, kBoneText, text);
  return FieldMaterial::Bone;
}

std::vector<DatasetRule> provenance_rules() {
  std::vector<DatasetRule> rules;
  for (const char* name : {"source_version", "command_line", "options_toml", "provenance_json"})
    rules.push_back({std::string("/provenance/") + name,
                     ElementType::Text,
                     {kMaxTextBytes},
                     true,
                     "1",
                     "none"});
  return rules;
}

std::string member_group(std::size_t member) {
  return "/member_" + std::to_string(member);
}

std::vector<DatasetRule> within(const std::string& group, std::vector<DatasetRule> rules) {
  for (DatasetRule& rule : rules) rule.name.insert(0, group);
  return rules;
}

std::vector<Dataset> within(const std::string& group, std::vector<Dataset> datasets) {
  for (Dataset& dataset : datasets) dataset.rule.name.insert(0, group);
  return datasets;
}

DatasetRule member_count_rule() {
  return {"/member_count", ElementType::Int32, {1}, false, "1", "none"};
}

std::vector<DatasetRule> atlas_rules(const CodebookParts& parts) {
  StoredIdentity identity;
  std::vector<DatasetRule> rules = {member_count_rule()};
  append_rules(stored_values(identity), rules);
  for (DatasetRule& rule : codebook_rules(parts)) rules.push_back(std::move(rule));
  return rules;
}

std::vector<DatasetRule> index_rules(const AttenuationAtlas& atlas) {
  std::vector<DatasetRule> rules;
  for (std::size_t i = 0; i < atlas.members.size(); ++i)
    for (DatasetRule& rule :
         within(member_group(i),
                index_rules(atlas.members[i].light_slab.lattice(), atlas.codebook.has_means())))
      rules.push_back(std::move(rule));
  return rules;
}

std::vector<Dataset> datasets_of(const AttenuationAtlas& atlas) {
  const auto count = static_cast<std::int32_t>(atlas.members.size());
  std::vector<Dataset> datasets = {
      dataset_of<std::int32_t>(member_count_rule(), std::span(&count, 1))};
  append_datasets(StoredIdentity(atlas.identity), datasets);
  append_codebook(atlas.quantizer_step, atlas.codebook, datasets);
  return datasets;
}

std::vector<Dataset> datasets_of(const AtlasMember& member) {
  std::vector<Dataset> datasets = geometry_datasets(member.light_slab);
  append_datasets(StoredIdentity(member.identity), datasets);
  return datasets;
}

int member_count_of(const Dataset& dataset, const std::string& path) {
  return count_within(dataset, kMaxMembers, path);
}

AttenuationAtlas atlas_of(std::span<const Dataset> datasets, const std::string& path) {
  AttenuationAtlas atlas;
  datasets = set_identity(datasets.subspan(1), path, atlas.identity);
  set_codebook(datasets, path, atlas.quantizer_step, atlas.codebook);
  const auto found = header_problems(atlas.identity, atlas.codebook, atlas.quantizer_step, nullptr);
  if (!found.empty()) throw FileError(path, found.front());
  return atlas;
}

std::vector<Dataset> geometry_datasets(const LightSlab& light_slab) {
  const auto slab_count = static_cast<std::int32_t>(light_slab.slabs.size());
  std::vector<Dataset> datasets = {
      dataset_of<std::int32_t>(slab_count_rule(), std::span(&slab_count, 1))};
  append_datasets(light_slab, datasets);
  return datasets;
}

std::vector<Dataset> datasets_of(const CompressedAttenuationField& field) {
  std::vector<Dataset> datasets = datasets_of(AtlasMember{field.identity, field.light_slab});
  append_codebook(field.quantizer_step, field.codebook, datasets);
  return datasets;
}

std::vector<DatasetRule> range_rules() {
  MotionRange range;
  std::vector<DatasetRule> rules;
  append_rules(stored_values(range), rules);
  return rules;
}

std::vector<Dataset> range_datasets(const MotionRange& range) {
  std::vector<Dataset> datasets;
  if (!range.is_symmetric()) append_datasets(range, datasets);
  return datasets;
}

MotionRange range_of(std::span<const Dataset> datasets,
                     const MotionRange& stated,
                     const std::string& path) {
  MotionRange range;
  set_values(stored_values(range), datasets, path);
  const std::vector<std::string> found = problems(range);
  if (!found.empty()) throw FileError(path, "/range: " + found.front());
  const MotionRange part = range.symmetric_part();
  if (part.max_rotation_rad() != stated.max_rotation_rad() ||
      part.max_translation_mm() != stated.max_translation_mm())
    throw FileError(path, "/range", "a range around " + stated.text(), range.text());
  return range;
}

std::vector<Dataset> datasets_of(const FieldProvenance& provenance) {
  const auto rules = provenance_rules();
  std::vector<Dataset> datasets;
  for (const std::string* text : {&provenance.source_version,
                                  &provenance.command_line,
                                  &provenance.options_toml,
                                  &provenance.provenance_json})
    datasets.push_back(text_dataset(rules[datasets.size()], *text));
  return datasets;
}

std::span<const Dataset> set_geometry(std::span<const Dataset> datasets,
                                      const std::string& path,
                                      LightSlab& light_slab) {
  const int slab_count = slab_count_of(datasets.front(), path);
  light_slab.slabs.assign(static_cast<std::size_t>(slab_count), {});
  return set_values(stored_values(light_slab), datasets.subspan(1), path);
}

CompressedAttenuationField field_of(std::span<const Dataset> datasets, const std::string& path) {
  CompressedAttenuationField field;
  datasets = set_geometry(datasets, path, field.light_slab);
  datasets = set_identity(datasets, path, field.identity);
  set_codebook(datasets, path, field.quantizer_step, field.codebook);
  const auto found =
      header_problems(field.identity, field.codebook, field.quantizer_step, &field.light_slab);
  if (!found.empty()) throw FileError(path, found.front());
  return field;
}

FieldProvenance provenance_of(std::span<const Dataset> datasets) {
  check(datasets.size() == 4, "a dataset per rule");
  return {text_of(datasets[0]), text_of(datasets[1]), text_of(datasets[2]), text_of(datasets[3])};
}

int slab_count_of(const Dataset& dataset, const std::string& path) {
  return count_within(dataset, kMaxSlabs, path);
}

std::string payload_hash(std::span<const Dataset> datasets,
                         const std::vector<DatasetRule>& rules,
                         const std::vector<std::string>& index_sha256) {
  std::string lines;
  for (const Dataset& dataset : datasets)
    lines += payload_line(dataset.rule, sha256_hex(dataset.bytes));
  for (std::size_t k = 0; k < rules.size(); ++k) lines += payload_line(rules[k], index_sha256[k]);
  return sha256_hex(std::as_bytes(std::span(lines)));
}

std::uint64_t payload_bytes(const Codebook& codebook, const FieldLattice& lattice) {
  return codebook.size() * sizeof(Tile) + static_cast<std::uint64_t>(lattice.tile_count()) *
                                              codebook.values_per_tile() * sizeof(std::uint16_t);
}

}  // namespace af::field_layout
