# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats drawn in the 3D view."""

from .. import late

__getattr__ = late.room(__name__)
