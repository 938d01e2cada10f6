# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits: what they are asked, the views they learn from, what they report."""

from ... import late

__getattr__ = late.room(__name__)
