# SPDX-License-Identifier: GPL-3.0-or-later
"""What an image is asked for: cameras, effects, layers, quality."""

from ... import late

__getattr__ = late.room(__name__)
