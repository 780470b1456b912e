# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# A body of 300 HU in air, 24 x 20 x 16 voxels of 4 mm, as MetaImage.
make_ct() {
  local columns=24 rows=20 slices=16 k j air body
  printf 'ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n'
  printf 'CompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = -46 -38 -30\n'
  printf 'ElementSpacing = 4 4 4\nDimSize = %d %d %d\n' "$columns" "$rows" "$slices"
  printf 'ElementType = MET_SHORT\nElementDataFile = LOCAL\n'
  air=$(printf '\\x18\\xfc%.0s' $(seq "$columns"))
  body=$(printf '\\x18\\xfc%.0s' 1 2 3 4)$(printf '\\x2c\\x01%.0s' $(seq 16))$(printf '\\x18\\xfc%.0s' 1 2 3 4)
  for ((k = 0; k < slices; ++k)); do
    for ((j = 0; j < rows; ++j)); do
      if ((k >= 3 && k < 13 && j >= 4 && j < 16)); then printf '%b' "$body"; else printf '%b' "$air"; fi
    done
  done
}
