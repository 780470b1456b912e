// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace af {

/// What a field is made of, apart from CT, camera and range.
struct FieldDesign {
  int slabs = 1;      ///< depth slabs K
  int uv_nodes = 64;  ///< along each side of the (u,v) plane
  int st_nodes = 256;
  int codewords = 16384;
  std::string look_up = "linear";  ///< "linear" or "cubic": how DRRs are meant to be looked up
  int mean_step = 0;               ///< for mean-removed tiles, levels; 0: plain ones
  bool fits_uv = false;  ///< samples fit linear interpolation over (u,v): LeastSquaresFieldCaster
  bool filters_tiles = false;  ///< decoded tiles are corrected by their neighbours: TileFilter

  bool operator==(const FieldDesign&) const = default;
};

/// "4 slabs, 16 x 16 (u,v) nodes, 384 x 384 (s,t) nodes, 16384 codewords, cubic look-up"
std::string to_text(const FieldDesign& design);

/// What a design is expected to achieve.
struct DesignForecast {
  FieldDesign design;
  double psnr_db = 0.0;           ///< median over poses of the motion box, eq. (12)
  double interpolation_db = 0.0;  ///< the same without quantisation
  double quantisation_db = 0.0;   ///< the same without interpolation
  double file_bytes = 0.0;
  double drr_ms = 0.0;  ///< for one DRR of the whole detector on one core
};

}  // namespace af
