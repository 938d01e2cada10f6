"""Splats that follow meshes, rendered by Stipple: what the tests compare, and what reference/bound_00NN.png hold.

    blender -b --factory-startup --addons stipple --python-exit-code 1 --python blend-fixtures/render_bound.py -- OUT_FOLDER

Writes bound_0001.png, bound_0010.png and bound_0020.png of bound.blend. Of the arm alone at frame 20, from nearer: as
its splats follow (arm_bound.png), as splats that are made of the bent arm anew (arm_anew.png), and at rest
(arm_rest.png). To renew the stored images after a change that is meant to change images, look at OUT_FOLDER and copy
them.
"""
import pathlib
import shutil
import sys

import bpy

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import base_colours  # noqa: E402 (found beside this file)

FRAMES = (1, 10, 20)
ARM_SPLATS = 8000


def main():
    out = pathlib.Path(sys.argv[sys.argv.index('--') + 1]).resolve()
    (out / 'stipple').mkdir(parents=True, exist_ok=True)
    # Work on a copy: sources are written beside the file.
    for name in ('bound.blend', 'stipple/Head.spz', 'stipple/Arm.spz'):
        shutil.copy(HERE / name, out / name)
    bpy.ops.wm.open_mainfile(filepath=str(out / 'bound.blend'))
    scene = bpy.context.scene
    for frame in FRAMES:
        scene.frame_set(frame)
        base_colours.render_image(scene, out / f'bound_{frame:04d}.png')
    head, arm, splats = (bpy.data.objects[name] for name in ('Head', 'Arm', 'Arm Splats'))
    head.hide_render = True
    scene.camera.location.x, scene.camera.data.lens = arm.location.x, 90.0
    base_colours.render_image(scene, out / 'arm_bound.png')
    splats.data.stipple.bind_follow = False
    base_colours.render_image(scene, out / 'arm_rest.png')
    splats.hide_render = True
    arm.hide_set(False)
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj == arm)
    bpy.context.view_layer.objects.active = arm
    bpy.ops.stipple.splats_from_mesh(anchors=ARM_SPLATS)
    base_colours.render_image(scene, out / 'arm_anew.png')


main()
