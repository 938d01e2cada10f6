# SPDX-License-Identifier: GPL-3.0-or-later
"""The native library as Python objects. Knows nothing of Blender; needs numpy only."""

from .. import late

__getattr__ = late.room(__name__)
