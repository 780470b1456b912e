// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/renderer.h"

#include <algorithm>
#include <mutex>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/fork_aware_mutex.h"
#include "base/plausible.h"
#include "base/thread_pool.h"
#include "ct/ct_reader.h"
#include "drr/bone_volume.h"
#include "drr/field_renderer.h"
#include "drr/field_set_drr.h"
#include "drr/opened_field.h"
#include "drr/ray_cast_drr.h"
#include "drr/xray_beam.h"
#include "library/ct_impl.h"
#include "library/field_facts.h"
#include "library/translation.h"
#include "study/pose_file.h"

namespace attenuation_fields {

namespace library = af::library;

namespace {

constexpr std::size_t kPlanes = 6;

std::array<double, 6> six_of(const Vector3& rotation_deg, const Vector3& translation_mm) {
  return {rotation_deg[0],
          rotation_deg[1],
          rotation_deg[2],
          translation_mm[0],
          translation_mm[1],
          translation_mm[2]};
}

void require_size(const char* name, std::size_t found, std::size_t expected) {
  if (found != expected)
    throw af::InputError(
        name, std::to_string(found) + " values", "must have room for " + std::to_string(expected));
}

/// None for one thread, so that renderers need no turns.
std::shared_ptr<af::ThreadPool> pool_of(int threads) {
  af::throw_if_any(af::thread_problems(threads));
  const int count = af::thread_count(threads);
  return count > 1 ? std::make_shared<af::ThreadPool>(count) : nullptr;
}

/// Turns derivatives with respect to small motions about r + t (per rad, per mm) into those with
/// respect to the six pose parameters (per degree, per mm), in place. Translations are their own
/// motions.
void by_parameters(const std::array<double, 6>& parameters, std::span<float> planes) {
  const auto motions = af::motions_from_parameters(af::PoseParameters::from_deg_and_mm(parameters));
  const std::size_t pixels = planes.size() / kPlanes;
  std::array<std::array<double, 3>, 3> weights{};
  for (std::size_t to = 0; to < 3; ++to)
    for (std::size_t from = 0; from < 3; ++from)
      weights[to][from] =
          motions(static_cast<Eigen::Index>(from), static_cast<Eigen::Index>(to)) * af::kRadPerDeg;
  float* const x = planes.data();
  float* const y = x + pixels;
  float* const z = y + pixels;
  for (std::size_t i = 0; i < pixels; ++i) {
    const double by_x = double{x[i]};
    const double by_y = double{y[i]};
    const double by_z = double{z[i]};
    const auto sum = [&](const std::array<double, 3>& weight) {
      return static_cast<float>(weight[0] * by_x + weight[1] * by_y + weight[2] * by_z);
    };
    x[i] = sum(weights[0]);
    y[i] = sum(weights[1]);
    z[i] = sum(weights[2]);
  }
}

}  // namespace

struct Renderer::Impl {
  std::shared_ptr<const af::DrrRenderer> renderer;
  af::View view;
  af::PoseFrame frame;
  std::shared_ptr<af::ThreadPool> pool;  ///< none for one thread
  Outside outside = Outside::Throw;
  Camera camera;
  PoseFrame public_frame;

  Impl(std::shared_ptr<const af::DrrRenderer> drr_renderer,
       const af::CameraGeometry& geometry,
       const af::PoseFrame& pose_frame,
       std::shared_ptr<af::ThreadPool> threads,
       Outside when_outside)
      : renderer(std::move(drr_renderer)),
        view(af::View::whole_detector(geometry)),
        frame(pose_frame),
        pool(std::move(threads)),
        outside(when_outside),
        camera(library::camera_of(geometry)),
        public_frame(library::frame_of(pose_frame)) {}

  /// Makes one DRR, with scratch memory that is kept for the next.
  std::int64_t render(const af::RigidTransform& pose,
                      std::size_t number,
                      std::span<float> total_attenuation,
                      const std::optional<af::PoseGradients>& gradients) const {
    std::unique_ptr<af::RenderWorkspace> workspace = take_workspace();
    const af::RenderStatus status =
        renderer->render(pose, view, *workspace, total_attenuation, gradients);
    give_back(std::move(workspace));
    if (status.rays_outside > 0 && outside == Outside::Throw)
      throw af::InputError("pose " + std::to_string(number) + " = outside the field: " +
                           status.text(view) + "; must be within the motion range it was made for");
    return status.rays_outside;
  }

  std::int64_t render_with_parameters(const std::array<double, 6>& parameters,
                                      std::size_t number,
                                      std::span<float> total_attenuation,
                                      std::span<float> planes) const {
    const af::RigidTransform pose =
        af::pose_of_deg_and_mm(frame, parameters, "rotation_deg, translation_mm");
    const Eigen::Vector3d pivot =
        frame.center_room_mm + Eigen::Vector3d(parameters[3], parameters[4], parameters[5]);
    const std::int64_t rays_outside =
        render(pose, number, total_attenuation, af::PoseGradients{pivot, planes});
    by_parameters(parameters, planes);
    return rays_outside;
  }

  /// Calls work(i) for [0, count), on all threads, and adds up what it returns.
  template <typename Work>
  std::int64_t sum_over(std::size_t count, const Work& work) const {
    std::vector<std::int64_t> parts(count);
    if (!pool) {
      for (std::size_t i = 0; i < count; ++i) parts[i] = work(i);
    } else {
      const std::lock_guard turn(pool_mutex_);
      pool->for_each(static_cast<int>(count), [&](int task, int /*slot*/) {
        parts[static_cast<std::size_t>(task)] = work(static_cast<std::size_t>(task));
      });
    }
    std::int64_t sum = 0;
    for (const std::int64_t part : parts) sum += part;
    return sum;
  }

  /// Makes a single DRR, whose rows the threads share.
  template <typename Work>
  std::int64_t in_turn(const Work& work) const {
    if (!pool) return work();
    const std::lock_guard turn(pool_mutex_);
    return work();
  }

 private:
  [[nodiscard]] std::unique_ptr<af::RenderWorkspace> take_workspace() const {
    {
      const std::lock_guard lock(workspace_mutex_);
      if (!workspaces_.empty()) {
        auto workspace = std::move(workspaces_.back());
        workspaces_.pop_back();
        return workspace;
      }
    }
    return renderer->make_workspace();
  }

  void give_back(std::unique_ptr<af::RenderWorkspace> workspace) const {
    const std::lock_guard lock(workspace_mutex_);
    workspaces_.push_back(std::move(workspace));
  }

  mutable af::ForkAwareMutex pool_mutex_;  ///< callers take turns with the pool
  mutable af::ForkAwareMutex workspace_mutex_;
  mutable std::vector<std::unique_ptr<af::RenderWorkspace>> workspaces_;
};

Renderer::Renderer(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

const Camera& Renderer::camera() const {
  return impl_->camera;
}

const PoseFrame& Renderer::frame() const {
  return impl_->public_frame;
}

std::size_t Renderer::pixel_count() const {
  return impl_->view.pixel_count();
}

int Renderer::threads() const {
  return impl_->pool ? impl_->pool->threads() : 1;
}

std::int64_t Renderer::drr(const Pose& pose, std::span<float> total_attenuation) const {
  return library::translated([&] {
    require_size("total_attenuation", total_attenuation.size(), pixel_count());
    const af::RigidTransform room_from_ct = library::transform_of(pose, "pose");
    return impl_->in_turn(
        [&] { return impl_->render(room_from_ct, 0, total_attenuation, std::nullopt); });
  });
}

std::int64_t Renderer::drr_and_motion_gradient(const Pose& pose,
                                               const Vector3& pivot_room_mm,
                                               std::span<float> total_attenuation,
                                               std::span<float> planes) const {
  return library::translated([&] {
    require_size("total_attenuation", total_attenuation.size(), pixel_count());
    require_size("planes", planes.size(), kPlanes * pixel_count());
    const af::RigidTransform room_from_ct = library::transform_of(pose, "pose");
    const Eigen::Vector3d pivot = library::vector_of(pivot_room_mm);
    if (!std::all_of(pivot.begin(), pivot.end(), af::is_plausible_room_mm))
      throw af::InputError(std::string("pivot_room_mm: ") + af::kPlausibleRoom);
    const af::PoseGradients gradients{pivot, planes};
    return impl_->in_turn(
        [&] { return impl_->render(room_from_ct, 0, total_attenuation, gradients); });
  });
}

std::int64_t Renderer::drr_and_gradient(const Vector3& rotation_deg,
                                        const Vector3& translation_mm,
                                        std::span<float> total_attenuation,
                                        std::span<float> planes) const {
  return library::translated([&] {
    require_size("total_attenuation", total_attenuation.size(), pixel_count());
    require_size("planes", planes.size(), kPlanes * pixel_count());
    return impl_->in_turn([&] {
      return impl_->render_with_parameters(
          six_of(rotation_deg, translation_mm), 0, total_attenuation, planes);
    });
  });
}

std::int64_t Renderer::drrs(std::span<const Pose> poses, std::span<float> total_attenuation) const {
  return library::translated([&] {
    const std::size_t pixels = pixel_count();
    require_size("total_attenuation", total_attenuation.size(), poses.size() * pixels);
    std::vector<af::RigidTransform> transforms;
    for (std::size_t i = 0; i < poses.size(); ++i)
      transforms.push_back(library::transform_of(poses[i], "pose " + std::to_string(i)));
    return impl_->sum_over(poses.size(), [&](std::size_t i) {
      return impl_->render(
          transforms[i], i, total_attenuation.subspan(i * pixels, pixels), std::nullopt);
    });
  });
}

std::int64_t Renderer::drrs_and_gradients(std::span<const std::array<double, 6>> parameters,
                                          std::span<float> total_attenuation,
                                          std::span<float> planes) const {
  return library::translated([&] {
    const std::size_t pixels = pixel_count();
    require_size("total_attenuation", total_attenuation.size(), parameters.size() * pixels);
    require_size("planes", planes.size(), kPlanes * parameters.size() * pixels);
    return impl_->sum_over(parameters.size(), [&](std::size_t i) {
      return impl_->render_with_parameters(parameters[i],
                                           i,
                                           total_attenuation.subspan(i * pixels, pixels),
                                           planes.subspan(kPlanes * i * pixels, kPlanes * pixels));
    });
  });
}

namespace {

/// A renderer of a field, or of an atlas's fields, for a beam, as af-drr makes it.
std::shared_ptr<const af::DrrRenderer> renderer_of(const af::OpenedField& opened,
                                                   const std::string& look_up,
                                                   const af::XrayBeamOptions& options,
                                                   const std::shared_ptr<af::ThreadPool>& pool) {
  const af::FieldIdentity& identity = opened.identity();
  const af::XrayBeam beam(options, {identity.mu_water_per_mm, identity.air_below_hu});
  std::shared_ptr<const af::DrrRenderer> bone;
  if (options.needs_bone()) bone = opened.bone(af::Communicator::alone()).renderer(look_up, pool);
  std::vector<af::FieldSetMember> members = opened.renderers(look_up, pool);
  for (af::FieldSetMember& member : members) member.renderer = beam.renderer(member.renderer, bone);
  if (members.size() == 1) return members.front().renderer;
  return std::make_shared<const af::FieldSetDrr>(std::move(members));
}

}  // namespace

Field::Field(std::shared_ptr<const Impl> impl, std::shared_ptr<const Facts> facts)
    : Renderer(std::move(impl)), facts_(std::move(facts)) {}

Field Field::open(const std::filesystem::path& path, const FieldOptions& options) {
  return open(path, options, Beam{});
}

Field Field::open(const std::filesystem::path& path,
                  const FieldOptions& options,
                  const Beam& beam) {
  return library::translated_reading([&] {
    const auto pool = pool_of(options.threads);
    const af::XrayBeamOptions beam_options = library::checked_beam(beam);
    auto facts = std::make_shared<Facts>();
    facts->opened = std::make_shared<const af::OpenedField>(path, af::Communicator::alone());
    const af::OpenedField& opened = *facts->opened;
    const af::FieldIdentity& identity = opened.identity();
    facts->look_up = options.look_up.empty() ? opened.info().look_up : options.look_up;
    facts->members = static_cast<int>(opened.coverage().planes.size());
    const af::MotionRange within = identity.range.symmetric_part();
    facts->max_rotation_deg = within.max_rotation_rad() * af::kDegPerRad;
    facts->max_translation_mm = within.max_translation_mm();
    facts->ct = identity.ct;
    facts->payload_sha256 = opened.info().payload_sha256;
    facts->water_mu_per_mm = identity.mu_water_per_mm;
    const af::CameraGeometry camera =
        options.camera.has_value() ? library::checked_camera(*options.camera) : identity.camera;
    auto impl =
        std::make_shared<const Impl>(renderer_of(opened, facts->look_up, beam_options, pool),
                                     camera,
                                     identity.frame,
                                     pool,
                                     options.outside);
    return Field(std::move(impl), std::move(facts));
  });
}

int Field::members() const {
  return facts_->members;
}

const std::string& Field::look_up() const {
  return facts_->look_up;
}

double Field::max_rotation_deg() const {
  return facts_->max_rotation_deg;
}

double Field::max_translation_mm() const {
  return facts_->max_translation_mm;
}

bool Field::is_of(const Ct& ct) const {
  return library::translated(
      [&] { return af::ct_difference(facts_->ct, af::identity_of(ct.impl_->ct)).empty(); });
}

const std::string& Field::ct_content_sha256() const {
  return facts_->ct.content_sha256;
}

const std::string& Field::payload_sha256() const {
  return facts_->payload_sha256;
}

double Field::water_mu_per_mm() const {
  return facts_->water_mu_per_mm;
}

RayCaster::RayCaster(const Ct& ct, const Camera& camera, const RayCasterOptions& options)
    : RayCaster(ct, camera, options, Beam{}) {}

RayCaster::RayCaster(const Ct& ct,
                     const Camera& camera,
                     const RayCasterOptions& options,
                     const Beam& beam)
    : Renderer(library::translated([&] {
        const af::AttenuationModel model{options.water_mu_per_mm, options.air_below_hu};
        const af::RayCasterOptions caster{options.step_mm};
        af::throw_if_any(problems(model));
        af::throw_if_any(problems(caster));
        const auto pool = pool_of(options.threads);
        af::PoseFrame frame;
        frame.center_ct_mm = ct.impl_->ct.grid.center_mm();
        frame.center_room_mm = library::vector_of(options.isocenter_point);
        if (options.frame.has_value()) frame = library::checked_frame(*options.frame);
        const af::XrayBeamOptions beam_options = library::checked_beam(beam);
        const auto volume = ct.impl_->attenuation(model);
        const auto through = [&](std::shared_ptr<const af::AttenuationVolume> attenuation) {
          return std::make_shared<const af::RayCastDrr>(std::move(attenuation), caster, pool);
        };
        return std::make_shared<const Impl>(
            af::XrayBeam(beam_options, model)
                .renderer(through(volume),
                          beam_options.needs_bone() ? through(af::bone_volume(*volume)) : nullptr),
            library::checked_camera(camera),
            frame,
            pool,
            Outside::Throw);
      })) {}

}  // namespace attenuation_fields
