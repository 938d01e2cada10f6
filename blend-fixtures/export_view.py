"""The splats of a scene of this folder and its camera, as files for the command-line tool.

    blender -b --factory-startup --addons stipple --python-exit-code 1 --python blend-fixtures/export_view.py -- \
        SCENE.blend OUT_FOLDER ANCHORS WIDTH HEIGHT

Writes NAME.ply, in the scene's own frame, and NAME.json, a transforms.json with one camera.
"""
import json
import pathlib
import shutil
import sys

import bpy


def make_splats(anchors):
    """Every mesh and instance of the scene as one set of splats."""
    for item in bpy.context.view_layer.objects:
        is_source = item.type == 'MESH' or item.instance_type == 'COLLECTION'
        item.select_set(is_source)
        if is_source:
            bpy.context.view_layer.objects.active = item
    result = bpy.ops.stipple.splats_from_mesh(anchors=anchors, seed=0)
    if 'FINISHED' not in result:
        raise RuntimeError(f'splats_from_mesh ended as {result}')


def write_camera(scene, path, width, height):
    from stipple.scene.view import cameras
    camera = cameras.from_parts(scene.camera.data, scene.camera.matrix_world, width, height)
    path.write_text(json.dumps({
        'w': width, 'h': height, 'fl_x': camera.fx, 'fl_y': camera.fy, 'cx': camera.cx, 'cy': camera.cy,
        'frames': [{'file_path': 'view.png', 'transform_matrix': [list(row) for row in scene.camera.matrix_world]}]}))


def main():
    source, out, anchors, width, height = sys.argv[sys.argv.index('--') + 1:][:5]
    source, out = pathlib.Path(source).resolve(), pathlib.Path(out).resolve()
    out.mkdir(parents=True, exist_ok=True)
    # The add-on keeps a scene's splats beside the file: work on a copy.
    bpy.ops.wm.open_mainfile(filepath=str(shutil.copy(source, out / source.name)))
    make_splats(int(anchors))
    write_camera(bpy.context.scene, out / f'{source.stem}.json', int(width), int(height))
    bpy.ops.stipple.splats_export(filepath=str(out / f'{source.stem}.ply'), budget='FULL', up_axis='Z')


main()
