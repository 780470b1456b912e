// SPDX-License-Identifier: Apache-2.0
// Forward declarations of CLI11's classes, for headers that bind options. Compiling CLI11 takes
// seconds, so only sources that call it include it.
#pragma once

namespace CLI {
class App;
class Option;
}  // namespace CLI
