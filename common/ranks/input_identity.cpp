// SPDX-License-Identifier: Apache-2.0
#include "ranks/input_identity.h"

#include <array>

namespace af {

namespace {

std::array<double, 3> numbers_of(const Eigen::Vector3d& vector) {
  return {vector.x() + 0.0, vector.y() + 0.0, vector.z() + 0.0};  // no -0
}

Eigen::Vector3d vector_of(const nlohmann::json& json) {
  const auto numbers = json.get<std::array<double, 3>>();
  return {numbers[0], numbers[1], numbers[2]};
}

}  // namespace

nlohmann::json to_json(const CtGrid& grid) {
  return {{"size_voxels", grid.size},
          {"origin_mm", numbers_of(grid.origin_mm)},
          {"spacing_mm", numbers_of(grid.spacing_mm)},
          {"direction",
           {numbers_of(grid.direction.col(0)),
            numbers_of(grid.direction.col(1)),
            numbers_of(grid.direction.col(2))}}};
}

nlohmann::json to_json(const CtIdentity& ct) {
  return {{"content_sha256", ct.content_sha256}, {"grid", to_json(ct.grid)}};
}

CtIdentity ct_identity_of(const nlohmann::json& json) {
  CtIdentity ct;
  ct.content_sha256 = json.at("content_sha256").get<std::string>();
  const nlohmann::json& grid = json.at("grid");
  ct.grid.size = grid.at("size_voxels").get<std::array<int, 3>>();
  ct.grid.origin_mm = vector_of(grid.at("origin_mm"));
  ct.grid.spacing_mm = vector_of(grid.at("spacing_mm"));
  for (int axis = 0; axis < 3; ++axis)
    ct.grid.direction.col(axis) =
        vector_of(grid.at("direction").at(static_cast<std::size_t>(axis)));
  return ct;
}

}  // namespace af
