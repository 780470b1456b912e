// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// A run of (s,t) nodes along s whose rays pass between the same four viewpoints.
struct SampleRun {
  const uint16_t* viewpoints[4];  ///< samples of (u, v), (u, v + 1), (u + 1, v), (u + 1, v + 1)
  const float* u_weights;         ///< of viewpoint u + 1, one per node
  float v_weight;                 ///< of viewpoint v + 1
  float step;                     ///< attenuation per level
};

/// Blends `count` nodes of a run bilinearly.
using BlendSamples = void (*)(const SampleRun& run, float* blended, int32_t count);

namespace kernels_128 {
void blend_samples(const SampleRun& run, float* blended, int32_t count);
}
namespace kernels_256 {
void blend_samples(const SampleRun& run, float* blended, int32_t count);
}
namespace kernels_512 {
void blend_samples(const SampleRun& run, float* blended, int32_t count);
}

}  // namespace af
