# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_selection_window.py inside the Blender with a window; window.py runs them. All is done with the
mouse."""

import sys
from importlib import import_module
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402

facts = {'steps': {}}
RED, BLUE = (0.9, 0.1, 0.05), (0.1, 0.2, 0.9)
PANELS = {'panels.data': ('STIPPLE_PT_clean_up',), 'panels.selection': ('STIPPLE_PT_select',)}


def folder():
    return Path(sys.argv[sys.argv.index('--') + 2])


def addon(name):
    package = next(module for module in sys.modules if module.rpartition('.')[2] == 'stipple')
    return import_module('.' + name, package)


def walls():
    """A wall, red on the left and blue on the right, before another one, upright."""
    rng = np.random.default_rng(4)
    count = 8000
    cloud = addon('binding.cloud')
    positions = rng.uniform(-1.5, 1.5, (count, 3)) * (1, 0, 1)
    positions[count // 2:, 1] = 1.0
    display = np.where(positions[:, :1] < 0, RED, BLUE)
    return cloud.SplatArrays(positions.astype(np.float32), np.tile(np.float32((1, 0, 0, 0)), (count, 1)),
                             np.full((count, 3), 0.05, np.float32), np.full(count, 0.9, np.float32),
                             ((display - 0.5) / 0.28209479177387814).astype(np.float32).reshape(-1, 1, 3))


def open_panels():
    """Panels open at first, and nothing else of the object's data."""
    for module, names in PANELS.items():
        for name in names:
            panel = getattr(addon(module), name)
            bpy.utils.unregister_class(panel)
    for module, names in PANELS.items():
        for name in names:
            panel = getattr(addon(module), name)
            panel.bl_options = set()
            bpy.utils.register_class(panel)


def build(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    path = folder() / 'walls.ply'
    walls().to_cloud(addon('scene.source.sources').context()).save(str(path))
    with window.context():
        assert bpy.ops.stipple.splats_import(filepath=str(path), up_axis='Z') == {'FINISHED'}
        bpy.ops.view3d.view_axis(type='FRONT')
    window.obj = bpy.context.object
    window.region_data.view_distance = 6
    window.space.show_region_toolbar = True
    overlay = window.space.overlay
    overlay.show_floor = overlay.show_axis_x = overlay.show_axis_z = overlay.show_ortho_grid = False
    overlay.show_cursor = False
    open_panels()
    for area in window.window.screen.areas:
        if area.type == 'PROPERTIES':
            area.spaces.active.context = 'DATA'
    with window.context():
        bpy.ops.ed.undo_push(message='built')


def data():
    return bpy.context.object.data


def counts():
    return addon('scene.source.selecting').counts(data()) or (None, 0)


def note(name):
    facts['steps'][name] = counts()[1]


def tool(name):
    def step(window):
        with window.context():
            bpy.ops.wm.tool_set_by_id(name=name)
        facts.setdefault('tools', []).append(
            window.window.workspace.tools.from_space_view3d_mode('OBJECT', create=False).idname)
    return step


def at(window, x, y):
    """Pixels of the window for a place in the middle of the view, from its centre."""
    region = window.region
    return int(region.x + region.width / 2 + x), int(region.y + region.height / 2 + y)


def events(*wanted):
    """A step of simulated events, each (kind, value, place, keys that are held)."""
    def step(window):
        for kind, value, place, held in wanted:
            x, y = at(window, *place)
            window.window.event_simulate(type=kind, value=value, x=x, y=y, **{name: True for name in held})
    return step


def press(places, *held):
    """The events of a drag but the last: press at the first place, move through all others."""
    return [('MOUSEMOVE', 'NOTHING', places[0], held), ('LEFTMOUSE', 'PRESS', places[0], held),
            *(('MOUSEMOVE', 'NOTHING', place, held) for place in places[1:])]


def released(place, *held):
    return 'LEFTMOUSE', 'RELEASE', place, held


def drag(places, *held, shot=None):
    """Steps of a drag. shot: a picture before the button is released."""
    if shot is None:
        return [events(*press(places, *held), released(places[-1], *held))]
    return [events(*press(places, *held)), lambda _window: shot, events(released(places[-1], *held))]


def watch_preview(_window):
    """Notes what each update of a stroke shows, and how long it took."""
    preview = addon('operators.selection.stroke_preview').StrokePreview
    plain = preview.update
    facts['preview seconds'] = []

    def update(self, regions_of):
        taken = plain(self, regions_of)
        if taken > 0:
            facts['preview seconds'].append(taken)
            instead = addon('viewport.selected_points')._instead
            facts.setdefault('updates', []).append(sum(len(places) for _, places in instead.values()))
        return taken

    preview.update = update


def note_previewed(_window):
    facts['previewed'] = facts['updates'][-1]


def note_prepared(_window):
    sources = addon('scene.source.sources')
    facts.setdefault('prepared', []).append(bool(sources._whole))


def forget_source(_window):
    sources = addon('scene.source.sources')
    sources._whole.clear()
    sources._whole_ahead.clear()


def wait_for_source(_window):
    return None if addon('scene.source.sources')._whole else False


def key(kind, place=(0, 0)):
    return (kind, 'PRESS', place, ()), (kind, 'RELEASE', place, ())


def taken(name, shot=False):
    def step(_window):
        note(name)
        return name if shot else None
    return step


def undo(name):
    def step(window):
        with window.context():
            bpy.ops.ed.undo()
        note(name)
    return step


def settings():
    return bpy.context.scene.stipple.selection


def set_to(**values):
    def step(_window):
        for name, value in values.items():
            setattr(settings(), name, value)
    return step


def note_radius(name):
    def step(_window):
        facts.setdefault('radii', {})[name] = settings().radius
    return step


def note_distance(name):
    def step(window):
        facts.setdefault('distances', {})[name] = window.region_data.view_distance
    return step


def zoom_back(window):
    window.region_data.view_distance = facts['distances']['before']


def note_theme(window):
    region = window.region
    facts['view'] = [region.x, region.y, region.width, region.height]
    facts['theme'] = list(bpy.context.preferences.themes[0].view_3d.vertex_select)


def note_color(_window):
    operator = bpy.context.window_manager.operators[-1]
    facts['color'] = list(operator.properties['color'])


def press_panel_button(name):
    """What a button of the panel does, from the Properties editor."""
    def step(window):
        area = next(a for a in window.window.screen.areas if a.type == 'PROPERTIES')
        region = next(r for r in area.regions if r.type == 'WINDOW')
        with bpy.context.temp_override(window=window.window, screen=window.window.screen, area=area, region=region):
            bpy.ops.wm.tool_set_by_id(name=name, space_type='VIEW_3D')
        facts['tool_of_button'] = (
            window.window.workspace.tools.from_space_view3d_mode('OBJECT', create=False).idname)
    return step


def quad_view(window):
    with window.context():
        bpy.ops.screen.region_quadview()


def quad_drag(window):
    """A click in the middle of the first of the four regions, which has a view of its own."""
    regions = [region for region in window.area.regions if region.type == 'WINDOW']
    facts['regions'] = len(regions)
    region = regions[0]
    facts['quad expected'] = in_circle(region)
    x, y = region.x + region.width // 2, region.y + region.height // 2
    for kind, value in (('MOUSEMOVE', 'NOTHING'), ('LEFTMOUSE', 'PRESS'), ('LEFTMOUSE', 'RELEASE')):
        window.window.event_simulate(type=kind, value=value, x=x, y=y)


def in_circle(region):
    """Splats that a click in the middle of a region should select."""
    positions = addon('scene.source.splat_data').read(data()).positions
    matrix = np.array(region.data.perspective_matrix) @ np.array(bpy.context.object.matrix_world)
    clip = np.c_[positions, np.ones(len(positions))] @ matrix.T
    pixels = (0.5 + 0.5 * clip[:, :2] / clip[:, 3:]) * (region.width, region.height)
    middle = region.width // 2 + 0.5, region.height // 2 + 0.5
    return int((np.linalg.norm(pixels - middle, axis=1) <= settings().radius).sum())


def panoramic_camera(window):
    camera = scenes.camera((0, -6, 0), (np.pi / 2, 0, 0), type='PANO')
    addon('version').panorama_settings(camera.data).panorama_type = 'EQUIRECTANGULAR'
    scene = window.window.scene
    scene.render.engine = 'STIPPLE'
    window.region_data.view_perspective = 'CAMERA'
    window.space.shading.type = 'RENDERED'


def plain_view(window):
    window.space.shading.type = 'SOLID'
    window.region_data.view_perspective = 'ORTHO'
    with window.context():
        bpy.ops.view3d.view_axis(type='FRONT')
    window.region_data.view_distance = 6


def erase(window):
    with window.context():
        assert bpy.ops.stipple.erase_selected('INVOKE_DEFAULT') == {'FINISHED'}


def disable_and_enable(_window):
    """Tools go and come with the add-on."""
    import addon_utils
    for act, name in ((addon_utils.disable, 'disabled'), (addon_utils.enable, 'enabled')):
        act('stipple')
        facts[name] = tool_names()


def tool_names():
    from bl_ui.space_toolsystem_common import ToolSelectPanelHelper
    tools = ToolSelectPanelHelper._tool_class_from_space_type('VIEW_3D')
    found = tools._tools_flatten(tools.tools_from_context(bpy.context, mode='OBJECT'))
    return [item.idname for item in found if item is not None and item.idname.startswith('stipple.')]


LINE = ((-120, 60), (-60, 70), (0, 60), (60, 70), (120, 60))
OUTLINE = ((-100, -100), (100, -100), (100, 20), (20, 20), (-100, 20))
WHEEL = ('WHEELUPMOUSE', 'PRESS', (10, 0), ())
steps = [build, note_theme, watch_preview, forget_source, note_prepared, tool('stipple.select_brush'), wait_for_source,
         note_prepared, events(('MOUSEMOVE', 'NOTHING', (0, -60), ())),
         lambda _window: 'hover', *drag(LINE, shot='stroke'), note_previewed, taken('brush', True),
         *drag(((-120, 60), (-60, 70)), 'ctrl'), taken('subtracted'), *drag(((0, -60), (20, -60)), 'shift'),
         taken('added'), undo('undone'), undo('undone_twice'),
         events(('MOUSEMOVE', 'NOTHING', (20, -60), ())), lambda _window: 'before_cancel',
         events(*press(((0, -60), (20, -60))), *key('ESC'), released((20, -60))), taken('cancelled', True),
         set_to(radius=40), events(*key('RIGHT_BRACKET')), note_radius('larger'),
         events(*key('LEFT_BRACKET'), *key('LEFT_BRACKET')), note_radius('smaller'), note_distance('before'),
         events(*press(((0, 0), (10, 0))), WHEEL, WHEEL, released((10, 0))), note_radius('wheel'),
         note_distance('after'), events(WHEEL), note_distance('zoomed'), zoom_back, set_to(radius=40),
         events(*key('F')), events(('MOUSEMOVE', 'NOTHING', (30, 0), ())),
         events(*press(((30, 0),)), released((30, 0))),
         note_radius('dragged'), set_to(radius=40, front_only=True), *drag(LINE), taken('front'),
         set_to(front_only=False), press_panel_button('stipple.select_lasso'), *drag(OUTLINE, shot='lasso'),
         taken('lasso'), lambda _window: 'lasso_done', tool('stipple.select_sphere'),
         *drag(((40, 0), (80, 30), (100, 40)), shot='sphere'),
         taken('sphere'), tool('stipple.select_color'), *drag(((-80, 0),)), note_color, taken('color', True),
         tool('stipple.select_brush'), quad_view, quad_drag, taken('quad', True), quad_view, panoramic_camera,
         *drag(LINE),
         taken('panorama', True), plain_view, lambda _window: None, *drag(LINE), erase, taken('erased'),
         lambda _window: 'erased', disable_and_enable]
