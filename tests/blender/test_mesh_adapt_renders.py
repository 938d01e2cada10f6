# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that take the shape of what Cycles renders: Adapt Mesh to Renders."""

import importlib
import re

import bpy
import numpy as np
import pytest

import scenes
from test_mesh_adapt import coordinates, distances, keeps, refusal, shown, template
from test_view_capture import settings_of

QUICK = {'view_count': 8, 'samples': 2, 'image_size': 48, 'steps': 120}


@pytest.fixture(autouse=True)
def sky():
    """A grey light from everywhere."""
    bpy.context.scene.world = bpy.data.worlds.new('Sky')
    bpy.context.scene.world.color = (0.5, 0.5, 0.5)


def flat(name='Flat'):
    """A ball that is a third as high as wide."""
    obj = scenes.sphere(name, 32, 16)
    for vertex in obj.data.vertices:
        vertex.co.z *= 0.35
    scenes.material('Clay', obj=obj)
    bpy.context.view_layer.update()
    return obj


def adapt(obj, *others, **settings):
    scenes.select(obj, *others)
    return bpy.ops.stipple.mesh_adapt_to_renders(**{**QUICK, **settings})


def radii(obj):
    return np.linalg.norm(shown(obj), axis=1)


def facts():
    """All of a scene that renders set meanwhile."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    owners = [scene, scene.render, scene.render.image_settings, scene.cycles, layer, layer.cycles, *scene.objects]
    return ([settings_of(owner) for owner in owners], sorted(bpy.data.objects.keys()), sorted(bpy.data.cameras.keys()),
            scene.camera, layer.objects.active, [obj.name for obj in layer.objects.selected],
            [(marker.name, marker.camera) for marker in scene.timeline_markers],
            [obj.data.shape_keys for obj in scene.objects if obj.type == 'MESH'])


# ---- the shape ----------------------------------------------------------------------------------

def test_a_ball_takes_the_shape_that_cycles_shows(stipple, capfd):
    """A flat ball whose material displaces it: no mesh in the scene has that shape."""
    target, obj = flat(), template()
    tree = target.active_material.node_tree
    node = tree.nodes.new('ShaderNodeDisplacement')
    node.inputs['Height'].default_value, node.inputs['Midlevel'].default_value = 1.0, 0.0
    node.inputs['Scale'].default_value = 0.2
    output = next(n for n in tree.nodes if n.type == 'OUTPUT_MATERIAL')
    tree.links.new(node.outputs[0], output.inputs['Displacement'])
    owner = target.active_material
    (owner if hasattr(owner, 'displacement_method') else owner.cycles).displacement_method = 'DISPLACEMENT'
    kept, before = keeps(obj), coordinates(obj.data.vertices)
    assert adapt(obj, target) == {'FINISHED'}
    assert re.search(r"'Ball' differed from 8 renders of 'Flat' by \d+\.\d\d% on average, and differs by 0\.\d\d% now",
                     capfd.readouterr().out)
    keys = obj.data.shape_keys
    assert [key.name for key in keys.key_blocks] == ['Basis', 'Adapted to Flat'] and keys.key_blocks[1].value == 1.0
    np.testing.assert_array_equal(coordinates(keys.reference_key.data), before)
    assert keeps(obj) == kept
    extent = np.abs(shown(obj)).max(axis=0)
    # Displaced by 0.2 along normals. A pixel is 0.07.
    np.testing.assert_allclose(extent, (1.2, 1.2, 0.55), atol=0.07)


def test_the_shape_can_be_applied(stipple):
    target, obj = flat(), template()
    assert adapt(obj, target, result='APPLY') == {'FINISHED'}
    assert obj.data.shape_keys is None and distances(shown(obj), target).mean() < 0.03


def test_a_template_elsewhere_is_brought_over(stipple):
    target, obj = flat(), template()
    obj.location, obj.scale, obj.rotation_euler.z = (7, 0, 2), (-0.3, 0.3, 0.3), 0.4  # mirrored, too
    assert 'lies apart from what is rendered' in refusal(lambda: adapt(obj, target))
    assert obj.data.shape_keys is None
    assert adapt(obj, target, alignment='SIZE') == {'FINISHED'}
    assert distances(shown(obj), target).mean() < 0.03


def test_nothing_that_is_not_rendered_is_in_the_way(stipple):
    """A template all around, and walls that leave a camera no place."""
    target, obj = flat(), template()
    obj.scale = (2.5, 2.5, 2.5)
    scenes.sphere('Walls', 16, 8, radius=1.9)
    assert adapt(obj, target, alignment='SIZE') == {'FINISHED'}
    assert distances(shown(obj), target).mean() < 0.05


def test_several_objects_are_one_shape(stipple, capfd):
    obj, halves = template(), [scenes.sphere(name, 32, 16) for name in ('Left', 'Right')]
    for half, place in zip(halves, (-0.4, 0.4)):
        half.location.x = place
    lamp = scenes.link(bpy.data.objects.new('Lamp', bpy.data.lights.new('Lamp', 'POINT')))
    lamp.location.z = 4
    assert adapt(obj, *halves, lamp) == {'FINISHED'}  # a light is not rendered, but shines
    assert "8 renders of 2 objects" in capfd.readouterr().out
    assert obj.data.shape_keys.key_blocks[1].name == 'Adapted to Renders'
    np.testing.assert_allclose(np.abs(shown(obj)).max(axis=0), (1.4, 1, 1), atol=0.1)


# ---- what Cycles shows --------------------------------------------------------------------------

def test_a_volume_has_a_shape(stipple):
    cloud, obj = scenes.sphere('Cloud', 32, 16, radius=0.7), template()
    material = scenes.material('Smoke', obj=cloud)
    tree = material.node_tree
    output = next(n for n in tree.nodes if n.type == 'OUTPUT_MATERIAL')
    smoke = tree.nodes.new('ShaderNodeVolumePrincipled')
    smoke.inputs['Density'].default_value = 50.0
    tree.links.remove(output.inputs['Surface'].links[0])
    tree.links.new(smoke.outputs[0], output.inputs['Volume'])
    assert adapt(obj, cloud) == {'FINISHED'}
    np.testing.assert_allclose(radii(obj).mean(), 0.68, atol=0.03)  # light goes through its rim


def test_hair_has_a_shape(stipple, capfd):
    """A fur around a ball, which itself is not rendered."""
    skin, obj = scenes.sphere('Skin', 32, 16, radius=0.4), template()
    bpy.context.view_layer.objects.active = skin
    bpy.ops.object.particle_system_add()
    fur = skin.particle_systems[0].settings
    fur.type, fur.count, fur.hair_length, fur.radius_scale = 'HAIR', 3000, 0.2, 0.05
    skin.show_instancer_for_render = False
    assert adapt(obj, skin) == {'FINISHED'}
    assert 0.45 < radii(obj).mean() < 0.95  # the fur is thin
    assert 'reaches over the edge' not in capfd.readouterr().out
    fur.count, fur.hair_length = 300, 0.8
    assert adapt(obj, skin) == {'FINISHED'}
    assert 'Something reaches over the edge of' in capfd.readouterr().out


def instance(target):
    """An empty that shows a collection with the target, which is nowhere else."""
    collection = bpy.data.collections.new('Source')
    collection.objects.link(target)
    bpy.context.scene.collection.objects.unlink(target)
    empty = scenes.link(bpy.data.objects.new('Instance', None))
    empty.instance_type, empty.instance_collection = 'COLLECTION', collection
    return empty


def test_instances_have_a_shape(stipple):
    target, obj = flat(), template()
    empty = instance(target)
    empty.location.x = 0.3
    assert adapt(obj, empty) == {'FINISHED'}
    low, high = shown(obj).min(axis=0), shown(obj).max(axis=0)
    np.testing.assert_allclose((low[0], high[0], high[2]), (-0.7, 1.3, 0.35), atol=0.08)


# ---- the scene afterwards -----------------------------------------------------------------------

def test_undo_is_one_step_and_the_scene_is_as_it_was(stipple):
    target, obj = flat(), template()
    scene = bpy.context.scene
    floor = scenes.quad('Floor', size=20.0, offset=(0, 0, -1))
    floor.hide_render = True
    scenes.camera(width=320, height=200)
    scene.timeline_markers.new('Cut', frame=1).camera = scene.camera
    scene.render.use_border, scene.render.film_transparent, scene.cycles.samples = True, False, 7
    scenes.select(obj, target)
    before = facts()
    bpy.ops.ed.undo_push(message='before')
    assert bpy.ops.stipple.mesh_adapt_to_renders('EXEC_DEFAULT', True, **QUICK) == {'FINISHED'}
    after = facts()
    assert after[-1] != before[-1] and after[1:-1] == before[1:-1]
    # The template's only changes.
    assert [(name, values[name]) for values, old in zip(after[0], before[0]) for name in values
            if values[name] != old[name] and name != 'dimensions'] == [('active_shape_key_index', '1')]
    bpy.ops.ed.undo()
    assert bpy.data.objects['Ball'].data.shape_keys is None


def test_what_fails_or_is_cancelled_leaves_the_scene_as_it_was(stipple, monkeypatch):
    target, obj = flat(), template()
    scenes.select(obj, target)
    before = facts()
    functions, drawn = stipple.cycles_functions, []
    render = functions.render

    def fail(*arguments):
        drawn.append(arguments)
        return render(*arguments) if len(drawn) < 3 else None

    monkeypatch.setattr(functions, 'render', fail)
    said = refusal(lambda: adapt(obj, target))
    assert "Blender rendered no image for view 'view_0002'" in said and said.strip().count('\n') == 0
    assert facts() == before
    monkeypatch.setattr(functions, 'render', render)
    task = task_of(stipple, target)
    while 'Rendering view 3' not in task.poll()[2]:
        pass
    assert facts() != before
    task.finish()
    with pytest.raises(stipple.binding.errors.CancelledError):
        task.wait()
    assert facts() == before
    task = task_of(stipple, target)
    while 'Rendering view 3' not in task.poll()[2]:
        pass
    task.close()  # Blender closes
    assert facts() == before


def task_of(stipple, target):
    """The operator's own, without the operator; nothing is done with the views."""
    adapting = importlib.import_module('.scene.fit.adapting_to_views', stipple.__name__)
    rig = stipple.scene.fit.view_task.RigSettings(view_count=4, view_size=16, samples=1)
    return adapting.AdaptToViewsTask(bpy.context, [target], rig, None)


# ---- what is refused -----------------------------------------------------------------------------

def test_selections_that_do_not_fit_are_refused(stipple):
    target, obj = flat(), template()
    run = bpy.ops.stipple.mesh_adapt_to_renders
    scenes.select(obj)
    assert 'Select the objects to render first' in refusal(run)
    lamp = scenes.link(bpy.data.objects.new('Lamp', bpy.data.lights.new('Lamp', 'POINT')))
    empty = scenes.link(bpy.data.objects.new('Empty', None))
    scenes.select(obj, lamp, empty)
    assert 'Nothing that is selected beside the mesh can be rendered' in refusal(run)
    scenes.select(lamp, target)
    assert 'The active object is no mesh' in refusal(run)
    scenes.select(obj, target)
    bpy.ops.object.mode_set(mode='EDIT')
    assert 'Go to Object Mode first' in refusal(run)
    bpy.ops.object.mode_set(mode='OBJECT')
    assert obj.data.shape_keys is None


def hide_collection(_obj, target):
    """From renders alone."""
    collection = bpy.data.collections.new('Hidden')
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(target)
    bpy.context.scene.collection.objects.unlink(target)
    collection.hide_render = True


@pytest.mark.parametrize('change, settings, words', [
    (lambda obj, target: obj.shape_key_add(name='Basis'), {'result': 'APPLY'}, 'has shape keys'),
    (lambda obj, target: setattr(target, 'data', obj.data), {}, 'share one mesh'),
    (lambda obj, target: obj.data.clear_geometry(), {}, "'Ball' has no faces"),
    (lambda obj, target: setattr(target, 'hide_render', True), {}, 'The renders are empty'),
    (hide_collection, {}, 'The renders are empty'),
    (lambda obj, target: setattr(target, 'visible_camera', False), {}, 'The renders are empty'),
    (lambda obj, target: setattr(obj.data.vertices[5], 'co', (float('nan'), 0, 0)), {}, 'finite'),
    (lambda obj, target: setattr(target, 'hide_viewport', True), {}, 'nothing to look at|Select the objects')])
def test_what_cannot_be_adapted_is_refused_in_one_sentence(stipple, change, settings, words):
    target, obj = flat(), template()
    change(obj, target)
    scenes.select(obj, target)
    before = facts()
    text = refusal(lambda: bpy.ops.stipple.mesh_adapt_to_renders(**{**QUICK, **settings}))
    assert re.search(words, text) and text.strip().count('\n') == 0, text
    assert facts() == before


def test_an_instance_of_what_is_hidden_at_its_own_place_is_refused(stipple):
    target, obj = flat(), template()
    empty = instance(target)
    bpy.context.scene.collection.children.link(empty.instance_collection)
    target.location.x = 5
    assert "'Flat' is in the scene itself and in the collection that 'Instance' shows" in refusal(
        lambda: adapt(obj, empty))


def test_a_blender_without_cycles_says_so(stipple, monkeypatch):
    module = importlib.import_module('.operators.adapting.mesh_adapt_to_renders', stipple.__name__)
    monkeypatch.setattr(module, 'CyclesRender', None)
    target, obj = flat(), template()
    assert 'built without Cycles' in refusal(lambda: adapt(obj, target))
