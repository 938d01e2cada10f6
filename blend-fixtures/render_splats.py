"""The splats of a scene of this folder, rendered by Stipple: what the tests compare, and what reference/ holds.

    blender -b --factory-startup --addons stipple --python-exit-code 1 --python blend-fixtures/render_splats.py -- \
        SCENE.blend OUT_FOLDER

Writes plain.png; moved.png, from a camera that stands aside by MOVED_PX; and reseeded.png, from other anchors. The
last two have to fail where the first passes. To renew reference/NAME_stipple.png after a change that is meant to
change images, look at plain.png and copy it there.
"""
import pathlib
import shutil
import sys

import bpy
from mathutils import Vector

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import base_colours  # noqa: E402 (found beside this file)

ANCHORS = 20_000
MOVED_PX = 6.0


def make_splats():
    """Every mesh and instance of the scene as one set of splats."""
    for item in bpy.context.view_layer.objects:
        is_source = item.type == 'MESH' or item.instance_type == 'COLLECTION'
        item.select_set(is_source)
        if is_source:
            bpy.context.view_layer.objects.active = item
    result = bpy.ops.stipple.splats_from_mesh(anchors=ANCHORS, seed=0)
    if 'FINISHED' not in result:
        raise RuntimeError(f'splats_from_mesh ended as {result}')
    return bpy.context.view_layer.objects.active


def move_camera(scene, pixels):
    """Moves the camera sideways until what lies at the splats' distance has moved by some pixels."""
    camera = scene.camera
    distance = camera.matrix_world.translation.length  # the scenes stand at the origin
    width_px = scene.render.resolution_x * scene.render.resolution_percentage / 100.0
    metres_per_pixel = distance * camera.data.sensor_width / camera.data.lens / width_px
    camera.location += camera.matrix_world.to_3x3() @ Vector((pixels * metres_per_pixel, 0.0, 0.0))


def main():
    source, out = (pathlib.Path(argument).resolve() for argument in sys.argv[sys.argv.index('--') + 1:][:2])
    out.mkdir(parents=True, exist_ok=True)
    # The add-on keeps a scene's splats beside the file: work on a copy.
    scene_file = shutil.copy(source, out / source.name)
    bpy.ops.wm.open_mainfile(filepath=str(scene_file))
    scene = bpy.context.scene
    splats = make_splats()
    base_colours.prepare_image(scene)
    scene.render.engine = 'STIPPLE'
    base_colours.render_image(scene, out / 'plain.png')
    splats.data.stipple.seed = 1
    base_colours.render_image(scene, out / 'reseeded.png')
    splats.data.stipple.seed = 0
    move_camera(scene, MOVED_PX)
    base_colours.render_image(scene, out / 'moved.png')


main()
