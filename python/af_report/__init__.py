# SPDX-License-Identifier: Apache-2.0
"""What people read of the numbers that af-evaluate writes: a page, figures, tables."""
