// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"
#include "drr/opened_field.h"
#include "files/json_text.h"
#include "geometry/ray_coverage.h"
#include "ranks/input_identity.h"
#include "tools/inspect/inspect_kinds.h"

namespace af {

using nlohmann::ordered_json;

namespace {

constexpr double kBytesPerMegabyte = 1e6;
constexpr std::uint64_t kBytesPerSample = 2;  ///< attenuation is quantised to 16 bits

ordered_json camera_json(const CameraGeometry& camera) {
  ordered_json json;
  json["name"] = camera.name;
  json["source_point_mm"] = vector_json(camera.source_point);
  json["source_detector_distance_mm"] = camera.source_detector_distance_mm();
  json["size_px"] = {camera.size_px.x(), camera.size_px.y()};
  json["pixel_spacing_mm"] = vector_json(camera.pixel_spacing_mm);
  return json;
}

ordered_json plane_json(const GridAxis& first, const GridAxis& second) {
  return {{"size_mm", {first.last_mm - first.first_mm, second.last_mm - second.first_mm}},
          {"nodes", {first.nodes, second.nodes}},
          {"node_spacing_mm", {first.spacing_mm(), second.spacing_mm()}}};
}

ordered_json slab_json(const SlabGeometry& slab) {
  ordered_json json;
  json["st_plane_y_mm"] = slab.st_plane_y_mm;
  json["st_plane"] = plane_json(slab.s, slab.t);
  json["stored_nodes"] = {slab.stored_s.count, slab.stored_t.count};
  json["stored_from_node"] = {slab.stored_s.begin, slab.stored_t.begin};
  return json;
}

ordered_json sizes_json(const FieldLattice& lattice, const FieldFileInfo& info) {
  const auto whole = kBytesPerSample * static_cast<std::uint64_t>(lattice.node_count());
  const auto cropped = kBytesPerSample * static_cast<std::uint64_t>(lattice.stored_node_count());
  const auto ratio = [](std::uint64_t raw, std::uint64_t stored) {
    return static_cast<double>(raw) / static_cast<double>(stored);
  };
  ordered_json json;
  json["uncompressed_mb"] = static_cast<double>(whole) / kBytesPerMegabyte;
  json["uncompressed_stored_part_mb"] = static_cast<double>(cropped) / kBytesPerMegabyte;
  json["payload_mb"] = static_cast<double>(info.payload_bytes) / kBytesPerMegabyte;
  json["file_mb"] = static_cast<double>(info.file_bytes) / kBytesPerMegabyte;
  json["payload_compression_ratio"] = ratio(whole, info.payload_bytes);
  json["file_compression_ratio"] = ratio(whole, info.file_bytes);
  json["payload_compression_ratio_of_stored_part"] = ratio(cropped, info.payload_bytes);
  json["file_compression_ratio_of_stored_part"] = ratio(cropped, info.file_bytes);
  return json;
}

ordered_json provenance_json(const FieldProvenance& provenance) {
  ordered_json json;
  json["source_version"] = provenance.source_version;
  json["command_line"] = provenance.command_line;
  json["options_toml"] = provenance.options_toml;
  ordered_json details;
  try {
    details = ordered_json_of_text(provenance.provenance_json, "provenance");
  } catch (const FileError&) {  // it is shown as it is
  }
  if (!details.is_object()) {
    json["details"] = provenance.provenance_json;
    return json;
  }
  // These have been printed above.
  details.erase("command_line");
  details.erase("options_toml");
  // A summary needs how the training ended, not each step.
  if (details.contains("training") && details["training"].is_object()) {
    ordered_json& training = details["training"];
    const ordered_json steps = training.value("iterations", ordered_json::array());
    if (steps.is_array() && !steps.empty()) {
      training["iterations"] = steps.size();
      training["last_iteration"] = steps.back();
    }
  }
  json["details"] = details;
  return json;
}

/// Adds the camera, the poses and the CT.
void describe_identity(const FieldIdentity& identity, ordered_json& facts) {
  facts["camera"] = camera_json(identity.camera);
  facts["center_ct_mm"] = vector_json(identity.frame.center_ct_mm);
  facts["center_room_mm"] = vector_json(identity.frame.center_room_mm);
  const MotionRange within = identity.range.symmetric_part();
  facts["max_rotation_deg"] = within.max_rotation_rad() * kDegPerRad;
  facts["max_translation_mm"] = within.max_translation_mm();
  if (!identity.range.is_symmetric()) facts["range"] = identity.range.text();
  facts["ct_content_sha256"] = identity.ct.content_sha256;
  facts["ct_grid"] = to_json(identity.ct.grid);
  facts["mu_water_per_mm"] = identity.mu_water_per_mm;
  facts["air_below_hu"] = identity.air_below_hu;
}

void describe_planes(const LightSlab& light_slab, ordered_json& facts) {
  facts["uv_plane_y_mm"] = light_slab.uv_plane_y_mm;
  facts["uv_plane"] = plane_json(light_slab.u, light_slab.v);
  for (const SlabGeometry& slab : light_slab.slabs) facts["slabs"].push_back(slab_json(slab));
}

/// What a file's fields cover of a camera's rays, about the nominal pose.
std::string coverage_of(const OpenedField& opened, const CameraGeometry& camera) {
  const FieldIdentity& identity = opened.identity();
  const View view = View::whole_detector(camera);
  const auto rays = static_cast<std::int64_t>(view.pixel_count());
  const std::int64_t outside =
      opened.coverage().rays_outside(identity.frame.nominal_room_from_ct(), view);
  return coverage_text(camera.name,
                       rays - outside,
                       rays,
                       opened.coverage().box(view, identity.frame, identity.range));
}

/// The members have the same counts of nodes, and almost the same planes.
ordered_json members_json(const OpenedField& opened) {
  ordered_json members;
  for (const AtlasMember& member : opened.atlas()->members) {
    const CameraGeometry& camera = member.identity.camera;
    std::int64_t stored = 0;
    for (const SlabLattice& slab : member.light_slab.lattice().slabs)
      stored += slab.stored_node_count();
    members.push_back({{"camera", camera.name},
                       {"source_point_mm", vector_json(camera.source_point)},
                       {"own_range", member.identity.range.text()},
                       {"stored_nodes", stored},
                       {"field_coverage", coverage_of(opened, camera)}});
  }
  return members;
}

/// Reads every index, member by member, which verifies it.
void verify_members(const OpenedField& opened, const Communicator& communicator) {
  for (std::size_t i = 0; i < opened.coverage().planes.size(); ++i)
    (void)opened.member(i, communicator);
}

}  // namespace

void inspect_field(const std::filesystem::path& path,
                   const Communicator& communicator,
                   Inspection& inspection) {
  const OpenedField opened(path, communicator, OpenedField::Materials::Any);
  const FieldFileInfo& info = opened.info();
  const AttenuationAtlas* const atlas = opened.atlas().get();
  if (atlas != nullptr) verify_members(opened, communicator);
  inspection.kind = atlas != nullptr ? "atlas" : "field";
  ordered_json& facts = inspection.facts;
  facts["checksums"] = "verified";
  facts["payload_sha256"] = info.payload_sha256;
  facts["material"] = opened.identity().material == FieldMaterial::Bone ? "bone" : "all";
  describe_identity(opened.identity(), facts);
  if (atlas != nullptr) {
    facts["field_coverage"] = coverage_of(opened, opened.identity().camera);
    facts["members"] = members_json(opened);
    describe_planes(atlas->members.front().light_slab, facts["planes_of_first_member"]);
  } else {
    describe_planes(opened.field()->light_slab, facts);
  }
  facts["codewords"] = opened.codewords();
  const Codebook& codebook = atlas != nullptr ? atlas->codebook : opened.field()->codebook;
  const int mean_step = codebook.mean_step;
  facts["tile_coding"] = mean_step > 0 ? "mean-removed" : "plain";
  if (mean_step > 0) facts["mean_step_levels"] = mean_step;
  facts["tile_filter"] = codebook.filter ? "neighbours" : "none";
  facts["quantizer_step"] =
      atlas != nullptr ? atlas->quantizer_step : opened.field()->quantizer_step;
  facts["look_up"] = info.look_up;
  facts["sizes"] =
      sizes_json(atlas != nullptr ? atlas->lattice() : opened.field()->lattice(), info);
  facts["provenance"] = provenance_json(info.provenance);
}

}  // namespace af
