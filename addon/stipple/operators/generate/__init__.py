# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats from images: one file per verb."""

from . import add_detail, random_splats, splats_from_image, splats_from_render, weights_check, weights_refresh

_modules = (splats_from_image, random_splats, splats_from_render, add_detail, weights_refresh, weights_check)
classes = tuple(cls for module in _modules for cls in module.classes)
