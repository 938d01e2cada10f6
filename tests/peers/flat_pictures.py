# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of painted meshes by a shader without light, for long clips: they need a window, if only one of Xvfb.

Meshes are cut into small faces and get colours at their corners that are like what photo_scenes.material makes: the
same kinds, scales and colours of textures, and a sun that stays with the object. Nothing else lights them, so that a
place has one colour from everywhere and no noise. A picture is drawn at SAMPLES times its size and made smaller. Of
320 x 180 it takes 0.01 processor seconds with its share of the start, where Cycles took 1.5 and a view of Workbench,
without samples, 0.09.
"""

import shutil

import bmesh
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Vector, noise
from photo_scenes import AMBIENT

SAMPLES = 2            # along each side of a pixel
EDGES_PER_CELL = 6     # of a texture
NARROWEST, WIDEST = 0.012, 0.12  # metres, that no edge needs to fall below and none is above
SUN = Vector((0.35, -0.48, 0.8)).normalized()


def _look(material):
    """(kind, scale, dark, bright) of a material of photo_scenes.material."""
    nodes = material.node_tree.nodes
    ramp = next(node for node in nodes if node.type == 'VALTORGB').color_ramp.elements
    texture = next(node for node in nodes if node.type in ('TEX_VORONOI', 'TEX_NOISE'))
    return (texture.type, texture.inputs['Scale'].default_value, np.array(ramp[0].color[:3]),
            np.array(ramp[1].color[:3]))


def _share(kind, place):
    """0..1: how much of the bright colour a texture has there."""
    if kind == 'TEX_NOISE':
        return min(1, max(0, 0.5 + 0.5 * noise.noise(place) + 0.25 * noise.noise(2 * place)))
    nearest = noise.voronoi(place)[1][0]
    return noise.cell(nearest * 7.3)


def _displayed(linear):
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-6) ** (1 / 2.4) - 0.055)


def paint(objects):
    """Makes meshes of these objects fine, and gives them colours."""
    graph = bpy.context.evaluated_depsgraph_get()
    for obj in objects:
        mesh = bpy.data.meshes.new_from_object(obj.evaluated_get(graph))
        material = mesh.materials[0]
        kind, scale, dark, bright = _look(material)
        most = min(WIDEST, max(NARROWEST, 1 / (scale * EDGES_PER_CELL)))
        made = bmesh.new()
        made.from_mesh(mesh)
        while True:
            long = [edge for edge in made.edges if edge.calc_length() > most]
            if not long:
                break
            bmesh.ops.subdivide_edges(made, edges=long, cuts=1, use_grid_fill=True)
        made.normal_update()
        made.to_mesh(mesh)
        made.free()
        turn = obj.matrix_world.to_3x3()
        colours = np.ones((len(mesh.vertices), 4), np.float32)
        for vertex, colour in zip(mesh.vertices, colours):
            lit = AMBIENT + 0.65 * max(0, (turn @ vertex.normal).normalized() @ SUN)
            share = _share(kind, vertex.co * scale)
            colour[:3] = _displayed(lit * (dark + (bright - dark) * share))
        layer = mesh.color_attributes.new('Colour', 'FLOAT_COLOR', 'POINT')
        layer.data.foreach_set('color', colours.ravel())
        mesh.color_attributes.active_color = layer
        obj.modifiers.clear()
        obj.data = mesh


class FlatPictures:
    """Draws pictures of painted objects. What stands still is drawn once for each camera."""

    def __init__(self, objects, movers, width, height):
        self._size, self._wide = (width, height), (width * SAMPLES, height * SAMPLES)
        self._screen = gpu.types.GPUOffScreen(*self._wide)
        self._shader = gpu.shader.from_builtin('3D_SMOOTH_COLOR')
        self._movers = [(obj, self._batch(obj.data)) for obj in movers]
        self._still = [(obj, self._batch(obj.data)) for obj in objects if obj not in movers]
        self._of_camera, self._empty = {}, {}
        self._image = bpy.data.images.new('Picture', width, height)
        self._image.file_format = 'PNG'

    def _batch(self, mesh):
        mesh.calc_loop_triangles()
        corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
        mesh.loop_triangles.foreach_get('vertices', corners)
        places, colours = np.empty(3 * len(mesh.vertices), np.float32), np.empty(4 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get('co', places)
        mesh.color_attributes.active_color.data.foreach_get('color', colours)
        return batch_for_shader(self._shader, 'TRIS', {'pos': places.reshape(-1, 3), 'color': colours.reshape(-1, 4)},
                                indices=corners.reshape(-1, 3))

    def _read(self, frame, kind):
        width, height = self._wide
        buffer = (frame.read_depth(0, 0, width, height) if kind == 'depth' else
                  frame.read_color(0, 0, width, height, 4, 0, 'UBYTE'))
        channels = 1 if kind == 'depth' else 4
        buffer.dimensions = width * height * channels
        return np.array(buffer).reshape(height, width, channels)

    def _draw(self, objects, camera):
        """([H,W,4] bytes, [H,W,1] depths) of wide pictures."""
        graph = bpy.context.evaluated_depsgraph_get()
        width, height = self._size
        with self._screen.bind():
            frame = gpu.state.active_framebuffer_get()
            frame.clear(color=(0, 0, 0, 1), depth=1)
            gpu.state.depth_test_set('LESS_EQUAL')
            gpu.state.depth_mask_set(True)
            with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
                gpu.matrix.load_projection_matrix(camera.calc_matrix_camera(graph, x=width, y=height))
                for obj, batch in objects:
                    gpu.matrix.load_matrix(camera.matrix_world.inverted() @ obj.matrix_world)
                    batch.draw(self._shader)
            return self._read(frame, 'colour'), self._read(frame, 'depth')

    def write(self, path, camera):
        """A picture of what is shown now. Movers are shown unless hide_render says otherwise."""
        if camera.name not in self._of_camera:
            colours, depths = self._draw(self._still, camera)
            self._of_camera[camera.name] = colours, depths, self._smaller(colours)
        colours, depths, still = self._of_camera[camera.name]
        shown = [(obj, batch) for obj, batch in self._movers if not obj.hide_render]
        if shown:
            moving, near = self._draw(shown, camera)
            front = near < depths
            rows, columns = (np.flatnonzero(front.any((axis, 2))) // SAMPLES for axis in (1, 0))
            if len(rows):
                box = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
                wide = tuple(slice(part.start * SAMPLES, part.stop * SAMPLES) for part in box)
                picture = still.copy()
                picture[box] = self._smaller(np.where(front[wide], moving[wide], colours[wide]))
                self._save(path, picture)
                return
        if camera.name in self._empty:
            shutil.copy(self._empty[camera.name], path)
        else:
            self._save(path, still)
            self._empty[camera.name] = path

    def _smaller(self, wide):
        """[H,W,4] of 0..1."""
        height, width = wide.shape[0] // SAMPLES, wide.shape[1] // SAMPLES
        return wide.reshape(height, SAMPLES, width, SAMPLES, 4).astype(np.float32).mean((1, 3)) / 255

    def _save(self, path, picture):
        self._image.pixels.foreach_set(picture.ravel())
        self._image.filepath_raw = str(path)
        self._image.save()
