"""Makes the scenes of this folder, and Cycles' images of their base colours in reference/. Blender 3.4 or newer:

    blender -b --factory-startup --python-exit-code 1 --python blend-fixtures/make_fixtures.py

Nothing in here is random, so the scenes come out the same each time. The files that the project keeps were made by
Blender 3.4: older files open in newer Blenders, not the other way round.
"""
import math
import pathlib
import sys

import bpy
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import base_colours  # noqa: E402 (found beside this file)

WIDTH, HEIGHT = 320, 240


def new_scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    base_colours.prepare_image(scene)
    base_colours.prepare_cycles(scene)
    return scene


def add_camera(scene, location, target, lens):
    data = bpy.data.cameras.new('Camera')
    data.lens = lens
    camera = bpy.data.objects.new('Camera', data)
    camera.location = location
    direction = np.subtract(target, location)
    camera.rotation_euler = (math.acos(-direction[2] / np.linalg.norm(direction)), 0.0,
                             math.atan2(-direction[0], direction[1]))
    scene.collection.objects.link(camera)
    scene.camera = camera
    return data


def add_material(name, colour=None):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    if colour is not None:
        shader = next(node for node in material.node_tree.nodes if node.type == 'BSDF_PRINCIPLED')
        shader.inputs['Base Color'].default_value = (*colour, 1.0)
        material.diffuse_color = (*colour, 1.0)
    return material


def base_colour_socket(material):
    return next(node for node in material.node_tree.nodes if node.type == 'BSDF_PRINCIPLED').inputs['Base Color']


# ---- suzanne.blend: an image texture by UV, under a subdivision modifier ------------------------------

def eye_polygons(mesh):
    """Polygons of the two small islands of Suzanne's mesh."""
    island = np.arange(len(mesh.vertices))
    edges = np.array([edge.vertices[:] for edge in mesh.edges])
    while True:
        lowest = island.copy()
        np.minimum.at(lowest, edges.ravel(), island[edges[:, ::-1]].ravel())
        if (lowest == island).all():
            break
        island = lowest
    labels, counts = np.unique(island, return_counts=True)
    head = labels[counts.argmax()]
    return [polygon for polygon in mesh.polygons if island[polygon.vertices[0]] != head]


def painted_material(name, image, paint):
    """A material for baking: paint(node factory, object coordinates) gives its colour socket."""
    material = add_material(name)
    nodes, links = material.node_tree.nodes, material.node_tree.links

    def node(kind, settings=(), **inputs):
        made = nodes.new(kind)
        for key, value in dict(settings).items():
            setattr(made, key, value)
        for key, value in inputs.items():
            socket = made.inputs[int(key[1:])]
            if isinstance(value, bpy.types.NodeSocket):
                links.new(value, socket)
            else:
                socket.default_value = value
        return made.outputs

    coordinates = nodes.new('ShaderNodeTexCoord').outputs['Object']
    links.new(paint(node, coordinates), base_colour_socket(material))
    target = nodes.new('ShaderNodeTexImage')  # what is active is what is baked to
    target.image = image
    nodes.active = target
    return material


def paint_fur(node, coordinates):
    """Calm skin around the muzzle and between the ears; stripes, that take many splats, everywhere else."""
    wave = node('ShaderNodeTexWave', {'bands_direction': 'DIAGONAL'}, i0=coordinates, i1=3.2, i2=1.5, i3=2.0, i4=1.5)
    fur = node('ShaderNodeMixRGB', i0=wave[1], i1=(0.16, 0.035, 0.012, 1.0), i2=(0.62, 0.24, 0.06, 1.0))
    muzzle = node('ShaderNodeVectorMath', {'operation': 'DISTANCE'}, i0=coordinates, i1=(0.0, -0.95, -0.2))
    share = node('ShaderNodeMapRange', {'interpolation_type': 'SMOOTHSTEP'}, i0=muzzle[1], i1=0.62, i2=0.72)
    return node('ShaderNodeMixRGB', i0=share[0], i1=(0.60, 0.34, 0.19, 1.0), i2=fur[0])[0]


def paint_eye(node, coordinates):
    mirrored = node('ShaderNodeVectorMath', {'operation': 'ABSOLUTE'}, i0=coordinates)
    pupil = node('ShaderNodeVectorMath', {'operation': 'DISTANCE'}, i0=mirrored[0], i1=(0.35, 0.86, 0.25))
    share = node('ShaderNodeMapRange', {'interpolation_type': 'SMOOTHSTEP'}, i0=pupil[1], i1=0.12, i2=0.15)
    return node('ShaderNodeMixRGB', i0=share[0], i1=(0.01, 0.01, 0.02, 1.0), i2=(0.9, 0.9, 0.85, 1.0))[0]


def make_suzanne():
    scene = new_scene()
    bpy.ops.mesh.primitive_monkey_add(size=2.0, calc_uvs=True)
    suzanne = bpy.context.object
    suzanne.name = suzanne.data.name = 'Suzanne'
    subdivision = suzanne.modifiers.new('Subdivision', 'SUBSURF')
    subdivision.levels = subdivision.render_levels = 2
    for polygon in suzanne.data.polygons:
        polygon.use_smooth = True

    # The image is painted and lit in 3D and baked once; it is then the scene's base colour.
    image = bpy.data.images.new('Suzanne Colours', 512, 512, alpha=False)
    suzanne.data.materials.append(painted_material('Fur', image, paint_fur))
    suzanne.data.materials.append(painted_material('Eye', image, paint_eye))
    for polygon in eye_polygons(suzanne.data):
        polygon.material_index = 1
    light = bpy.data.objects.new('Sun', bpy.data.lights.new('Sun', 'SUN'))
    light.data.energy, light.data.angle = 2.6, 0.3
    light.rotation_euler = (0.75, 0.1, 0.9)
    scene.collection.objects.link(light)
    scene.world = bpy.data.worlds.new('World')
    scene.world.color = (0.22, 0.26, 0.34)
    scene.cycles.samples = 256
    scene.render.bake.margin = 8
    bpy.ops.object.bake(type='COMBINED')
    image.pack()

    suzanne.data.materials.clear()
    for material in list(bpy.data.materials):
        bpy.data.materials.remove(material)
    for polygon in suzanne.data.polygons:
        polygon.material_index = 0
    material = add_material('Textured')
    texture = material.node_tree.nodes.new('ShaderNodeTexImage')
    texture.image = image
    material.node_tree.links.new(texture.outputs['Color'], base_colour_socket(material))
    suzanne.data.materials.append(material)
    base_colours.prepare_cycles(scene)
    add_camera(scene, (0.9, -4.7, 0.7), (0.0, -0.1, -0.05), 52.0)
    return scene


# ---- instances.blend: a collection with modifiers and two materials, seven times -----------------------

def make_instances():
    scene = new_scene()
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    tower = bpy.context.object
    tower.name = tower.data.name = 'Tower'
    tower.data.materials.append(add_material('Clay', (0.75, 0.22, 0.05)))
    tower.data.materials.append(add_material('Glaze', (0.04, 0.24, 0.55)))
    for polygon in tower.data.polygons:
        polygon.material_index = int(abs(polygon.normal.x) > 0.5)
    bevel = tower.modifiers.new('Bevel', 'BEVEL')
    bevel.width, bevel.segments = 0.12, 3
    array = tower.modifiers.new('Array', 'ARRAY')
    array.count = 3
    array.relative_offset_displace = (0.0, 0.0, 1.08)

    source = bpy.data.collections.new('Towers')
    source.objects.link(tower)
    for collection in list(tower.users_collection):
        if collection != source:
            collection.objects.unlink(tower)

    # Six around one in the middle: rotated, stretched, leaning, and one mirrored.
    for index in range(7):
        instance = bpy.data.objects.new(f'Instance {index}', None)
        instance.instance_type, instance.instance_collection = 'COLLECTION', source
        angle = 2.0 * math.pi * index / 6.0
        radius = 0.0 if index == 6 else 2.4
        instance.location = (radius * math.cos(angle), radius * math.sin(angle), 0.0)
        instance.rotation_euler = (0.15 * (index % 3 - 1), 0.1 * (index % 2), angle + 0.3)
        instance.scale = (0.8 + 0.1 * index, 0.9, 0.5 + 0.12 * index)
        if index == 2:
            instance.scale.x *= -1.0
        scene.collection.objects.link(instance)
    add_camera(scene, (5.5, -8.0, 5.5), (0.0, 0.0, 1.0), 45.0)
    return scene


# ---- terrain.blend: colours of vertices, seen by an off-centre camera -----------------------------------

def make_terrain(cells=96, size=8.0):
    scene = new_scene()
    x, y = np.meshgrid(np.linspace(-size / 2, size / 2, cells + 1), np.linspace(-size / 2, size / 2, cells + 1))
    height = (0.7 * np.sin(0.9 * x) * np.cos(0.7 * y) + 0.35 * np.sin(2.1 * x + 0.6) * np.sin(1.7 * y)
              + 0.12 * np.sin(5.0 * x) * np.cos(4.3 * y + 1.0))
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)[None, :]).reshape(-1, 1)
    faces = corner + np.array([0, 1, cells + 2, cells + 1])
    mesh = bpy.data.meshes.new('Terrain')
    mesh.from_pydata(np.stack([x, y, height], axis=-1).reshape(-1, 3).tolist(), [], faces.tolist())

    # Scene linear colours by height: water, sand, grass, rock, snow.
    level = np.interp(height, (height.min(), height.max()), (0.0, 1.0)).ravel()
    stops = np.array([0.0, 0.3, 0.38, 0.6, 0.8, 1.0])
    colours = np.array([[0.01, 0.05, 0.20], [0.03, 0.22, 0.35], [0.55, 0.42, 0.20],
                        [0.07, 0.24, 0.05], [0.18, 0.15, 0.13], [0.85, 0.88, 0.92]])
    rgba = np.ones((level.size, 4), np.float32)
    for channel in range(3):
        rgba[:, channel] = np.interp(level, stops, colours[:, channel])
    attribute = mesh.color_attributes.new('Height Colour', 'FLOAT_COLOR', 'POINT')
    attribute.data.foreach_set('color', rgba.ravel())

    material = add_material('Height')
    colour = material.node_tree.nodes.new('ShaderNodeVertexColor')
    colour.layer_name = 'Height Colour'
    material.node_tree.links.new(colour.outputs['Color'], base_colour_socket(material))
    mesh.materials.append(material)
    terrain = bpy.data.objects.new('Terrain', mesh)
    scene.collection.objects.link(terrain)

    camera = add_camera(scene, (-5.5, -6.5, 4.2), (0.5, 0.5, 0.0), 40.0)
    camera.sensor_fit = 'VERTICAL'
    camera.shift_x, camera.shift_y = 0.18, -0.12
    return scene


SCENES = {'suzanne': make_suzanne, 'instances': make_instances, 'terrain': make_terrain}


def main():
    (HERE / 'reference').mkdir(exist_ok=True)
    for name, make in SCENES.items():
        print(f'{name}: making the scene', flush=True)
        make()
        path = str(HERE / f'{name}.blend')
        bpy.context.preferences.filepaths.save_version = 0
        bpy.ops.wm.save_as_mainfile(filepath=path, compress=True)
        print(f'{name}: rendering the base colours', flush=True)
        base_colours.render_base_colours(bpy.context.scene, HERE / 'reference' / f'{name}_cycles.png')


main()
