"""crossing.blend, crowd.blend and a keyframed budget under both engines: what the tests compare, and what reference/
holds.

    blender -b --factory-startup --addons stipple --python-exit-code 1 --python blend-fixtures/render_shots.py -- \
        OUT_FOLDER

Writes crossing.png and crowd.png by Stipple, NAME_cycles.png by Cycles + Stipple, budget_000N.png and
budget_cycles_000N.png. Images that must not pass: crossing_first.png and crossing_second.png, one ring each, and
crowd_less.png, with 199 instances. crossing_merged.png, both rings as one object, must be crossing.png. To renew the
stored images after a change that is meant to change images, look at them and copy crossing.png, crowd.png and the
six of the budget to reference/.
"""
import pathlib
import sys

import bpy

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import base_colours  # noqa: E402 (found beside this file)
import make_shots  # noqa: E402

ENGINES = {'': 'STIPPLE', '_cycles': 'STIPPLE_CYCLES'}


def under_both_engines(scene, out, name):
    base_colours.prepare_cycles(scene, samples=4)  # nothing but splats: no noise
    for suffix, engine in ENGINES.items():
        scene.render.engine = engine
        base_colours.render_image(scene, out / f'{name}{suffix}.png')
    scene.render.engine = 'STIPPLE'


def render_crossing(out):
    bpy.ops.wm.open_mainfile(filepath=str(HERE / 'crossing.blend'))
    scene, objects = bpy.context.scene, bpy.data.objects
    under_both_engines(scene, out, 'crossing')
    for name, other in (('first', 'Second'), ('second', 'First')):
        objects[other].hide_render = True
        base_colours.render_image(scene, out / f'crossing_{name}.png')
        objects[other].hide_render = False
    for obj in (objects['Second'], objects['First']):
        obj.select_set(True)
        bpy.context.view_layer.objects.active = obj
    assert bpy.ops.stipple.merge_splats() == {'FINISHED'}
    base_colours.render_image(scene, out / 'crossing_merged.png')


def render_crowd(out):
    bpy.ops.wm.open_mainfile(filepath=str(HERE / 'crowd.blend'))
    scene = bpy.context.scene
    under_both_engines(scene, out, 'crowd')
    # A vertex in the middle of the first row loses its instance.
    ground = bpy.data.objects['Ground'].data
    ground.attributes['size'].data[9].value = 0.0
    ground.update()
    base_colours.render_image(scene, out / 'crowd_less.png')


def render_budget(out):
    """A tree of splats around an emitting ball, with 60, 400 and 6,000 splats at frames 1, 2 and 3."""
    scene = make_shots.new_scene((0.0, -2.6, 1.1), (0.0, 0.0, 0.5))
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    bpy.ops.wm.save_as_mainfile(filepath=str(out / 'budget.blend'))
    tree = make_shots.add_splats('Tree', make_shots.tree(6000))
    bpy.context.view_layer.objects.active = tree
    assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    settings = tree.data.stipple
    settings.budget_by = 'COUNT'
    for frame, count in ((1, 60), (2, 400), (3, 6000)):
        settings.anchors = count
        settings.keyframe_insert('anchors', frame=frame)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=0.25, location=(0.22, -0.2, 0.55))
    ball = bpy.context.object
    for polygon in ball.data.polygons:
        polygon.use_smooth = True
    material = bpy.data.materials.new('Ball')
    base_colours.use_nodes(material)
    shader = next(node for node in material.node_tree.nodes if node.type == 'BSDF_PRINCIPLED')
    shader.inputs['Base Color'].default_value = (0.8, 0.25, 0.1, 1.0)
    ball.data.materials.append(material)
    base_colours.emit_base_colours()
    scene.frame_start, scene.frame_end = 1, 3
    base_colours.prepare_cycles(scene)
    for suffix, engine in ENGINES.items():
        scene.render.engine = engine
        scene.render.filepath = str(out / f'budget{suffix}_####')
        bpy.ops.render.render(animation=True)


def main():
    out = pathlib.Path(sys.argv[sys.argv.index('--') + 1]).resolve()
    out.mkdir(parents=True, exist_ok=True)
    render_crossing(out)
    render_crowd(out)
    render_budget(out)


main()
