# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that hide splats in a view; each is read again only when it has changed."""

from . import mattes, viewed


class ViewMattes:

    def __init__(self):
        self.placed = []  # as of mattes.gather_owned
        self._read = {}

    def update(self, depsgraph, wanted):
        """Takes what there is now. wanted: as of mattes.gather. Errors: StippleError."""
        used = {}

        def mesh_of(evaluated):
            # Geometry that nodes instance without its object has the name of its own data.
            key = evaluated.original.name_full, evaluated.data.name_full
            made = viewed.geometry_version(evaluated.original)
            known = self._read.get(key)
            used[key] = known if known is not None and known[0] == made else (made, mattes.read(evaluated))
            return used[key][1]

        self.placed = mattes.gather_owned(depsgraph, wanted, mesh_of)
        self._read = used
