# SPDX-License-Identifier: GPL-3.0-or-later
"""What bench_large.py measures, each step in a Blender of its own.

    blender --background --factory-startup --python large_steps.py -- STEP RESULT.json ARGUMENTS.json

In a window window.py runs `steps`, with the same three arguments behind its own.
"""

import contextlib
import gc
import json
import math
import sys
import time
from pathlib import Path

import bpy
from mathutils import Euler, Vector

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import scenes  # noqa: E402

SIZE = (1920, 1080)
CYCLES_SAMPLES = 16
FRAMES = 10
# Budget of the viewport that sliders start from and move around.
BUDGET = 500_000
MOVES = 10

results = {}


@contextlib.contextmanager
def measured(name):
    """Notes the seconds that the block takes, processor seconds of all threads, and the most main memory that the
    process has meanwhile, MiB."""
    Path('/proc/self/clear_refs').write_text('5')  # the peak starts anew
    begin, work = time.perf_counter(), time.process_time()
    yield
    results[name] = (time.perf_counter() - begin, time.process_time() - work, _peak_mib())


def _peak_mib():
    lines = Path('/proc/self/status').read_text().splitlines()
    return int(next(line for line in lines if line.startswith('VmHWM')).split()[1]) / 1024


def import_splats(cloud, blend):
    with measured('import'):
        bpy.ops.stipple.splats_import(filepath=cloud, up_axis='Z')
    build_scene()
    save(blend, 'file')


def add_budget(blend, reduced):
    bpy.ops.wm.open_mainfile(filepath=blend)
    splats = the_splats()
    scenes.select(splats)
    with measured('tree'):
        bpy.ops.stipple.add_budget()
    splats.data.stipple.budget_by = 'COUNT'
    splats.data.stipple.anchors = BUDGET
    splats.data.stipple.anchors_render = splats.data.stipple.source_count
    save(reduced, 'file')


def save(blend, name):
    with measured('save'):
        bpy.ops.wm.save_as_mainfile(filepath=blend)
    results[name] = Path(blend).stat().st_size


def render(blend, engine, with_splats=True):
    """F12: the second picture too, which finds what the first one left in memory."""
    with measured('open'):
        bpy.ops.wm.open_mainfile(filepath=blend)
    bpy.context.scene.render.engine = engine
    the_splats().hide_render = not with_splats
    for name in ('first', 'second'):
        with measured(name):
            bpy.ops.render.render()


def the_splats():
    return next(obj for obj in bpy.data.objects if obj.data is not None and obj.data.get('stipple_layout'))


def build_scene():
    """A ring and a ball before the splats, a lamp, and a camera that sees the whole and moves a little."""
    for location in ((-2.5, -4.0, 1.5), (3.0, -3.0, 1.2)):
        bpy.ops.mesh.primitive_torus_add(location=location, major_radius=1.2, minor_radius=0.3, rotation=(1.0, 0.3, 0))
    bpy.ops.object.light_add(type='SUN', rotation=(0.6, 0.3, 0.0))
    camera = scenes.camera((0.0, -15.0, 5.0), (math.radians(75), 0.0, 0.0), *SIZE, lens=28.0)
    camera.keyframe_insert('location', frame=1)
    camera.location.x = 1.0
    camera.keyframe_insert('location', frame=FRAMES)
    scene = bpy.context.scene
    scene.frame_end = FRAMES
    scene.cycles.samples, scene.cycles.use_denoising = CYCLES_SAMPLES, False


# In a window ---------------------------------------------------------------------------------------------------------

def draw(window):
    with window.context():
        bpy.ops.wm.redraw_timer(type='DRAW_WIN_SWAP', iterations=1)


def full_screen(window):
    with window.context():
        bpy.ops.screen.screen_full_area(use_hide_panels=True)


def measure_views(window):
    arguments = json.loads(Path(ARGUMENTS).read_text())
    if arguments['all_ellipses']:
        bpy.context.preferences.addons['stipple'].preferences.points_above = 1 << 24
    with measured('open'):
        bpy.ops.wm.open_mainfile(filepath=arguments['blend'], load_ui=False)
    window.window = bpy.context.window_manager.windows[0]
    view = window.region_data
    view.view_distance, view.view_location = 18.0, Vector((0.0, 0.0, 1.0))
    results['view size'] = [window.region.width, window.region.height]
    for name, turned in (('first view', 0.0), ('next view', 0.0), ('turned view', 0.3)):
        view.view_rotation = Euler((math.radians(75), 0.0, turned)).to_quaternion()
        with measured(name):
            draw(window)
    if the_splats().data.stipple.source_kind == 'TREE':
        move_slider(window)
    look_through_the_engine(window)


def move_slider(window):
    """Moves around BUDGET: the first, which does not know yet how long a splat takes, the median, and the rest
    after."""
    settings, sync = the_splats().data.stipple, sys.modules['stipple'].scene.source.sync
    moves = {'slider': [], 'slider drawn': []}
    for move in range(1, MOVES + 1):
        with measured('slider'):
            settings.anchors = BUDGET + 1000 * move
        with measured('slider drawn'):
            draw(window)
        for name, values in moves.items():
            values.append(results[name])
    results['slider begins'] = moves['slider'][0]
    results.update({name: sorted(values)[MOVES // 2] for name, values in moves.items()})
    while sys.modules['stipple'].scene.source.sources.is_reading():
        time.sleep(0.05)
    with measured('slider rests'):
        sync.complete()
    with measured('slider rests drawn'):
        draw(window)


def look_through_the_engine(window):
    """Rendered shading of the engine Stipple: the coarse picture, and the fine one."""
    bpy.context.scene.render.engine = 'STIPPLE'
    window.space.shading.type = 'RENDERED'
    with measured('rendered view'):
        draw(window)
    view_image = sys.modules['stipple.viewport.view_image']
    picture = next(thing for thing in gc.get_objects() if isinstance(thing, view_image.ViewImage))
    with measured('fine view'):
        while not (picture._shown is not None and picture._shown.is_fine):
            time.sleep(0.02)
            draw(window)


def write_results(_window):
    Path(RESULT).write_text(json.dumps(results))


steps = [full_screen, measure_views, write_results]
WHAT, RESULT, ARGUMENTS = sys.argv[-3:]

if __name__ == '__main__':
    bpy.ops.preferences.addon_enable(module='stipple')
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    {'import': import_splats, 'budget': add_budget, 'render': render}[WHAT](**json.loads(Path(ARGUMENTS).read_text()))
    write_results(None)
