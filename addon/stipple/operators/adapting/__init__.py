# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes whose vertices move and whose faces stay."""

from . import mesh_adapt, mesh_adapt_to_images, mesh_adapt_to_renders, mesh_even_out

classes = (mesh_adapt.classes + mesh_adapt_to_images.classes + mesh_adapt_to_renders.classes
           + mesh_even_out.classes)
