// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <span>

#include "evaluate/perturbed_starts.h"
#include "parallel/communicator.h"

namespace af::evaluation {

/// Collective. The starts that `make` gives on rank 0, none on the other ranks; errors of `make`
/// are thrown on every rank. Drawing is quick, measuring a start is not (a mean over every target
/// point, 0.15 ms for a box of 60 mm): all ranks share the TREs that `make` asks for.
StratifiedStarts starts_measured_together(
    const Communicator& world,
    const RigidTransform& gold_room_from_ct,
    std::span<const Eigen::Vector3d> target_points_ct_mm,
    const std::function<StratifiedStarts(const MeasureTres& measure_tres)>& make);

}  // namespace af::evaluation
