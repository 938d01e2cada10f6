# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences in panels, which cut off what is wider than they are."""

import textwrap

# Width of a letter of Blender's font, and of the margins of a panel in letters.
_LETTER_PX = 7
_MARGIN = 4


def draw_text(layout, context, text, icon='NONE', is_quiet=False, columns=1):
    """A sentence, whole, in as many lines as it takes. is_quiet: grey and narrow, as notes are. columns: that the
    layout is one of, side by side."""
    width = int(context.region.width / context.preferences.system.ui_scale / _LETTER_PX) // columns - _MARGIN
    characters = max(16, width if icon == 'NONE' else width - _MARGIN)
    column = layout.column(align=True)
    if is_quiet:
        column.active, column.scale_y = False, 0.8
    for i, line in enumerate(textwrap.wrap(text, characters)):
        column.label(text=line, icon=icon if i == 0 or icon == 'NONE' else 'BLANK1')
