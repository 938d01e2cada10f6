# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_collect_for_training_window.py inside the Blender with a window; window.py runs them."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402
from fit_steps import press  # noqa: E402

OUT = Path(sys.argv[sys.argv.index('--') + 2])
FEW, MANY = 8, 80
QUICK = {'image_size': 32, 'samples': 1, 'points': 100}
facts = {}


def state(window):
    """What has to be as it was: data, selection, what the window shows."""
    data = {prop.identifier: sorted(entry.name for entry in getattr(bpy.data, prop.identifier))
            for prop in bpy.data.bl_rna.properties if prop.type == 'COLLECTION'}
    data['images'] = [name for name in data['images'] if name != 'Render Result']  # Blender's own
    space = window.space
    return [data, sorted(obj.name for obj in bpy.context.selected_objects), window.window.scene.name,
            window.region_data.view_perspective, space.camera.name, bpy.context.scene.render.engine]


def collecting():
    return 'Stipple Studio' in bpy.data.scenes


def build(window):
    """A rigged ball, which a file gets too, and a view through the camera."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    (OUT / 'assets').mkdir()
    with window.context():
        ball = scenes.sphere('Ball', 32, 16)
        scenes.material('Red', obj=ball)
        bpy.ops.object.armature_add()
        rig = bpy.context.object
        ball.vertex_groups.new(name='Bone').add(range(len(ball.data.vertices)), 1.0, 'REPLACE')
        ball.modifiers.new('Rig', 'ARMATURE').object = rig
        ball.parent = rig
        bpy.ops.export_scene.gltf(filepath=str(OUT / 'assets' / 'rigged.glb'))
        cube = scenes.quad('Quad')
        camera = scenes.camera()
        camera.data.type = 'PERSP'
        scenes.select(cube)
        made = bpy.data.collections.new('Objects')
        for obj in (ball, rig, cube):
            made.objects.link(obj)
        bpy.context.scene.collection.children.link(made)
        window.region_data.view_perspective = 'CAMERA'
        bpy.ops.ed.undo_push(message='before')


def seen(window):
    facts['before'] = state(window)
    return 'before'


def open_menu(window):
    with window.context():
        bpy.ops.wm.call_menu(name='TOPBAR_MT_file_export')


def menu(_window):
    return 'menu'


def escape(window):
    press(window, 'ESC')


def collect(window, view_count):
    with window.context():
        bpy.ops.stipple.collect_for_training(directory=str(OUT / 'out'), source='COLLECTION', collection='Objects',
                                             view_count=view_count, **QUICK)


def collect_many(window):
    collect(window, MANY)


def collect_few(window):
    collect(window, FEW)


def rendering(_window):
    if not collecting() or not (OUT / 'out' / 'Armature' / 'images' / '0003.png').exists():
        return False
    return 'rendering'


def press_undo(window):
    """Nothing of the file may change meanwhile."""
    region = window.region
    for value in ('PRESS', 'RELEASE'):
        window.window.event_simulate(type='Z', value=value, ctrl=True, x=region.x + 200, y=region.y + 200)


def still_rendering(_window):
    facts['rendering_after_undo'] = collecting() and 'Quad' in bpy.data.objects


def cancelled(window):
    if collecting():
        return False
    facts['cancelled'] = state(window)
    facts['files_after_cancel'] = sorted(path.name for path in (OUT / 'out' / 'Armature').iterdir())
    return 'cancelled'


def done(window):
    if collecting() or not (OUT / 'out' / 'Quad' / 'transforms.json').exists():
        return False
    facts['done'] = state(window)
    return 'done'


def collect_folder(window):
    with window.context():
        bpy.ops.stipple.collect_for_training(directory=str(OUT / 'out'), source='FOLDER',
                                             assets_folder=str(OUT / 'assets'), view_count=FEW, **QUICK)


def folder_done(window):
    if collecting() or not (OUT / 'out' / 'rigged' / 'transforms.json').exists():
        return False
    facts['folder_done'] = state(window)
    return 'folder'


steps = [build, seen, open_menu, menu, escape, collect_many, rendering, press_undo, still_rendering, escape, cancelled,
         collect_few, done, collect_folder, folder_done]
