# SPDX-License-Identifier: GPL-3.0-or-later
"""What keeps the splats from following their settings: no library, a source that is gone or another one."""

from ..scene.source import masks, sources


def draw(layout, data):
    """Says it with what can be done; draws nothing where all is well. Returns True where it drew."""
    problem = sources.library_problem()
    if problem:
        layout.label(text="The Stipple library is missing", icon='ERROR')
        layout.operator('preferences.addon_show', text="Preferences",
                        icon='PREFERENCES').module = __package__.rpartition('.')[0]
        return True
    found = sources.state(data)
    if found == 'FINE':
        return False
    layout.label(text="Source file is missing" if found == 'MISSING' else "Source file has changed", icon='ERROR')
    column = layout.column(align=True)
    column.operator_context = 'INVOKE_DEFAULT'
    if found == 'CHANGED':
        again = column.operator('stipple.relink', text="Read Again", icon='FILE_REFRESH')
        again.again = True
        # A mask says of each splat whether it is hidden: it must not be lost by the way.
        again.other_count = masks.counts(data) is None
    column.operator('stipple.relink', text="Relink", icon='FILEBROWSER')
    column.operator('stipple.use_as_new_source')
    return True
