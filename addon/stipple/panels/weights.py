# SPDX-License-Identifier: GPL-3.0-or-later
"""In Preferences: the files of networks that turn images into splats."""

from ..binding.structs import WeightsState
from ..scene.generate import weights_table
from .text import draw_text

_ICONS = {WeightsState.TRAINED: 'CHECKMARK', WeightsState.NOT_NEEDED: 'BLANK1', WeightsState.MISSING: 'X',
          WeightsState.OTHER_SIZE: 'ERROR', WeightsState.UNCHECKED: 'QUESTION', WeightsState.PUBLISHED: 'CHECKMARK',
          WeightsState.OTHER_CONTENT: 'ERROR'}


def draw(layout, context, chosen):
    """In: chosen, the add-on's preferences."""
    box = layout.box()
    box.label(text="Splats from Images", icon='IMAGE_DATA')
    column = box.column()
    column.use_property_split = True
    column.prop(chosen, 'weights_folder')
    rows = weights_table.rows()
    for row in rows:
        _draw_row(box, row)
    for note in weights_table.notes():
        draw_text(box, context, note, 'ERROR')
    line = box.row()
    line.operator('stipple.weights_refresh', icon='FILE_REFRESH')
    line.operator('stipple.weights_check', icon='CHECKMARK')
    if weights_table.source():
        draw_text(box, context, weights_table.source(), 'INFO')
    draw_text(box, context, weights_table.caution(), 'INFO')
    for row in rows:
        draw_text(box, context, f"{row['label']}: {row['licence']}", is_quiet=True)


def _draw_row(box, row):
    line = box.split(factor=0.3)
    line.label(text=row['label'], icon=_ICONS[row['state']])
    line = line.split(factor=0.45)
    line.label(text=_size_text(row))
    line.label(text=weights_table.STATE_TEXTS[row['state']])
    where = box.row()
    where.active, where.scale_y = False, 0.8
    where.label(text=row['path'] or f"Published as {row['published_path']}", icon='BLANK1')


def _size_text(row):
    published = f"{row['published_size']:,} bytes"
    if not row['path'] or row['size'] == row['published_size']:
        return published
    return f"{row['size']:,} of {published}"
