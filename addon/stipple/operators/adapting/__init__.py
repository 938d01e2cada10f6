# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes whose vertices move and whose faces stay."""

from . import mesh_adapt, mesh_even_out

classes = mesh_adapt.classes + mesh_even_out.classes
