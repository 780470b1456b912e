// SPDX-License-Identifier: Apache-2.0
// CLI11's classes for headers that bind options to it: to compile all of CLI11 takes seconds, so
// only what calls it includes it.
#pragma once

namespace CLI {
class App;
class Option;
}  // namespace CLI
