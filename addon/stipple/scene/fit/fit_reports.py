# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of a fit as an image of the .blend, and where it is shown."""

import bpy
import numpy as np

# Pixels of the report's sheet, whose two columns are 960 wide: sharp on a large screen.
SCALE = 2.0
_REPORT_KEY = 'stipple_report'


def keep(data, name, pixels):
    """Gives splat data the image of its report, packed. In: pixels [H,W,4], display sRGB, row 0 = top."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(f'{name} Report', width, height, alpha=False)
    image.pixels.foreach_set(np.ascontiguousarray(pixels[::-1]).reshape(-1))
    image.update()
    image.pack()
    image[_REPORT_KEY] = True
    data.stipple.fit_report = image
    return image


def of(obj):
    """The report of an object's splats, or None."""
    stipple = getattr(obj.data, 'stipple', None) if obj is not None else None
    return None if stipple is None else stipple.fit_report


def forget(image):
    """Removes a report that no other splats have, from Image Editors too."""
    if image is None:
        return
    users = bpy.data.user_map(subset={image})[image]
    if all(isinstance(user, bpy.types.Screen) for user in users):
        bpy.data.images.remove(image)


def editors(context):
    """[(window, area)] of the open Image Editors."""
    return [(window, area) for window in context.window_manager.windows for area in window.screen.areas
            if area.ui_type == 'IMAGE_EDITOR']


def show_if_wanted(context, image):
    """Shows a new report where nothing, or an older report, is shown."""
    for window, area in editors(context):
        space = area.spaces.active
        is_free = space.image is None or _REPORT_KEY in space.image
        if is_free and not space.use_image_pin and space.mode == 'VIEW':
            _show(window, area, image)


def show(context, image):
    """Shows it in an Image Editor; where there is none, soon, in a window of its own."""
    found = editors(context)
    if found:
        _show(*found[0], image)
        return
    window, name = context.window, image.name

    def open_window():
        """Later: Blender never ends a modal operator that opens a window."""
        image = bpy.data.images.get(name)
        if image is not None and window in list(bpy.context.window_manager.windows):
            _show(*_new_editor(window), image)

    bpy.app.timers.register(open_window, first_interval=0.0)


def _new_editor(window):
    """(window, area) of an Image Editor in a window of its own, over the largest area of this one."""
    before = set(bpy.context.window_manager.windows)
    with bpy.context.temp_override(window=window, area=_largest(window)):
        bpy.ops.screen.area_dupli('INVOKE_DEFAULT')
    made = next(w for w in bpy.context.window_manager.windows if w not in before)
    area = _largest(made)
    area.ui_type = 'IMAGE_EDITOR'
    return made, area


def _largest(window):
    return max(window.screen.areas, key=lambda area: area.width * area.height)


def _show(window, area, image):
    area.spaces.active.image = image
    region = next(r for r in area.regions if r.type == 'WINDOW')
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.image.view_all(fit_view=True)
    area.tag_redraw()
