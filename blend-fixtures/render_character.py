"""character.blend under both engines: what the tests compare, and what reference/ holds.

    blender -b --factory-startup --addons stipple --python-exit-code 1 --python blend-fixtures/render_character.py -- \
        OUT_FOLDER

Writes cycles.png (Cycles + Stipple) and matte.png (Stipple, where the character is a hole); without_shadow.png and
before_column.png, in which the shadow or the order of depth is another: they have to fail where the first passes. To
renew reference/character_*.png after a change that is meant to change images, look at them and copy the first two.
"""
import pathlib
import sys

import bpy

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import base_colours  # noqa: E402 (found beside this file)


def main():
    out = pathlib.Path(sys.argv[sys.argv.index('--') + 1]).resolve()
    out.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.open_mainfile(filepath=str(HERE / 'character.blend'))
    scene = bpy.context.scene
    objects = bpy.data.objects
    scene.render.engine = 'STIPPLE_CYCLES'
    base_colours.render_image(scene, out / 'cycles.png')
    objects['Catcher'].hide_render = True
    base_colours.render_image(scene, out / 'without_shadow.png')
    objects['Catcher'].hide_render = False
    objects['Character'].location.y = -2.0
    base_colours.render_image(scene, out / 'before_column.png')
    objects['Character'].location.y = 0.0
    scene.render.engine = 'STIPPLE'
    scene.render.film_transparent = True
    base_colours.render_image(scene, out / 'matte.png')


main()
