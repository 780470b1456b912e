// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "field/attenuation_quantizer.h"
#include "precompute/design/design_search.h"
#include "precompute/field_source.h"
#include "ranks/communicator.h"

namespace af {

/// A design and why it was chosen.
struct DesignChoice {
  ChosenDesign chosen;
  std::string asked;     ///< "at least 50 dB, at most 8 MB"
  double seconds = 0.0;  ///< that the probe took
};

/// Collective. Chooses what the options leave open of the design, by a probe of the CT; the same on
/// every rank and on any number of them. `resampled`: in the field's frame. Errors of
/// search_design().
DesignChoice choose_design(const FieldSource& source,
                           const SlabAlignedVolume& resampled,
                           const PrecomputeOptions& options,
                           const AttenuationQuantizer& quantizer,
                           const Communicator& communicator);

/// The text printed about a choice.
std::string choice_text(const DesignChoice& choice);

}  // namespace af
