// SPDX-License-Identifier: Apache-2.0
// Parameterisations of all rays of a C-arm's orbit, compared at equal numbers of stored samples:
// an atlas of planes whose members hold poses, one whose members hold sources, and viewpoints on a
// cylinder. Only interpolation over viewpoints counts: rays are cast exactly, through their own
// (s,t) points, and nothing is quantised.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include <CLI/CLI.hpp>

#include "base/hash_random.h"
#include "benchmark/benchmark_case.h"
#include "benchmark/viewpoint_cylinder.h"
#include "cli/app_main.h"
#include "ct/ct_reader.h"
#include "ct/ray_caster.h"
#include "geometry/motion_range.h"
#include "study/rig_file.h"
#include "xray/psnr.h"

namespace {

using namespace af;
using namespace af::benchmark;

struct StudyOptions {
  std::string ct;
  std::string rig = "c-arm-12in";
  std::string camera = "AP";
  int slabs = 4;
  double slab_mm = 0.0;      ///< thickness, alike in all frames; 0: where they suit the CT best
  double uv_step_mm = 22.0;  ///< of the atlas; others get as many samples
  double st_step_mm = 0.9;
  int poses = 20;     ///< at each angle
  int pairs = 40000;  ///< of neighbouring samples
  int pixels = 24;    ///< of a DRR, along each side
  std::string output;
};

/// What attenuates at each depth of a frame, counted in coarse slices: enough to cut it into slabs.
DepthSlabs depth_slabs_of(const AttenuationVolume& volume,
                          const RigidTransform& slab_from_ct,
                          int slabs) {
  constexpr int kStride = 3;  // voxels
  SlabAlignedGrid slices;
  slices.spacing_mm = {1.0, 2.0, 1.0};
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Eigen::Vector3d& corner : volume.corner_points()) {
    low = std::min(low, (slab_from_ct * corner).y());
    high = std::max(high, (slab_from_ct * corner).y());
  }
  slices.origin_mm = {0.0, low, 0.0};
  std::vector<std::int64_t> sums(static_cast<std::size_t>((high - low) / slices.spacing_mm.y()) +
                                 2);
  const CtGrid& grid = volume.grid();
  std::size_t voxel = 0;
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i, ++voxel) {
        if (i % kStride != 0 || j % kStride != 0 || k % kStride != 0) continue;
        const double y = (slab_from_ct * grid.point_mm(Eigen::Vector3d(i, j, k))).y();
        sums[static_cast<std::size_t>((y - low) / slices.spacing_mm.y() + 0.5)] +=
            volume.voxels()[voxel];
      }
  slices.size = {1, static_cast<int>(sums.size()), 1};
  return choose_depth_slabs(slices, sums, slabs, StPlane::Centroid);
}

/// Slabs of equal thickness about the centre, alike in all frames; the outer ones are open.
DepthSlabs equal_slabs(int slabs, double thickness_mm) {
  DepthSlabs equal;
  for (int k = 0; k < slabs; ++k) {
    equal.st_plane_y_mm.push_back((k + 0.5 - 0.5 * slabs) * thickness_mm);
    if (k > 0) equal.boundaries_y_mm.push_back((k - 0.5 * slabs) * thickness_mm);
  }
  return equal;
}

/// What a viewpoint (slab frame) sees of one slab through a point of its (s,t) plane.
double seen_of_slab(const Eigen::Vector3d& viewpoint,
                    const LightSlab& planes,
                    const SlabGeometry& slab,
                    const Eigen::Vector3d& at_st,
                    const RayCaster& caster) {
  const RigidTransform ct_from_slab = planes.slab_from_ct.inverse();
  const double away = planes.uv_plane_y_mm - slab.st_plane_y_mm;
  RayFan fan;
  fan.source_point = ct_from_slab * viewpoint;
  fan.first_point = ct_from_slab * at_st;
  fan.column_step = fan.row_step = Eigen::Vector3d::Zero();
  fan.columns = fan.rows = 1;
  fan.begin = (planes.uv_plane_y_mm - slab.y_high_mm) / away;
  fan.end = (planes.uv_plane_y_mm - slab.y_low_mm) / away;
  std::array<float, 1> value{};
  caster.cast(fan, value);
  return static_cast<double>(value[0]);
}

/// The value of a ray (slab frame) as the viewpoint sees it: of each slab, the ray through the same
/// (s,t) point.
double seen_from(const Eigen::Vector3d& viewpoint,
                 const LightSlab& planes,
                 const Ray& ray,
                 const RayCaster& caster) {
  double sum = 0.0;
  for (const SlabGeometry& slab : planes.slabs) {
    const Eigen::Vector3d at_st = ray.origin_point + (slab.st_plane_y_mm - ray.origin_point.y()) /
                                                         ray.direction.y() * ray.direction;
    sum += seen_of_slab(viewpoint, planes, slab, at_st, caster);
  }
  return sum;
}

/// The index of a random element.
template <typename Value>
std::size_t any_index(const std::vector<Value>& values, HashRandom& random) {
  return std::min(values.size() - 1,
                  static_cast<std::size_t>(random.uniform() * static_cast<double>(values.size())));
}

double any_between(const GridAxis& axis, const NodeRange& stored, HashRandom& random) {
  return axis.position_mm(stored.begin) + random.uniform() * (stored.count - 1) * axis.spacing_mm();
}

/// A random point of a slab's stored (s,t) nodes.
Eigen::Vector3d any_st_point(const SlabGeometry& slab, HashRandom& random) {
  const double s = any_between(slab.s, slab.stored_s, random);
  return {s, slab.st_plane_y_mm, any_between(slab.t, slab.stored_t, random)};
}

/// Where a ray meets the (u,v) plane.
Eigen::Vector3d at_uv(const LightSlab& planes, const Ray& ray) {
  return ray.origin_point +
         (planes.uv_plane_y_mm - ray.origin_point.y()) / ray.direction.y() * ray.direction;
}

Ray in_slab(const LightSlab& planes, const Ray& ray_ct) {
  return {planes.slab_from_ct * ray_ct.origin_point,
          planes.slab_from_ct.linear() * ray_ct.direction};
}

/// The two nodes around a position and the upper one's weight.
struct Between {
  double lower_mm = 0.0;
  double upper_mm = 0.0;
  double weight = 0.0;
};

Between nodes_around(const GridAxis& axis, double position_mm) {
  const double node =
      std::clamp(std::floor(axis.node_coordinate(position_mm)), 0.0, axis.nodes - 2.0);
  const int lower = static_cast<int>(node);
  return {axis.position_mm(lower),
          axis.position_mm(lower + 1),
          axis.node_coordinate(position_mm) - lower};
}

int nodes_at(double first_mm, double last_mm, double step_mm) {
  return std::max(2, static_cast<int>(std::lround((last_mm - first_mm) / step_mm)) + 1);
}

/// (s,t) nodes that one viewpoint stores.
double st_samples(const LightSlab& planes, double st_step_mm) {
  double samples = 0.0;
  for (const SlabGeometry& slab : planes.slabs)
    samples += slab.stored_s.count * slab.s.spacing_mm() * slab.stored_t.count *
               slab.t.spacing_mm() / (st_step_mm * st_step_mm);
  return samples;
}

/// One way of parameterising the orbit's rays, at any distance of viewpoints.
class Contender {
 public:
  Contender() = default;
  Contender(const Contender&) = delete;
  Contender& operator=(const Contender&) = delete;
  virtual ~Contender() = default;

  [[nodiscard]] virtual std::string name() const = 0;
  virtual void set_viewpoints(double step_mm) = 0;
  [[nodiscard]] virtual double samples(double st_step_mm) const = 0;
  [[nodiscard]] virtual int viewpoints() const = 0;
  /// How much a sample differs from that of the next viewpoint along the orbit, at a random (s,t)
  /// node of a random slab. A tile of two viewpoints has to code this.
  [[nodiscard]] virtual double difference_along_orbit(HashRandom& random,
                                                      const RayCaster& caster) const = 0;
  /// Of a DRR's rays (ct frame).
  [[nodiscard]] virtual std::vector<float> drr(std::span<const Ray> rays,
                                               const RayCaster& caster) const = 0;
};

class Atlas final : public Contender {
 public:
  Atlas(const OrbitScene& scene, double step_deg, Orbit::MembersBy members_by)
      : is_by_source_(members_by == Orbit::MembersBy::Source) {
    Orbit orbit = scene.orbit;
    orbit.step_rad = step_deg * kRadPerDeg;
    orbit.members_by = members_by;
    for (const OrbitMember& member :
         orbit_members(scene.camera, scene.isocenter_point, scene.frame, scene.range, orbit))
      members_.push_back(planes_of(scene, member));
  }

  [[nodiscard]] std::string name() const override {
    return "planes by " + std::string(is_by_source_ ? "source" : "pose") + ", " +
           std::to_string(members_.size()) + " members";
  }
  void set_viewpoints(double step_mm) override {
    for (LightSlab& member : members_) {
      member.u.nodes = nodes_at(member.u.first_mm, member.u.last_mm, step_mm);
      member.v.nodes = nodes_at(member.v.first_mm, member.v.last_mm, step_mm);
    }
  }
  [[nodiscard]] double samples(double st_step_mm) const override {
    double sum = 0.0;
    for (const LightSlab& member : members_)
      sum += 1.0 * member.u.nodes * member.v.nodes * st_samples(member, st_step_mm);
    return sum;
  }
  [[nodiscard]] int viewpoints() const override {
    int sum = 0;
    for (const LightSlab& member : members_) sum += member.u.nodes * member.v.nodes;
    return sum;
  }
  [[nodiscard]] std::vector<float> drr(std::span<const Ray> rays,
                                       const RayCaster& caster) const override {
    const LightSlab& planes = member_of(rays);
    std::vector<float> values;
    for (const Ray& ray_ct : rays) {
      const Ray ray = in_slab(planes, ray_ct);
      const Eigen::Vector3d hit = at_uv(planes, ray);
      const Between u = nodes_around(planes.u, hit.x());
      const Between v = nodes_around(planes.v, hit.z());
      double value = 0.0;
      for (const auto& [x, x_weight] :
           {std::pair{u.lower_mm, 1.0 - u.weight}, {u.upper_mm, u.weight}})
        for (const auto& [z, z_weight] :
             {std::pair{v.lower_mm, 1.0 - v.weight}, {v.upper_mm, v.weight}})
          value +=
              x_weight * z_weight * seen_from({x, planes.uv_plane_y_mm, z}, planes, ray, caster);
      values.push_back(static_cast<float>(value));
    }
    return values;
  }

  [[nodiscard]] double difference_along_orbit(HashRandom& random,
                                              const RayCaster& caster) const override {
    const LightSlab& planes = members_[any_index(members_, random)];
    const SlabGeometry& slab = planes.slabs[any_index(planes.slabs, random)];
    const Eigen::Vector3d at_st = any_st_point(slab, random);
    const double u = random.uniform(planes.u.first_mm, planes.u.last_mm - planes.u.spacing_mm());
    const double v = random.uniform(planes.v.first_mm, planes.v.last_mm);
    const auto seen = [&](double x) {
      return seen_of_slab({x, planes.uv_plane_y_mm, v}, planes, slab, at_st, caster);
    };
    return seen(u + planes.u.spacing_mm()) - seen(u);
  }

 private:
  /// The member from whose edges along u the rays keep farthest.
  [[nodiscard]] const LightSlab& member_of(std::span<const Ray> rays) const {
    const LightSlab* best = nullptr;
    double best_kept = -std::numeric_limits<double>::infinity();
    for (const LightSlab& member : members_) {
      double kept = std::numeric_limits<double>::infinity();
      for (const Ray& ray_ct : rays) {
        const Ray ray = in_slab(member, ray_ct);
        if (!(ray.direction.y() < 0.0)) {
          kept = -std::numeric_limits<double>::infinity();
          break;
        }
        const double u = at_uv(member, ray).x();
        kept = std::min({kept, u - member.u.first_mm, member.u.last_mm - u});
      }
      if (kept <= best_kept) continue;
      best_kept = kept;
      best = &member;
    }
    check(best != nullptr && best_kept >= 0.0, "a member holds the rays of every pose");
    return *best;
  }

  bool is_by_source_;
  std::vector<LightSlab> members_;
};

class Cylinder final : public Contender {
 public:
  explicit Cylinder(const OrbitScene& scene) : scene_(scene) {}

  [[nodiscard]] std::string name() const override {
    return "cylinder, " + std::to_string(columns_->columns().size()) + " columns";
  }
  void set_viewpoints(double step_mm) override {
    const double radius = (scene_.camera.source_point - scene_.isocenter_point).norm();
    columns_.emplace(scene_, step_mm / radius);
    v_.clear();
    for (const LightSlab& column : columns_->columns())
      v_.push_back({column.v.first_mm,
                    column.v.last_mm,
                    nodes_at(column.v.first_mm, column.v.last_mm, step_mm)});
  }
  [[nodiscard]] double samples(double st_step_mm) const override {
    double sum = 0.0;
    for (std::size_t i = 0; i < v_.size(); ++i)
      sum += v_[i].nodes * st_samples(columns_->columns()[i], st_step_mm);
    return sum;
  }
  [[nodiscard]] int viewpoints() const override {
    int sum = 0;
    for (const GridAxis& v : v_) sum += v.nodes;
    return sum;
  }
  [[nodiscard]] std::vector<float> drr(std::span<const Ray> rays,
                                       const RayCaster& caster) const override {
    std::vector<float> values;
    for (const Ray& ray_ct : rays) {
      const auto place = columns_->columns_of(ray_ct);
      check(place.has_value(), "columns hold the rays of every pose");
      const double value = (1.0 - place->weight) * seen_by(place->lower, ray_ct, caster) +
                           place->weight * seen_by(place->lower + 1, ray_ct, caster);
      values.push_back(static_cast<float>(value));
    }
    return values;
  }

  /// The next column's nodes are counted so that what stands in the middle of a slab's (s,t) plane
  /// has the same s in both.
  [[nodiscard]] double difference_along_orbit(HashRandom& random,
                                              const RayCaster& caster) const override {
    const std::vector<LightSlab>& columns = columns_->columns();
    const std::size_t i = std::min(any_index(columns, random), columns.size() - 2);
    const std::size_t k = any_index(columns[i].slabs, random);
    const Eigen::Vector3d at_st = any_st_point(columns[i].slabs[k], random);
    const double v = random.uniform(v_[i].first_mm, v_[i].last_mm);
    const auto seen = [&](std::size_t column, const Eigen::Vector3d& at) {
      const LightSlab& planes = columns[column];
      const double x = columns_->viewpoint_x_mm(static_cast<int>(column));
      return seen_of_slab({x, planes.uv_plane_y_mm, v}, planes, planes.slabs[k], at, caster);
    };
    const Eigen::Vector3d middle(0.0, at_st.y(), 0.0);
    const Eigen::Vector3d moved =
        columns[i + 1].slab_from_ct * (columns[i].slab_from_ct.inverse() * middle);
    const Eigen::Vector3d at_next(
        at_st.x() + moved.x(), columns[i + 1].slabs[k].st_plane_y_mm, at_st.z());
    return seen(i + 1, at_next) - seen(i, at_st);
  }

 private:
  [[nodiscard]] double seen_by(int column, const Ray& ray_ct, const RayCaster& caster) const {
    const auto i = static_cast<std::size_t>(column);
    const LightSlab& planes = columns_->columns()[i];
    const Ray ray = in_slab(planes, ray_ct);
    const Between v = nodes_around(v_[i], at_uv(planes, ray).z());
    const auto from = [&](double z) {
      return seen_from(
          {columns_->viewpoint_x_mm(column), planes.uv_plane_y_mm, z}, planes, ray, caster);
    };
    return (1.0 - v.weight) * from(v.lower_mm) + v.weight * from(v.upper_mm);
  }

  const OrbitScene& scene_;
  std::optional<ViewpointCylinder> columns_;
  std::vector<GridAxis> v_;
};

/// Brings a contender to about this many samples, and returns the distance between its viewpoints.
double spend(Contender& contender, double samples, double st_step_mm) {
  double low = 5.0;
  double high = 100.0;
  constexpr int kHalvings = 7;
  for (int i = 0; i < kHalvings; ++i) {
    const double step = std::sqrt(low * high);
    contender.set_viewpoints(step);
    (contender.samples(st_step_mm) > samples ? low : high) = step;
  }
  contender.set_viewpoints(high);
  return high;
}

/// The rays of a coarse DRR (ct frame) at random pose `index` of the range.
std::vector<Ray> random_rays(const OrbitScene& scene,
                             double angle_rad,
                             std::uint64_t index,
                             int pixels) {
  HashRandom random(71, index);
  const RigidTransform ct_from_room =
      pose_from_parameters(scene.frame, random_pose(scene.range, random)).inverse();
  const CameraGeometry camera =
      turned_camera(scene.camera, scene.isocenter_point, scene.orbit.direction(), angle_rad);
  const Eigen::Vector3d source = ct_from_room * camera.source_point;
  std::vector<Ray> rays;
  for (int row = 0; row < pixels; ++row)
    for (int column = 0; column < pixels; ++column) {
      const Eigen::Vector3d through =
          camera.detector_point((column + 0.5) * camera.size_px.x() / pixels - 0.5,
                                (row + 0.5) * camera.size_px.y() / pixels - 0.5);
      rays.push_back({source, ct_from_room * through - source});
    }
  return rays;
}

double rms_along_orbit(const Contender& contender, const RayCaster& caster, int pairs) {
  double squares = 0.0;
  for (int i = 0; i < pairs; ++i) {
    HashRandom random(73, static_cast<std::uint64_t>(i));
    const double difference = contender.difference_along_orbit(random, caster);
    squares += difference * difference;
  }
  return std::sqrt(squares / pairs);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0.0 : values[values.size() / 2];
}

constexpr std::array kAnglesDeg = {0.0, 45.0, 81.0};

/// Median PSNR at each angle.
std::vector<double> psnr_db(const Contender& contender,
                            const OrbitScene& scene,
                            const RayCaster& caster,
                            const StudyOptions& options) {
  std::vector<double> medians;
  for (const double angle : kAnglesDeg) {
    std::vector<double> values;
    for (int i = 0; i < options.poses; ++i) {
      const std::vector<Ray> rays =
          random_rays(scene, angle * kRadPerDeg, static_cast<std::uint64_t>(i), options.pixels);
      std::vector<float> reference;
      for (const Ray& ray : rays)
        reference.push_back(
            caster.total_attenuation(ray.origin_point, ray.origin_point + ray.direction));
      const auto quality = psnr(contender.drr(rays, caster), reference);
      if (quality && std::isfinite(quality->psnr_db)) values.push_back(quality->psnr_db);
    }
    medians.push_back(median(values));
  }
  return medians;
}

OrbitScene scene_of(const StudyOptions& options, const AttenuationVolume& volume) {
  const CameraRig rig = read_rig(options.rig);
  OrbitScene scene;
  scene.camera = rig.camera(options.camera);
  scene.isocenter_point = rig.isocenter_point;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& corner : volume.corner_points()) center += corner / 8.0;
  scene.frame = {Eigen::Matrix3d::Identity(), center, rig.isocenter_point};
  scene.range = MotionRange(10.0 * kRadPerDeg, 30.0);
  scene.orbit.from_rad = -90.0 * kRadPerDeg;
  scene.orbit.to_rad = 90.0 * kRadPerDeg;
  scene.attenuating_corners_ct = volume.corner_points();
  const int slabs = options.slabs;
  if (options.slab_mm > 0.0) {
    const DepthSlabs equal = equal_slabs(slabs, options.slab_mm);
    scene.depth_slabs = [equal](const RigidTransform& /*slab_from_ct*/) { return equal; };
    return scene;
  }
  scene.depth_slabs = [&volume, slabs](const RigidTransform& slab_from_ct) {
    return depth_slabs_of(volume, slab_from_ct, slabs);
  };
  return scene;
}

void run(const StudyOptions& options) {
  const AttenuationVolume volume(read_ct(options.ct), AttenuationModel{});
  const OrbitScene scene = scene_of(options, volume);
  const RayCaster caster(volume, {});
  std::vector<std::unique_ptr<Contender>> contenders;
  for (const auto& [step, by] : {std::pair{20.0, Orbit::MembersBy::Pose},
                                 {10.0, Orbit::MembersBy::Pose},
                                 {5.0, Orbit::MembersBy::Source},
                                 {10.0, Orbit::MembersBy::Source},
                                 {20.0, Orbit::MembersBy::Source},
                                 {30.0, Orbit::MembersBy::Source}})
    contenders.push_back(std::make_unique<Atlas>(scene, step, by));
  contenders.push_back(std::make_unique<Cylinder>(scene));
  nlohmann::json rows = nlohmann::json::array();
  double budget = 0.0;
  for (const auto& contender : contenders) {
    contender->set_viewpoints(options.uv_step_mm);
    const double at_equal_steps = contender->samples(options.st_step_mm);
    if (budget == 0.0) budget = at_equal_steps;
    const double rms = rms_along_orbit(*contender, caster, options.pairs);
    const double step_mm = spend(*contender, budget, options.st_step_mm);
    const std::vector<double> medians = psnr_db(*contender, scene, caster, options);
    std::printf(
        "%-34s at %.0f mm %7.1f M samples (%.2f), neighbours differ by %.4f; at equal samples: "
        "%5d viewpoints, %.1f mm apart, %.2f %.2f %.2f dB\n",
        contender->name().c_str(),
        options.uv_step_mm,
        at_equal_steps / 1e6,
        at_equal_steps / budget,
        rms,
        contender->viewpoints(),
        step_mm,
        medians[0],
        medians[1],
        medians[2]);
    std::fflush(stdout);
    rows.push_back({{"name", contender->name()},
                    {"samples_at_equal_steps", at_equal_steps},
                    {"rms_of_neighbours_at_equal_steps", rms},
                    {"step_mm_at_equal_samples", step_mm},
                    {"viewpoints_at_equal_samples", contender->viewpoints()},
                    {"median_psnr_db", medians}});
  }
  if (!options.output.empty())
    write_section(options.output,
                  "orbit",
                  {{"angles_deg", kAnglesDeg},
                   {"slabs", options.slabs},
                   {"uv_step_mm", options.uv_step_mm},
                   {"st_step_mm", options.st_step_mm},
                   {"contenders", rows}});
}

}  // namespace

// Only a defect in the declaration of options can throw here, and it may end the program.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  StudyOptions options;
  CLI::App app{
      "Rays of an orbit of +-90 degrees about z with +-10 degrees and +-30 mm at every angle: "
      "atlases of planes "
      "and viewpoints on a cylinder at equal numbers of samples, without coding."};
  app.add_option("--ct", options.ct, "CT: image file or DICOM folder")->required();
  app.add_option("--rig", options.rig, "Cameras: a rig.toml or a shipped rig")
      ->capture_default_str();
  app.add_option("--camera", options.camera, "Which camera of the rig")->capture_default_str();
  app.add_option("--slabs", options.slabs, "Depth slabs")->capture_default_str();
  app.add_option(
         "--slab-mm",
         options.slab_mm,
         "Thickness of slabs that are alike in all frames; 0: cut where they suit the CT best")
      ->capture_default_str();
  app.add_option("--uv-step-mm", options.uv_step_mm, "Between viewpoints of the first contender")
      ->capture_default_str();
  app.add_option("--st-step-mm", options.st_step_mm, "Between (s,t) nodes")->capture_default_str();
  app.add_option("--poses", options.poses, "Random poses at each angle")->capture_default_str();
  app.add_option("--pairs", options.pairs, "Pairs of neighbouring samples")->capture_default_str();
  app.add_option("--pixels", options.pixels, "Of a DRR, along each side")->capture_default_str();
  app.add_option("-o,--output", options.output, "The section's JSON file");
  return cli::app_main(app, argc, argv, [&](const Communicator& /*world*/) { run(options); });
}
