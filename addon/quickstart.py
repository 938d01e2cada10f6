"""Run by quickstart.sh inside Blender: the mesh of a scene as splats at three budgets, and what they can become.

    blender -b --addons stipple --python addon/quickstart.py -- OUT_FOLDER STIPPLE_TOOL
"""
import contextlib
import json
import os
import pathlib
import subprocess
import sys
import time

import bpy

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'blend-fixtures'))
import base_colours  # noqa: E402 (lies with the scenes)

BUDGETS = (2_000, 10_000, 50_000)
VOLUME_RESOLUTION = 192
VOLUME_SAMPLES = 8
OUT, TOOL = (pathlib.Path(argument).resolve() for argument in sys.argv[sys.argv.index('--') + 1:][:2])


def say(text):
    print(f'     {text}', flush=True)


@contextlib.contextmanager
def quietly():
    """Keeps Blender's own lines about every sample and file off the terminal."""
    sys.stdout.flush()
    terminal, silence = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(terminal, 1)
        os.close(terminal)
        os.close(silence)


def open_scene():
    with quietly():
        bpy.ops.wm.open_mainfile(filepath=str(OUT / 'suzanne.blend'))
    scene = bpy.context.scene
    scene.render.resolution_percentage = 200
    base_colours.prepare_image(scene)
    return scene


def timed(function, *arguments, **settings):
    start = time.perf_counter()
    with quietly():
        result = function(*arguments, **settings)
    if isinstance(result, set) and 'FINISHED' not in result:
        raise RuntimeError(f'{function} ended as {result}')
    return time.perf_counter() - start


def psnr(path):
    """dB between an image and the mesh's."""
    result = subprocess.run([str(TOOL), 'compare', str(OUT / 'mesh.png'), str(path), '--json'],
                            check=True, capture_output=True, text=True)
    return json.loads(result.stdout)['psnr']


def write_camera(scene):
    """The scene's camera as transforms.json, for the command-line tool."""
    render, camera = scene.render, scene.camera.data
    width = render.resolution_x * render.resolution_percentage // 100
    height = render.resolution_y * render.resolution_percentage // 100
    focal = camera.lens / camera.sensor_width * width  # the scene's sensor fits the longer side, its width
    matrix = [[round(value, 9) for value in row] for row in scene.camera.matrix_world]
    content = {'w': width, 'h': height, 'fl_x': focal, 'fl_y': focal, 'cx': width / 2, 'cy': height / 2,
               'frames': [{'file_path': 'mesh.png', 'transform_matrix': matrix}]}
    (OUT / 'transforms.json').write_text(json.dumps(content, indent=1))


def main():
    scene = open_scene()
    write_camera(scene)
    say('mesh.png: the base colours of the mesh, by Cycles')
    timed(base_colours.render_base_colours, scene, OUT / 'mesh.png')

    scene = open_scene()
    bpy.ops.object.select_all(action='DESELECT')
    mesh = bpy.data.objects['Suzanne']
    mesh.select_set(True)
    bpy.context.view_layer.objects.active = mesh
    seconds = timed(bpy.ops.stipple.splats_from_mesh, anchors=1_000,
                    source_path=str(OUT / 'suzanne.stipple.safetensors'))
    say(f'mesh to density, and a first 1,000 splats: {seconds:.2f} s')
    splats = bpy.context.view_layer.objects.active

    rows = []
    scene.render.engine = 'STIPPLE'
    for budget in BUDGETS:
        decode = timed(setattr, splats.data.stipple, 'anchors', budget)
        picture = OUT / f'splats_{budget}.png'
        say(f'{picture.name}: F12 with engine Stipple')
        render = timed(base_colours.render_image, scene, picture)
        gaussians = budget * splats.data.stipple.gaussians_per_anchor
        rows.append((budget, gaussians, decode, render, psnr(picture)))

    say('suzanne.ply: the splats as other viewers read them')
    timed(bpy.ops.stipple.splats_export, filepath=str(OUT / 'suzanne.ply'))
    say('suzanne.vdb: the splats as a volume')
    seconds = timed(bpy.ops.stipple.splats_to_volume, filepath=str(OUT / 'suzanne.vdb'), resolution=VOLUME_RESOLUTION)
    splats.hide_render = True
    base_colours.prepare_cycles(scene, VOLUME_SAMPLES)
    say(f'volume.png: that volume ({seconds:.2f} s), by Cycles')
    render = timed(base_colours.render_image, scene, OUT / 'volume.png')
    with quietly():
        bpy.ops.wm.save_as_mainfile(filepath=str(OUT / 'suzanne_splats.blend'))

    print(f'\n{"anchors":>9} {"Gaussians":>10} {"decode s":>9} {"picture s":>10} {"PSNR dB":>8}')
    for budget, gaussians, decode, picture, quality in rows:
        print(f'{budget:>9,} {gaussians:>10,} {decode:>9.3f} {picture:>10.2f} {quality:>8.2f}')
    print(f'{"volume":>9} {"":>10} {seconds:>9.3f} {render:>10.2f} {psnr(OUT / "volume.png"):>8.2f}')
    print("PSNR is against the mesh's base colours rendered by Cycles, 640 x 480, over colours and alpha.")
    print(f'Everything is in {OUT}', flush=True)


main()
