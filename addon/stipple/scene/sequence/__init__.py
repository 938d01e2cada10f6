# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats that change by frames: numbered files, their frames in and out."""
