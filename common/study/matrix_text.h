// SPDX-License-Identifier: Apache-2.0
// Projection matrices as text: pixels from room mm, (column, row, 1) ~ P (x, 1). A camera takes
// three lines of four numbers, or twelve numbers on one line. Comments begin with '#', and state
// what a matrix leaves open:
//     # isocenter_point 0 0 0
//     # camera AP
//     # size_px 256 256
//     # pixel_spacing_mm 1.190625 1.190625
#pragma once

#include <string>
#include <string_view>

namespace af {

/// Whether all lines are comments or rows of whole matrices. Four rows would be a pose.
bool is_matrix_text(std::string_view text);

/// The rig.toml of such a text. Empty when its comments do not state everything.
std::string rig_toml_of_matrices(std::string_view text);

}  // namespace af
