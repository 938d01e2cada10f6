# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats from images, by networks whose weights users download."""

from ... import late

__getattr__ = late.room(__name__)
