// SPDX-License-Identifier: Apache-2.0
#include "field_file/field_layout.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/file_name.h"

namespace af::field_layout {

namespace {

constexpr std::uint64_t kMaxNameBytes = 4096;

/// Appends datasets of one field in a fixed order.
class DatasetList {
 public:
  template <typename T>
  void add(const DatasetRule& rule, std::span<const T> values) {
    Dataset dataset{rule, {}};
    const auto bytes = std::as_bytes(values);
    dataset.bytes.assign(bytes.begin(), bytes.end());
    if (rule.is_first_extent_free) {
      std::uint64_t inner = 1;
      for (std::size_t i = 1; i < rule.extents.size(); ++i) inner *= rule.extents[i];
      dataset.rule.extents[0] = values.size() / inner;
    }
    datasets_.push_back(std::move(dataset));
  }
  /// A text is never stored empty: HDF5 has no string type of length 0.
  void add(const DatasetRule& rule, const std::string& text) {
    const std::string stored = text.empty() ? std::string(1, '\0') : text;
    add(rule, std::span<const char>(stored));
  }
  std::vector<Dataset> take() { return std::move(datasets_); }

 private:
  std::vector<Dataset> datasets_;
};

template <typename Derived>
std::vector<double> values_of(const Eigen::MatrixBase<Derived>& matrix) {
  std::vector<double> values;
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    for (Eigen::Index column = 0; column < matrix.cols(); ++column)
      values.push_back(matrix(row, column));
  return values;
}

/// Reads datasets one after the other in the fixed order.
class DatasetReader {
 public:
  DatasetReader(std::span<const Dataset> datasets, std::string path)
      : datasets_(datasets), path_(std::move(path)) {}

  template <typename T>
  std::vector<T> next() {
    check(next_ < datasets_.size(), "a dataset per rule");
    const Dataset& dataset = datasets_[next_++];
    check(dataset.bytes.size() % sizeof(T) == 0, "bytes of whole elements");
    std::vector<T> values(dataset.bytes.size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), dataset.bytes.data(), dataset.bytes.size());
    if constexpr (std::is_floating_point_v<T>)
      for (const T value : values)
        if (std::isnan(value)) throw FileError(path_, dataset.rule.name, "numbers", "NaN");
    return values;
  }
  std::string next_text() {
    const std::vector<char> characters = next<char>();
    std::string text(characters.begin(), characters.end());
    while (!text.empty() && text.back() == '\0') text.pop_back();
    return text;
  }
  template <int kRows, int kColumns>
  Eigen::Matrix<double, kRows, kColumns> next_matrix() {
    const std::vector<double> values = next<double>();
    check(values.size() == static_cast<std::size_t>(kRows) * kColumns, "extents of the rule");
    Eigen::Matrix<double, kRows, kColumns> matrix;
    for (Eigen::Index i = 0; i < matrix.size(); ++i)
      matrix(i / kColumns, i % kColumns) = values[static_cast<std::size_t>(i)];
    if (!matrix.allFinite())
      throw FileError(path_, datasets_[next_ - 1].rule.name, "finite numbers", "infinity");
    return matrix;
  }

 private:
  std::span<const Dataset> datasets_;
  std::string path_;
  std::size_t next_ = 0;
};

void append_slab_rules(int slab, std::vector<DatasetRule>& rules) {
  const std::string group = "/geometry/slab_" + std::to_string(slab) + "/";
  rules.push_back({group + "st_plane_y_mm", ElementType::Float64, {1}, false, "mm", "slab"});
  rules.push_back({group + "y_range_mm", ElementType::Float64, {2}, false, "mm", "slab"});
  rules.push_back({group + "s_extent_mm", ElementType::Float64, {2}, false, "mm", "slab x"});
  rules.push_back({group + "t_extent_mm", ElementType::Float64, {2}, false, "mm", "slab z"});
  rules.push_back({group + "st_nodes", ElementType::Int32, {2}, false, "1", "lattice"});
  rules.push_back({group + "stored_range", ElementType::Int32, {4}, false, "node", "lattice"});
}

void append_identity_rules(std::vector<DatasetRule>& rules) {
  const auto add = [&](const char* name,
                       ElementType type,
                       std::vector<std::uint64_t> extents,
                       const char* units,
                       const char* frame) {
    rules.push_back({std::string("/identity/") + name,
                     type,
                     std::move(extents),
                     type == ElementType::Text,
                     units,
                     frame});
  };
  add("camera_name", ElementType::Text, {kMaxNameBytes}, "1", "none");
  add("source_point", ElementType::Float64, {3}, "mm", "room");
  add("detector_origin_point", ElementType::Float64, {3}, "mm", "room");
  add("column_direction", ElementType::Float64, {3}, "1", "room");
  add("row_direction", ElementType::Float64, {3}, "1", "room");
  add("pixel_spacing_mm", ElementType::Float64, {2}, "mm", "detector");
  add("size_px", ElementType::Int32, {2}, "px", "detector");
  add("nominal_rotation", ElementType::Float64, {3, 3}, "1", "room from ct");
  add("center_ct_mm", ElementType::Float64, {3}, "mm", "ct");
  add("center_room_mm", ElementType::Float64, {3}, "mm", "room");
  add("max_rotation_rad", ElementType::Float64, {1}, "rad", "room");
  add("max_translation_mm", ElementType::Float64, {1}, "mm", "room");
  add("ct_content_sha256", ElementType::Text, {64}, "1", "none");
  add("mu_water_per_mm", ElementType::Float64, {1}, "1/mm", "none");
  add("air_below_hu", ElementType::Int32, {1}, "HU", "none");
}

void add_geometry(const LightSlab& light_slab,
                  std::span<const DatasetRule> rules,
                  DatasetList& list) {
  std::size_t rule = 0;
  const auto add_doubles = [&](const std::vector<double>& values) {
    list.add(rules[rule++], std::span<const double>(values));
  };
  const auto add_ints = [&](const std::vector<std::int32_t>& values) {
    list.add(rules[rule++], std::span<const std::int32_t>(values));
  };
  add_ints({static_cast<std::int32_t>(light_slab.slabs.size())});
  add_doubles(values_of(light_slab.slab_from_ct.matrix()));
  add_doubles({light_slab.uv_plane_y_mm});
  add_doubles({light_slab.u.first_mm, light_slab.u.last_mm});
  add_doubles({light_slab.v.first_mm, light_slab.v.last_mm});
  add_ints({light_slab.u.nodes, light_slab.v.nodes});
  for (const SlabGeometry& slab : light_slab.slabs) {
    add_doubles({slab.st_plane_y_mm});
    add_doubles({slab.y_low_mm, slab.y_high_mm});
    add_doubles({slab.s.first_mm, slab.s.last_mm});
    add_doubles({slab.t.first_mm, slab.t.last_mm});
    add_ints({slab.s.nodes, slab.t.nodes});
    add_ints({slab.stored_s.begin, slab.stored_s.count, slab.stored_t.begin, slab.stored_t.count});
  }
}

void add_identity(const FieldIdentity& identity,
                  std::span<const DatasetRule> rules,
                  DatasetList& list) {
  std::size_t rule = 0;
  const auto add_doubles = [&](const std::vector<double>& values) {
    list.add(rules[rule++], std::span<const double>(values));
  };
  const auto add_ints = [&](const std::vector<std::int32_t>& values) {
    list.add(rules[rule++], std::span<const std::int32_t>(values));
  };
  const CameraGeometry& camera = identity.camera;
  list.add(rules[rule++], camera.name);
  add_doubles(values_of(camera.source_point));
  add_doubles(values_of(camera.detector_origin_point));
  add_doubles(values_of(camera.column_direction));
  add_doubles(values_of(camera.row_direction));
  add_doubles(values_of(camera.pixel_spacing_mm));
  add_ints({camera.size_px.x(), camera.size_px.y()});
  add_doubles(values_of(identity.frame.rotation));
  add_doubles(values_of(identity.frame.center_ct_mm));
  add_doubles(values_of(identity.frame.center_room_mm));
  add_doubles({identity.range.max_rotation_rad});
  add_doubles({identity.range.max_translation_mm});
  list.add(rules[rule++], identity.ct_content_sha256);
  add_doubles({identity.mu_water_per_mm});
  add_ints({identity.air_below_hu});
}

GridAxis axis_of(const std::vector<double>& extent, std::int32_t nodes) {
  return {extent[0], extent[1], nodes};
}

LightSlab read_geometry(int slab_count, DatasetReader& reader) {
  LightSlab light_slab;
  light_slab.slab_from_ct.matrix() = reader.next_matrix<4, 4>();
  light_slab.uv_plane_y_mm = reader.next_matrix<1, 1>()(0);
  const auto u_extent = reader.next<double>();
  const auto v_extent = reader.next<double>();
  const auto uv_nodes = reader.next<std::int32_t>();
  light_slab.u = axis_of(u_extent, uv_nodes[0]);
  light_slab.v = axis_of(v_extent, uv_nodes[1]);
  for (int k = 0; k < slab_count; ++k) {
    SlabGeometry slab;
    slab.st_plane_y_mm = reader.next_matrix<1, 1>()(0);
    const auto y_range = reader.next<double>();
    slab.y_low_mm = y_range[0];
    slab.y_high_mm = y_range[1];
    const auto s_extent = reader.next<double>();
    const auto t_extent = reader.next<double>();
    const auto st_nodes = reader.next<std::int32_t>();
    slab.s = axis_of(s_extent, st_nodes[0]);
    slab.t = axis_of(t_extent, st_nodes[1]);
    const auto stored = reader.next<std::int32_t>();
    slab.stored_s = {stored[0], stored[1]};
    slab.stored_t = {stored[2], stored[3]};
    light_slab.slabs.push_back(slab);
  }
  return light_slab;
}

FieldIdentity read_identity(DatasetReader& reader) {
  FieldIdentity identity;
  CameraGeometry& camera = identity.camera;
  camera.name = reader.next_text();
  camera.source_point = reader.next_matrix<3, 1>();
  camera.detector_origin_point = reader.next_matrix<3, 1>();
  camera.column_direction = reader.next_matrix<3, 1>();
  camera.row_direction = reader.next_matrix<3, 1>();
  camera.pixel_spacing_mm = reader.next_matrix<2, 1>();
  const auto size_px = reader.next<std::int32_t>();
  camera.size_px = {size_px[0], size_px[1]};
  identity.frame.rotation = reader.next_matrix<3, 3>();
  identity.frame.center_ct_mm = reader.next_matrix<3, 1>();
  identity.frame.center_room_mm = reader.next_matrix<3, 1>();
  identity.range.max_rotation_rad = reader.next_matrix<1, 1>()(0);
  identity.range.max_translation_mm = reader.next_matrix<1, 1>()(0);
  identity.ct_content_sha256 = reader.next_text();
  identity.mu_water_per_mm = reader.next_matrix<1, 1>()(0);
  identity.air_below_hu = reader.next<std::int32_t>()[0];
  return identity;
}

void append_axis_problems(const std::string& name,
                          const GridAxis& axis,
                          std::vector<std::string>& found) {
  if (axis.nodes < 2 || axis.nodes > kMaxNodes)
    found.push_back(name + " nodes = " + std::to_string(axis.nodes) +
                    ": must be within 2 and 65536");
  if (!(std::isfinite(axis.first_mm) && std::isfinite(axis.last_mm) &&
        axis.last_mm > axis.first_mm))
    found.push_back(name + " extent: must be finite and ascending");
}

void append_range_problems(const std::string& name,
                           const NodeRange& range,
                           const GridAxis& axis,
                           std::vector<std::string>& found) {
  if (range.begin < 0 || range.count < 1 || range.begin > axis.nodes ||
      range.count > axis.nodes - range.begin || range.begin % 2 != 0)
    found.push_back(name + " stored range: must be an even-aligned part of the lattice");
}

/// What must hold before the indices can even be looked for.
std::vector<std::string> header_problems(const CompressedAttenuationField& field) {
  std::vector<std::string> found = problems(field.codebook);
  const auto append = [&](const std::vector<std::string>& more) {
    found.insert(found.end(), more.begin(), more.end());
  };
  append(problems(field.identity.camera));
  append(problems(field.identity.range));
  if (!is_plain_file_name(field.identity.camera.name))
    found.emplace_back("camera_name: must be usable in a file name");
  append(rigidity_problems(field.light_slab.slab_from_ct.matrix()));
  append(rigidity_problems(field.identity.frame.nominal_room_from_ct().matrix()));
  append_axis_problems("u", field.light_slab.u, found);
  append_axis_problems("v", field.light_slab.v, found);
  for (std::size_t k = 0; k < field.light_slab.slabs.size(); ++k) {
    const SlabGeometry& slab = field.light_slab.slabs[k];
    const std::string name = "slab " + std::to_string(k);
    append_axis_problems(name + " s", slab.s, found);
    append_axis_problems(name + " t", slab.t, found);
    append_range_problems(name + " s", slab.stored_s, slab.s, found);
    append_range_problems(name + " t", slab.stored_t, slab.t, found);
    if (!(slab.st_plane_y_mm < field.light_slab.uv_plane_y_mm))
      found.push_back(name + " st_plane_y_mm: must lie below the (u,v) plane");
  }
  if (!(field.quantizer_step > 0.0f && std::isfinite(field.quantizer_step)))
    found.emplace_back("quantizer_step: must be positive and finite");
  if (!(field.identity.mu_water_per_mm > 0.0))
    found.emplace_back("mu_water_per_mm: must be positive");
  return found;
}

nlohmann::json to_json(const Dataset& dataset) {
  const auto* first = reinterpret_cast<const std::uint8_t*>(dataset.bytes.data());
  return {{"name", dataset.rule.name},
          {"type", static_cast<int>(dataset.rule.type)},
          {"extents", dataset.rule.extents},
          {"bytes", nlohmann::json::binary({first, first + dataset.bytes.size()})}};
}

}  // namespace

std::size_t element_bytes(ElementType type) {
  switch (type) {
    case ElementType::Float64:
      return 8;
    case ElementType::Float32:
    case ElementType::Int32:
      return 4;
    case ElementType::UInt16:
      return 2;
    case ElementType::Text:
      break;
  }
  return 1;
}

const char* to_string(ElementType type) {
  switch (type) {
    case ElementType::Float64:
      return "float64";
    case ElementType::Float32:
      return "float32";
    case ElementType::Int32:
      return "int32";
    case ElementType::UInt16:
      return "uint16";
    case ElementType::Text:
      break;
  }
  return "text";
}

DatasetRule slab_count_rule() {
  return {"/geometry/slab_count", ElementType::Int32, {1}, false, "1", "none"};
}

std::vector<DatasetRule> payload_rules(int slab_count) {
  std::vector<DatasetRule> rules = {
      slab_count_rule(),
      {"/geometry/slab_from_ct", ElementType::Float64, {4, 4}, false, "mm", "slab from ct"},
      {"/geometry/uv_plane_y_mm", ElementType::Float64, {1}, false, "mm", "slab"},
      {"/geometry/u_extent_mm", ElementType::Float64, {2}, false, "mm", "slab x"},
      {"/geometry/v_extent_mm", ElementType::Float64, {2}, false, "mm", "slab z"},
      {"/geometry/uv_nodes", ElementType::Int32, {2}, false, "1", "lattice"}};
  for (int k = 0; k < slab_count; ++k) append_slab_rules(k, rules);
  append_identity_rules(rules);
  rules.push_back(
      {"/codebook/quantizer_step", ElementType::Float32, {1}, false, "1 per level", "none"});
  rules.push_back({"/codebook/codewords",
                   ElementType::UInt16,
                   {kMaxCodewords, kTileElements},
                   true,
                   "level",
                   "tile (u, v, s, t)"});
  return rules;
}

DatasetRule index_rule(const CompressedAttenuationField& field, std::size_t slab) {
  const SlabGeometry& geometry = field.light_slab.slabs[slab];
  return {"/field/slab_" + std::to_string(slab),
          ElementType::UInt16,
          {static_cast<std::uint64_t>(field.tiles_u()),
           static_cast<std::uint64_t>(field.tiles_v()),
           static_cast<std::uint64_t>(geometry.stored_s.tiles()),
           static_cast<std::uint64_t>(geometry.stored_t.tiles())},
          false,
          "codeword",
          "tiles (u, v, s, t)"};
}

std::vector<DatasetRule> index_rules(const CompressedAttenuationField& field) {
  std::vector<DatasetRule> rules;
  for (std::size_t k = 0; k < field.light_slab.slabs.size(); ++k)
    rules.push_back(index_rule(field, k));
  return rules;
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

std::vector<Dataset> datasets_of(const CompressedAttenuationField& field) {
  const auto slab_count = static_cast<int>(field.light_slab.slabs.size());
  const std::vector<DatasetRule> rules = payload_rules(slab_count);
  const std::span<const DatasetRule> all(rules);
  const std::size_t geometry_rules = 6 + 6 * field.light_slab.slabs.size();
  DatasetList list;
  add_geometry(field.light_slab, all.first(geometry_rules), list);
  add_identity(field.identity, all.subspan(geometry_rules), list);
  list.add(rules[rules.size() - 2], std::span<const float>(&field.quantizer_step, 1));
  const Tile* first = field.codebook.codewords.data();
  list.add(rules.back(),
           std::span<const std::uint16_t>(first->data(), field.codebook.size() * kTileElements));
  return list.take();
}

std::vector<Dataset> datasets_of(const FieldProvenance& provenance) {
  const auto rules = provenance_rules();
  DatasetList list;
  list.add(rules[0], provenance.source_version);
  list.add(rules[1], provenance.command_line);
  list.add(rules[2], provenance.options_toml);
  list.add(rules[3], provenance.provenance_json);
  return list.take();
}

CompressedAttenuationField field_of(std::span<const Dataset> datasets, const std::string& path) {
  DatasetReader reader(datasets, path);
  const int slab_count = reader.next<std::int32_t>()[0];
  CompressedAttenuationField field;
  field.light_slab = read_geometry(slab_count, reader);
  field.identity = read_identity(reader);
  field.quantizer_step = reader.next<float>()[0];
  const auto levels = reader.next<std::uint16_t>();
  field.codebook.codewords.resize(levels.size() / kTileElements);
  if (!levels.empty())
    std::memcpy(field.codebook.codewords.data(), levels.data(), levels.size() * 2);
  const auto found = header_problems(field);
  if (!found.empty()) throw FileError(path, found.front());
  return field;
}

FieldProvenance provenance_of(std::span<const Dataset> datasets) {
  DatasetReader reader(datasets, "");
  FieldProvenance provenance;
  provenance.source_version = reader.next_text();
  provenance.command_line = reader.next_text();
  provenance.options_toml = reader.next_text();
  provenance.provenance_json = reader.next_text();
  return provenance;
}

int slab_count_of(const Dataset& dataset, const std::string& path) {
  const int count = DatasetReader({&dataset, 1}, path).next<std::int32_t>()[0];
  if (count < 1 || count > kMaxSlabs)
    throw FileError(path, dataset.rule.name, "1 ... 64", std::to_string(count));
  return count;
}

std::string payload_line(const DatasetRule& rule, const std::string& sha256) {
  std::string line = rule.name + " " + to_string(rule.type);
  for (const std::uint64_t extent : rule.extents) line += " " + std::to_string(extent);
  return line + " " + sha256 + "\n";
}

std::vector<std::byte> packed(std::span<const Dataset> datasets) {
  nlohmann::json list = nlohmann::json::array();
  for (const Dataset& dataset : datasets) list.push_back(to_json(dataset));
  const auto cbor = nlohmann::json::to_cbor(list);
  const auto bytes = std::as_bytes(std::span(cbor));
  return {bytes.begin(), bytes.end()};
}

std::vector<Dataset> unpacked(std::span<const std::byte> bytes) {
  const auto* first = reinterpret_cast<const std::uint8_t*>(bytes.data());
  std::vector<Dataset> datasets;
  for (const auto& item : nlohmann::json::from_cbor(first, first + bytes.size())) {
    Dataset dataset;
    dataset.rule.name = item.at("name");
    dataset.rule.type = static_cast<ElementType>(item.at("type").get<int>());
    dataset.rule.extents = item.at("extents").get<std::vector<std::uint64_t>>();
    const auto content = std::as_bytes(std::span(item.at("bytes").get_binary()));
    dataset.bytes.assign(content.begin(), content.end());
    datasets.push_back(std::move(dataset));
  }
  return datasets;
}

std::uint64_t payload_bytes(const CompressedAttenuationField& field) {
  std::uint64_t bytes = field.codebook.size() * sizeof(Tile);
  for (std::size_t k = 0; k < field.light_slab.slabs.size(); ++k)
    bytes += field.tile_count(k) * sizeof(std::uint16_t);
  return bytes;
}

}  // namespace af::field_layout
