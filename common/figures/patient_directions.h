// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>

#include "figures/picture.h"
#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"

namespace af {

/// Letters of a direction in the patient: L left, R right, A front (anterior), P back (posterior),
/// H head, F feet. The nearest axis comes first, then those within 67.5 degrees of the direction:
/// "A", "AR", "LPH".
std::string patient_letters(const Eigen::Vector3d& ct_direction);

/// What stands at a picture's edges, and where the beam goes.
struct EdgeLetters {
  std::string left, right, top, bottom;
  std::string beam_from, beam_to;
};

/// The patient's directions as a camera's picture shows them at a pose. The left edge has the
/// letters of the direction against the columns, the top those of the direction against the rows.
EdgeLetters edge_letters(const CameraGeometry& camera, const RigidTransform& room_from_ct);

/// Puts them along the edges of a part of the panel's image.
void add_letters(const EdgeLetters& letters, const RegionOfInterest& part, PicturePanel& panel);

}  // namespace af
