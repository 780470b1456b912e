# SPDX-License-Identifier: Apache-2.0
"""Cameras, poses and studies of other programs: what af-convert reads and writes. Lengths are mm, matrices NumPy arrays."""
