// SPDX-License-Identifier: Apache-2.0
#include "precompute/field_planes.h"

#include "geometry/slab_sizing.h"
#include "precompute/formatted_text.h"

namespace af {

namespace {

std::string axis_text(const char* name, const GridAxis& first, const GridAxis& second) {
  return formatted("  %s plane        %.1f x %.1f mm, %d x %d nodes, %.2f x %.2f mm apart\n",
                   name,
                   first.last_mm - first.first_mm,
                   second.last_mm - second.first_mm,
                   first.nodes,
                   second.nodes,
                   first.spacing_mm(),
                   second.spacing_mm());
}

}  // namespace

LightSlab sized_planes(const FieldSource& source,
                       const PrecomputeOptions& options,
                       const MotionRange& range,
                       const DepthSlabs& depth_slabs) {
  const FieldDesign design = options.design();
  return make_light_slab(source.camera,
                         source.frame,
                         range,
                         source.volume->corner_points(),
                         {design.uv_nodes,
                          design.st_nodes,
                          depth_slabs.boundaries_y_mm,
                          depth_slabs.st_plane_y_mm,
                          source.sources},
                         source.more_cameras);
}

std::string planes_text(const LightSlab& planes) {
  std::string text = axis_text("(u,v)", planes.u, planes.v);
  for (const SlabGeometry& slab : planes.slabs) {
    text += axis_text("(s,t)", slab.s, slab.t);
    text += formatted("  stored part        s nodes %d to %d, t nodes %d to %d (%.0f %%)\n",
                      slab.stored_s.begin,
                      slab.stored_s.end() - 1,
                      slab.stored_t.begin,
                      slab.stored_t.end() - 1,
                      100.0 * slab.stored_s.count * slab.stored_t.count /
                          (static_cast<double>(slab.s.nodes) * slab.t.nodes));
  }
  return text;
}

std::string advice_text(const FieldSource& source,
                        const LightSlab& planes,
                        const PrecomputeOptions& options) {
  const SlabGeometry& slab = planes.slabs.front();
  const FieldLattice lattice = planes.lattice();
  std::string text = formatted(
      "Advice\n  Your range uses %.0f %% of the (s,t) plane; the rest holds no shadow of the CT "
      "and costs nothing.\n",
      100.0 * static_cast<double>(lattice.stored_node_count()) /
          static_cast<double>(lattice.node_count()));
  const MotionRange narrower(source.range.max_rotation_rad(),
                             0.5 * source.range.max_translation_mm());
  if (source.range.is_symmetric() && narrower.max_translation_mm() >= 5.0) {
    // The spacing that half the range would give with the same nodes.
    const LightSlab alternative =
        sized_planes(source, options, narrower, {{}, {slab.st_plane_y_mm}});
    text += formatted(
        "  With --max-translation-mm %.0f the same nodes would stand %.2f instead of %.2f mm apart "
        "on the (s,t) plane: sharper DRRs for the same size.\n",
        narrower.max_translation_mm(),
        alternative.slabs.front().s.spacing_mm(),
        slab.s.spacing_mm());
  }
  const double pixel_mm = source.camera.pixel_spacing_mm.minCoeff() *
                          source.camera.depth_mm(source.frame.center_room_mm) /
                          source.camera.source_detector_distance_mm();
  if (slab.s.spacing_mm() > 2.0 * pixel_mm)
    text += formatted(
        "  A pixel of %s is %.2f mm wide at the centre, the (s,t) nodes are %.2f mm apart: more "
        "--st-nodes buy more than more --uv-nodes.\n",
        source.camera.name.c_str(),
        pixel_mm,
        slab.s.spacing_mm());
  return text;
}

}  // namespace af
