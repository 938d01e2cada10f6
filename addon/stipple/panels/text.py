# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences in panels, which cut off what is wider than they are."""

import textwrap

# Width of a letter of Blender's font, and of the margins of a panel in letters.
_LETTER_PX = 7
_MARGIN = 4
_MIN_LETTERS = 8


def draw_text(layout, context, text, icon='NONE', is_quiet=False, columns=1, width_px=None):
    """A sentence, whole, in as many lines as it takes. is_quiet: grey and narrow, as notes are. columns: that the
    layout is one of, side by side. width_px: of a dialog, None in a panel."""
    shown_px = context.region.width / context.preferences.system.ui_scale if width_px is None else width_px
    width = int(shown_px / _LETTER_PX) // columns - _MARGIN
    characters = max(_MIN_LETTERS, width if icon == 'NONE' else width - _MARGIN)
    column = layout.column(align=True)
    if is_quiet:
        column.active, column.scale_y = False, 0.8
    for i, line in enumerate(textwrap.wrap(text, characters)):
        column.label(text=line, icon=icon if i == 0 or icon == 'NONE' else 'BLANK1')


def draw_anchors(layout, owner, name, each, text="Splats"):
    """The budget that a property of anchors is. each: splats that an anchor becomes; where there are several, the field
    has the anchors, and the splats stand beside it."""
    if each == 1:
        layout.prop(owner, name, text=text)
        return
    layout.prop(owner, name, text="Anchors" if text == "Splats" else f"{text} Anchors")
    split = layout.split(factor=0.4)
    split.label()
    count = getattr(owner, name) * each
    split.label(text=f"{count:,} splats" if count else "As in the viewport")


def draw_color_from(layout, owner):
    """Where the colours of splats of meshes come from, and how light is baked where it is."""
    layout.prop(owner, 'color_from')
    if owner.color_from == 'BAKED':
        layout.prop(owner, 'bake_size')
        layout.prop(owner, 'bake_samples')
        layout.prop(owner, 'bake_views')
