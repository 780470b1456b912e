// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "register/method/registration_options.h"

namespace af::registration {

/// A chain as one line: stages separated by ';', each a measure and an optimiser followed by
/// key=value, for example
///
///     ncc gauss-newton level=2 pixels=8 roi=2 step=10 final=0.5; gc gauss-newton level=1 pixels=2
///
/// Keys are the options that StageOptions describes.
std::string chain_text(const ChainOptions& chain);
std::string stage_text(const StageOptions& stage);
/// The keys, each with what it means, for --help.
std::string chain_keys_help();

/// The chain of a line. InputError for a line that is not of this form; whether its values fit is
/// for problems() to say. \test ChainText.ReadsWhatItWrites
ChainOptions chain_from_text(const std::string& name, const std::string& text);

}  // namespace af::registration
