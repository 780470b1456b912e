# SPDX-License-Identifier: Apache-2.0
# %% [markdown]
# The 16-bit samples of one viewpoint of a field, before the tile filter, by h5py and NumPy alone. The page
# docs/reference/field-format.md explains every step.
#
#     python3 decode_viewpoint.py FIELD.af.h5 U V [SAMPLES.npz]

# %%
import sys

import h5py
import numpy as np

path, u, v = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
element = 8 * (u % 2) + 4 * (v % 2) + np.array([[0, 1], [2, 3]])  # of this viewpoint: 2x2 nodes (s, t)
samples = {}
with h5py.File(path) as field:
    if not (0 <= u < field["geometry/uv_nodes"][0] and 0 <= v < field["geometry/uv_nodes"][1]):
        sys.exit(f"{path} has {field['geometry/uv_nodes'][:]} viewpoints along u and v")
    codebook = field["codebook/codewords"][:].astype(int)
    for slab, tiles in field["field"].items():
        levels = codebook[tiles["codewords"][u // 2, v // 2]][..., element]  # tiles (s, t), nodes (s, t)
        if "means" in tiles:
            means = tiles["means"][u // 2, v // 2]  # tiles (t, s)
            for run in range(0, len(means), 16):
                means[run : run + 16] = np.cumsum(means[run : run + 16], axis=0, dtype=np.uint16)
            levels += means.T[..., None, None].astype(int) - 32768
        levels = levels.clip(0, 65535).astype(np.uint16).swapaxes(1, 2)  # tile and node of s, then of t
        s_begin, s_count, t_begin, t_count = field[f"geometry/{slab}/stored_range"][:]
        s_tiles, t_tiles = levels.shape[0], levels.shape[2]
        samples[slab] = levels.reshape(2 * s_tiles, 2 * t_tiles)[:s_count, :t_count]
        largest = field["codebook/quantizer_step"][0] * np.float32(samples[slab].max())
        print(f"{slab}: {s_count} x {t_count} samples from node ({s_begin}, {t_begin}) on, at most {largest:.4f}")

# %%
if len(sys.argv) > 4:
    np.savez(sys.argv[4], **samples)
