# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats that change by frames: numbered files, their frames in and out."""

from ... import late

__getattr__ = late.room(__name__)
