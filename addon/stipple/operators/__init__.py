# SPDX-License-Identifier: GPL-3.0-or-later
"""One file per verb: read, native call or job, write, report."""

from . import (revert_to_source, splats_export, splats_from_mesh, splats_import, splats_to_volume, update_from_source,
               upgrade_to_point_cloud, use_as_new_source, use_standard_view)

_modules = (splats_from_mesh, splats_import, splats_export, splats_to_volume, update_from_source, use_as_new_source,
            revert_to_source, upgrade_to_point_cloud, use_standard_view)
classes = tuple(cls for module in _modules for cls in module.classes)
