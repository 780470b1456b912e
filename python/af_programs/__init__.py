# SPDX-License-Identifier: Apache-2.0
"""Code that the programs in Python share."""
