# SPDX-License-Identifier: Apache-2.0
"""A page, figures and tables for people, from the numbers that af-evaluate writes."""
