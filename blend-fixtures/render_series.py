"""A series of ten splat files, made here, and its frames rendered by Stipple: what the tests compare, and what
reference/series_00NN.png hold.

    blender -b --factory-startup --addons stipple --python-exit-code 1 --python blend-fixtures/render_series.py -- OUT_FOLDER

A ring of 3,000 splats that turns inside out over ten frames. It plays on the left as the files say; on the right
another object of the same files plays to and fro at half speed with a third of the splats. To renew the stored
images after a change that is meant to change images, look at OUT_FOLDER/series_00NN.png and copy them.
"""
import pathlib
import sys

import bpy
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import base_colours  # noqa: E402 (found beside this file)

COUNT = 3000
FRAMES = 10
WIDTH, HEIGHT = 200, 100


def binding():
    """The add-on's binding, whatever the add-on's name in this Blender."""
    name = next(module for module in sys.modules if module.rpartition('.')[2] == 'stipple')
    return sys.modules[name]


def ring(frame):
    """Splats of one frame, 1 to FRAMES, as arrays: flat discs along a torus, with harmonics of degree 1."""
    stipple = binding()
    index = np.arange(COUNT)
    phase = 2 * np.pi * (frame - 1) / FRAMES
    around = 2 * np.pi * np.mod(index * 0.6180339887498949, 1.0)   # even at any count: multiples of the golden ratio
    inside = 2 * np.pi * np.mod(index * 0.7548776662466927, 1.0) + phase
    tube = 0.32 + 0.08 * np.sin(3 * around + phase)
    normal = np.stack([np.cos(around) * np.cos(inside), np.sin(around) * np.cos(inside), np.sin(inside)], 1)
    centre = np.stack([np.cos(around), np.sin(around), 0.2 * np.sin(2 * around - phase)], 1)
    positions = centre + tube[:, None] * normal
    # The shortest rotation from z to the normal; a normal of -z is never reached exactly.
    rotations = np.stack([1 + normal[:, 2], -normal[:, 1], normal[:, 0], np.zeros(COUNT)], 1)
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    colour = 0.5 + 0.45 * np.cos(around[:, None] + np.array([0.0, 2.1, 4.2]))
    harmonics = np.zeros((COUNT, 4, 3))
    harmonics[:, 0] = (colour - 0.5) / 0.28209479177387814
    harmonics[:, 1:] = 0.15 * normal[:, [1, 2, 0], None]
    scales = np.tile([0.05, 0.05, 0.006], (COUNT, 1))
    arrays = stipple.binding.cloud.SplatArrays(
        *(a.astype(np.float32) for a in (positions, rotations, scales, np.full(COUNT, 0.9), harmonics)),
        frame=stipple.binding.structs.Frame.RFU)
    return stipple.binding.cloud.Cloud.create(stipple.scene.source.sources.context(), arrays)


def load(folder, name, x):
    bpy.ops.stipple.splats_import(filepath=str(folder / 'ring_0001.ply'), as_sequence=True, up_axis='Z')
    obj = bpy.context.object
    obj.name = obj.data.name = name
    obj.location.x = x
    obj.rotation_euler = (0.9, 0.0, 0.3)
    return obj


def main():
    out = pathlib.Path(sys.argv[sys.argv.index('--') + 1]).resolve()
    files = out / 'files'
    files.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)  # add-ons stay, in every version
    for frame in range(1, FRAMES + 1):
        ring(frame).save(str(files / f'ring_{frame:04d}.ply'), frame=binding().binding.structs.Frame.RFU)
    load(files, 'Ring', -1.55)
    second = load(files, 'Second Ring', 1.55).data.stipple
    second.frame_speed, second.sequence_mode, second.frame_duration = 0.5, 'PING_PONG', 4
    second.ratio_render = 1 / 3
    scene = bpy.context.scene
    camera = bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera'))
    camera.data.type, camera.data.ortho_scale = 'ORTHO', 6.2
    camera.location.z = 10.0
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    scene.frame_start, scene.frame_end = 1, FRAMES
    base_colours.prepare_image(scene)
    scene.render.engine = 'STIPPLE'
    scene.render.filepath = str(out / 'series_####')
    bpy.ops.wm.save_as_mainfile(filepath=str(out / 'series.blend'))
    bpy.ops.render.render(animation=True)


main()
