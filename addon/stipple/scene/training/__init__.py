# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects become data sets that networks learn from: views from all around, and coloured points of the surface."""

from ... import late

__getattr__ = late.room(__name__)
