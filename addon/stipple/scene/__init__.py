# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's data as arrays and back; no algorithms."""

from .. import late

__getattr__ = late.room(__name__)
