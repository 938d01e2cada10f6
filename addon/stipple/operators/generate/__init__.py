# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats from images: one file per verb."""

from . import weights_check, weights_refresh

_modules = (weights_refresh, weights_check)
classes = tuple(cls for module in _modules for cls in module.classes)
