# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours that only a renderer knows: baked by Cycles onto a temporary, triangulated copy.

Every triangle gets half of a square of its own, the larger the larger it is, so no UV map is needed and
nothing bleeds from one triangle to another. Emission is baked apart from the light that falls on a surface: it
is free of noise, so one sample is enough and the resolution can be that of its textures. What reflects and refracts
changes with the side that it is seen from: its change from the colour along the normal is baked from some directions.
"""

import contextlib
import math
from dataclasses import dataclass

import bmesh
import bpy
import numpy as np
from mathutils import Matrix, Vector

from .. import version
from ..binding.errors import StippleError
from ..binding.structs import Status
from . import colour

ATLAS = 'stipple_atlas'
MAX_SIDE_PX = 4096
# Light that nobody asked for more of has so many pixels along an atlas side.
LIGHT_SIDE_PX = 1024
# Insets and a few texels of colour need so many along the smallest square; a few less must do for meshes of millions.
SMALLEST_PX, LEAST_PX = 6, 4
# Triangles keep this far from their cell's border, so that filtering never reaches a neighbour.
INSET_PX = 1.5
LIGHT_PASSES = {'DIRECT', 'INDIRECT', 'DIFFUSE', 'GLOSSY', 'TRANSMISSION'}
# What changes with the view; it is smooth between directions that harmonics can show, so coarse squares and few samples
# do: many of both go into one splat.
VIEW_PASSES = LIGHT_PASSES - {'DIFFUSE'}
VIEW_SIDE_SHARE, VIEW_SAMPLES_SHARE = 4, 4
VIEW_DIRECTIONS = 36


@dataclass(frozen=True)
class Settings:
    """side: pixels along the atlas of an object, 0: LIGHT_SIDE_PX; samples: rays of light per pixel; views: whether
    what changes with the view is baked as well."""

    side: int = 0
    samples: int = 32
    views: bool = False


class Baked:
    """A triangulated copy with its atlas; bakes each kind when it is first asked for."""

    def __init__(self, obj, uvs, sides, samples, kinds):
        self.object = obj
        self.mesh = obj.data
        self.uvs = uvs  # [T,3,2]
        self._sides, self._samples = sides, samples
        self._kinds = kinds  # per slot, or None to bake every slot
        self._images = {}

    def image(self, kind):
        """Pixels [side,side,3], row 0 = top, scene linear; kind: COMBINED, BAKE_EMIT or BAKE_DIFFUSE."""
        if kind not in self._images:
            pixels = self._bake(kind)
            if kind == 'COMBINED' and any(colour.may_emit(material) for material in self.mesh.materials):
                emission = self._bake('EMISSION')
                pixels = emission + _enlarged(pixels, len(emission))
            self._images[kind] = pixels
        return self._images[kind]

    def view_images(self):
        """For each of view_directions(), pixels [side,side,3] of what comes to COMBINED along it."""
        with _view_camera() as camera:
            along_normal = self._bake('VIEW')
            images = []
            for direction in view_directions():
                camera.matrix_world = Vector(direction.tolist()).to_track_quat('-Z', 'Y').to_matrix().to_4x4()
                images.append(self._bake('VIEW', 'ACTIVE_CAMERA') - along_normal)
            return images

    def _bake(self, kind, view_from='ABOVE_SURFACE'):
        side = {'COMBINED': self._sides.light, 'VIEW': self._sides.view}.get(kind, self._sides.fine)
        image = bpy.data.images.new('stipple_bake', side, side, alpha=True, float_buffer=True)
        kept = list(self.mesh.materials)
        made = []
        try:
            for slot in range(max(len(kept), 1)):
                material = self._target_material(kept[slot] if kept else None, slot, kind, image)
                made.append(material)
                if slot < len(self.mesh.materials):
                    self.mesh.materials[slot] = material
                else:
                    self.mesh.materials.append(material)
            _run_cycles(self.object, kind, self._samples, view_from)
            values = np.empty(side * side * 4, np.float32)
            image.pixels.foreach_get(values)
            values = values.reshape(side, side, 4)[::-1, :, :3]
            return np.ascontiguousarray(np.maximum(values, 0))
        finally:
            self.mesh.materials.clear()
            for material in kept:
                self.mesh.materials.append(material)
            for material in made:
                bpy.data.materials.remove(material)
            bpy.data.images.remove(image)

    def _target_material(self, material, slot, kind, image):
        """A copy that bakes into the image; slots that this pass is not for become a plain colour."""
        wanted = self._kinds is None or (slot < len(self._kinds) and self._kinds[slot].kind == kind)
        if material is None or not wanted or not version.has_nodes(material):
            copy = bpy.data.materials.new('stipple_bake')
            version.use_nodes(copy)
            copy.diffuse_color = colour.GREY if material is None else material.diffuse_color
            shader = next(n for n in copy.node_tree.nodes if n.type == 'BSDF_PRINCIPLED')
            shader.inputs['Base Color'].default_value = copy.diffuse_color
        else:
            copy = material.copy()
        if kind == 'BAKE_EMIT' and wanted:
            _emit_base_colour(copy)
        nodes = copy.node_tree.nodes
        target = nodes.new('ShaderNodeTexImage')
        target.image = image
        for node in nodes:
            node.select = False
        target.select = True
        nodes.active = target
        return copy


def copy_of(evaluated, depsgraph):
    """A mesh of our own, with the materials that the evaluated object shows, to give to baked()."""
    if not hasattr(bpy.types.Scene, 'cycles'):
        raise StippleError(f"Object '{evaluated.name}' needs baking, but the Cycles add-on is disabled; enable it or "
                           'choose another color source.', Status.ERROR_UNAVAILABLE)
    mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
    for slot, shown in enumerate(evaluated.material_slots):
        if slot < len(mesh.materials) and shown.link == 'OBJECT':
            mesh.materials[slot] = shown.material.original if shown.material else None
    return mesh


@contextlib.contextmanager
def baked(mesh, name, matrix, kinds, hidden, settings):
    """A Baked of a mesh of our own, or None where it has no triangle. Everything else temporary is removed.

    matrix: where it stands (light and object coordinates depend on it). hidden: objects that must not shade it.
    settings: Settings.
    """
    obj = None
    shown = [o for o in hidden if not o.hide_render]
    try:
        _triangulate(mesh)
        if len(mesh.polygons) == 0:
            yield None
            return
        areas = np.empty(len(mesh.polygons), np.float32)
        mesh.polygons.foreach_get('area', areas)
        sides, uvs = _atlas(areas, settings.side or LIGHT_SIDE_PX, _texture_side(mesh.materials))
        render_uv = next((layer.name for layer in mesh.uv_layers if layer.active_render), None)
        layer = mesh.uv_layers.new(name=ATLAS, do_init=False)
        if layer is None:
            raise StippleError(f"Object '{name}' has {len(mesh.uv_layers)} UV maps; at most 7 are allowed where "
                               'colors have to be baked.', Status.ERROR_UNSUPPORTED)
        version.set_loop_uvs(mesh.uv_layers[ATLAS], uvs)
        mesh.uv_layers.active = mesh.uv_layers[ATLAS]
        if render_uv is not None:
            mesh.uv_layers[render_uv].active_render = True
        obj = bpy.data.objects.new('stipple_bake', mesh)
        obj.matrix_world = Matrix(matrix.tolist())
        bpy.context.scene.collection.objects.link(obj)
        for other in shown:
            other.hide_render = True
        yield Baked(obj, uvs, sides, settings.samples, kinds)
    finally:
        for other in shown:
            other.hide_render = False
        if obj is not None:
            bpy.data.objects.remove(obj)


def _triangulate(mesh):
    work = bmesh.new()
    work.from_mesh(mesh)
    bmesh.ops.triangulate(work, faces=work.faces[:])
    work.to_mesh(mesh)
    work.free()


@dataclass(frozen=True)
class _Sides:
    """Pixels along an atlas of light, along one that takes a sample a pixel, and along one of a view direction."""

    light: int
    fine: int
    view: int


def _texture_side(materials):
    """Pixels along an atlas that holds about as many as the largest image of the materials; half of a cell is used."""
    images = [node.image for material in materials for node in colour.nodes_of(material)
              if node.type == 'TEX_IMAGE' and node.image is not None]
    return max((math.ceil(math.sqrt(2 * image.size[0] * image.size[1])) for image in images), default=0)


def _atlas(areas, light_px, texture_px):
    """(_Sides, UVs [T,3,2]) of triangles with these areas: two of about one size share a square."""
    count = len(areas)
    pairs = (count + 1) // 2
    units = 1 << max(0, math.floor(math.log2(max(1, light_px // SMALLEST_PX))))  # smallest squares along a side
    while units * units < pairs:
        units *= 2
    if MAX_SIDE_PX // units < LEAST_PX:
        raise StippleError(f'A mesh to be baked has {count:,} triangles; allowed are '
                           f'{2 * (MAX_SIDE_PX // LEAST_PX) ** 2:,}.', Status.ERROR_UNSUPPORTED)

    def unit_of(side_px, least=SMALLEST_PX):
        return min(max(side_px // units, least), MAX_SIDE_PX // units)
    unit_px = unit_of(light_px)
    sides = _Sides(units * unit_px, units * max(unit_px, unit_of(texture_px)),
                   units * unit_of(light_px // VIEW_SIDE_SHARE, LEAST_PX))
    order = np.argsort(-areas, kind='stable')
    wide = _square_sides(np.sqrt(areas[order[::2]]), units)
    corner = _corners(wide)
    pair = np.empty(count, np.int64)
    pair[order] = np.arange(count) // 2
    is_second = np.zeros(count, bool)
    is_second[order[1::2]] = True
    origin, cell_px = corner[pair] * float(unit_px), (wide[pair] * unit_px)[:, None].astype(float)
    inset = min(INSET_PX, unit_px / 4.0)
    low, high = np.full_like(cell_px, inset), cell_px - inset
    # Both halves leave the diagonal: their right angles sit in opposite corners.
    gap = inset
    first = np.stack([np.hstack([low, low]), np.hstack([high - gap, low]), np.hstack([low, high - gap])], 1)
    second = np.stack([np.hstack([high, high]), np.hstack([low + gap, high]), np.hstack([high, low + gap])], 1)
    corners = np.where(is_second[:, None, None], second, first)
    # The insets are of the atlas of light; in the finer one they are wider, in that of views narrower: there a little
    # of the neighbour's shine gets in, which is nearly the same.
    return sides, ((origin[:, None, :] + corners) / sides.light).astype(np.float32)


def _square_sides(lengths, units):
    """Powers of two, about in proportion to the lengths, whose squares fill no more than units x units."""
    wanted = np.maximum(lengths / max(float(lengths.max()), 1e-30), 1e-9)

    def sides_at(scale):
        return 1 << np.clip(np.floor(np.log2(wanted * scale)), 0, math.log2(units)).astype(np.int64)
    low, high = 1.0, 4.0 * units
    for _ in range(30):
        scale = math.sqrt(low * high)
        if np.sum(sides_at(scale) ** 2) <= units * units:
            low = scale
        else:
            high = scale
    return sides_at(low)


def _corners(sides):
    """Where squares of sides that are powers of two and fall lie side by side: along a Z-order curve, without gaps."""
    codes = np.concatenate([[0], np.cumsum(sides.astype(np.int64) ** 2)[:-1]])
    corners = np.zeros((len(sides), 2), np.int64)
    for bit in range(16):
        for axis in range(2):
            corners[:, axis] |= (codes >> (2 * bit + axis) & 1) << bit
    return corners


def _enlarged(pixels, side):
    """Pixels [n,n,3] as [side,side,3], bilinear."""
    count = len(pixels)
    if count == side:
        return pixels
    at = (np.arange(side, dtype=np.float32) + 0.5) * (count / side) - 0.5
    low = np.clip(np.floor(at).astype(np.int32), 0, count - 1)
    high = np.minimum(low + 1, count - 1)
    share = np.clip(at - low, 0, 1)
    rows = pixels[low] * (1 - share[:, None, None]) + pixels[high] * share[:, None, None]
    return rows[:, low] * (1 - share[:, None]) + rows[:, high] * share[:, None]


def _emit_base_colour(material):
    """Makes a material shine its base colour, so that an EMIT bake reads it without light."""
    tree = material.node_tree
    shader = colour.surface_shader(material)
    socket = colour.colour_socket(shader) if shader is not None else None
    if socket is None or shader.type == 'EMISSION':
        return
    emission = tree.nodes.new('ShaderNodeEmission')
    if socket.is_linked:
        tree.links.new(socket.links[0].from_socket, emission.inputs['Color'])
    else:
        emission.inputs['Color'].default_value = socket.default_value
    output = next(n for n in tree.nodes if n.type == 'OUTPUT_MATERIAL' and n.is_active_output)
    tree.links.new(emission.outputs[0], output.inputs['Surface'])


def view_directions():
    """[VIEW_DIRECTIONS,3] unit, from the eye to the surface, even over the sphere (a Fibonacci lattice)."""
    i = np.arange(VIEW_DIRECTIONS) + 0.5
    z = 1 - 2 * i / VIEW_DIRECTIONS
    angle = i * (math.pi * (3 - math.sqrt(5)))
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], 1).astype(np.float32)


@contextlib.contextmanager
def _view_camera():
    """An orthographic camera of our own, which is the scene's meanwhile."""
    scene = bpy.context.scene
    kept = scene.camera
    data = bpy.data.cameras.new('stipple_bake')
    data.type = 'ORTHO'
    camera = bpy.data.objects.new('stipple_bake', data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    try:
        yield camera
    finally:
        scene.camera = kept
        bpy.data.objects.remove(camera)
        bpy.data.cameras.remove(data)


def _run_cycles(obj, kind, samples, view_from):
    scene = bpy.context.scene
    render, cycles = scene.render, scene.cycles
    kept = (render.engine, cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling,
            render.bake.use_selected_to_active, render.bake.use_clear, render.bake.margin, render.bake.view_from)
    render.engine = 'CYCLES'
    cycles.samples = {'COMBINED': samples, 'VIEW': max(1, samples // VIEW_SAMPLES_SHARE)}.get(kind, 1)
    cycles.use_denoising = False
    cycles.use_adaptive_sampling = False
    render.bake.use_selected_to_active = False
    render.bake.view_from = view_from
    options = {'type': 'COMBINED', 'pass_filter': LIGHT_PASSES}
    if kind == 'VIEW':
        options['pass_filter'] = VIEW_PASSES
    elif kind in {'BAKE_EMIT', 'EMISSION'}:
        options = {'type': 'EMIT'}
    elif kind == 'BAKE_DIFFUSE':
        options = {'type': 'DIFFUSE', 'pass_filter': {'COLOR'}}
    try:
        with bpy.context.temp_override(object=obj, active_object=obj, selected_objects=[obj],
                                       selected_editable_objects=[obj]):
            bpy.ops.object.bake(margin=1, use_clear=True, target='IMAGE_TEXTURES', save_mode='INTERNAL', **options)
    except RuntimeError as error:
        raise StippleError(f"Baking the colors failed: {str(error).strip()}.", Status.ERROR_INTERNAL) from None
    finally:
        (render.engine, cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling,
         render.bake.use_selected_to_active, render.bake.use_clear, render.bake.margin, render.bake.view_from) = kept
