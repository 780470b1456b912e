// SPDX-License-Identifier: Apache-2.0
#include "register/problem/registration_problem.h"

namespace af::registration {
namespace {

bool has_size_of(const Image2d& image, const CameraGeometry& camera) {
  return image.width == camera.size_px.x() && image.height == camera.size_px.y();
}

void append_view_problems(const RegistrationView& view, std::vector<std::string>& found) {
  const CameraGeometry& camera = view.view.camera;
  if (!view.renderer) found.push_back(view_name(view) + "renderer = none: must be given");
  for (const std::string& text : problems(view.view.roi, camera.size_px.x(), camera.size_px.y()))
    found.push_back(view_name(view) + text);
  const auto size_text = [](int width, int height) {
    return std::to_string(width) + " x " + std::to_string(height);
  };
  const std::string expected = size_text(camera.size_px.x(), camera.size_px.y());
  if (!has_size_of(view.xray, camera))
    found.push_back(view_name(view) +
                    "X-ray size = " + size_text(view.xray.width, view.xray.height) +
                    ": must be the camera's " + expected);
  if (!view.mask.pixels.empty() && !has_size_of(view.mask, camera))
    found.push_back(view_name(view) +
                    "mask size = " + size_text(view.mask.width, view.mask.height) +
                    ": must be the camera's " + expected);
}

}  // namespace

std::string view_name(const RegistrationView& view) {
  return "view '" + view.view.camera.name + "': ";
}

View RegistrationView::widest_view() const {
  return view.scaled(kWidestRegionScale);
}

std::vector<std::string> problems(const RegistrationProblem& problem) {
  std::vector<std::string> found;
  if (problem.views.empty()) found.emplace_back("views = none: there must be at least one");
  if (problem.scaling_points_ct.empty())
    found.emplace_back("scaling_points_ct = none: there must be at least one");
  for (const RegistrationView& view : problem.views) append_view_problems(view, found);
  return found;
}

}  // namespace af::registration
