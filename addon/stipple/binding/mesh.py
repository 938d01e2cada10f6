# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangle meshes with colours, put together part by part."""

from ctypes import byref, c_float, c_uint32

import numpy as np

from .errors import invalid
from .handle import Handle, contiguous, matrix16, new_handle, path_bytes, pointer_to
from .job import Job
from .structs import (NO_INDEX, MaterialColour, StippleMaterial, StippleMeshBuffers, StippleMeshInfo,
                      StippleMeshInstance, StippleMeshPart, StippleMeshTopology)


class MatteTask:
    """What meshes hide while it is drawn: poll, cancel or wait through `job`, then read the arrays, row 0 = top."""

    def __init__(self, job, depth, opacity):
        self.job = job
        self.depth = depth      # [H,W] metres, 1e10 where no mesh is
        self.opacity = opacity  # [H,W] share of each pixel's samples that a mesh hides


def start_depth(context, placed, camera):
    """Starts measuring how far meshes [(mesh, 4x4 object to world)] are through the centre of each pixel; they must
    outlive the start only. The task has no opacity."""
    depth = np.empty((camera.height, camera.width), np.float32)
    array = _instances(placed)
    job = Job(context.library, new_handle(context.library, 'stipple_mesh_depth_start', context.pointer, array,
                                          len(placed), byref(camera), pointer_to(depth)), keep=(depth, array))
    return MatteTask(job, depth, None)


def start_matte(context, placed, camera, side):
    """Starts drawing what meshes [(mesh, 4x4 object to world)] hide, with side x side samples for each pixel; they must
    outlive the start only."""
    depth, opacity = (np.empty((camera.height, camera.width), np.float32) for _ in range(2))
    array = _instances(placed)
    job = Job(context.library, new_handle(context.library, 'stipple_mesh_matte_start', context.pointer, array,
                                          len(placed), byref(camera), side, pointer_to(depth), pointer_to(opacity)),
              keep=(depth, opacity, array))
    return MatteTask(job, depth, opacity)


def _instances(placed):
    array = (StippleMeshInstance * max(len(placed), 1))()
    for entry, (mesh, matrix) in zip(array, placed):
        entry.__init__(mesh=mesh.pointer, matrix=matrix16(matrix))
    return array


class Mesh(Handle):
    free_function = 'stipple_mesh_free'
    job_function = 'stipple_job_mesh'

    @classmethod
    def create(cls, context):
        return cls(context.library, new_handle(context.library, 'stipple_mesh_create', context.pointer))

    @classmethod
    def load(cls, context, path):
        return cls(context.library,
                   new_handle(context.library, 'stipple_mesh_load', context.pointer, path_bytes(path)))

    def add_texture(self, pixels, srgb):
        """pixels [height,width,3 or 4], row 0 = top, straight alpha. Returns the index."""
        pixels = contiguous(pixels)
        height, width, channels = pixels.shape
        index = c_uint32()
        self._check(self.library.stipple_mesh_add_texture(self.pointer, width, height, channels, pointer_to(pixels),
                                                          1 if srgb else 0, byref(index)))
        return index.value

    def set_view_directions(self, directions):
        """directions [M,3], unit, from the eye to the surface, in the world: what view textures are of."""
        directions = contiguous(directions)
        self._check(self.library.stipple_mesh_set_view_directions(self.pointer, pointer_to(directions),
                                                                  len(directions)))

    def add_material(self, colour=MaterialColour.CONSTANT, base_colour=(0.8, 0.8, 0.8, 1.0), texture=NO_INDEX,
                     view_textures=None):
        """base_colour: scene linear, straight alpha. view_textures: for each view direction the index of a texture of
        what comes to the colour along it, or None. Returns the index."""
        material = StippleMaterial(colour=int(colour), base_colour=(c_float * 4)(*base_colour), texture=texture)
        if view_textures is not None:
            views = contiguous(np.array(view_textures), np.uint32)
            material.view_count, material.view_textures = len(views), pointer_to(views)
        index = c_uint32()
        self._check(self.library.stipple_mesh_add_material(self.pointer, byref(material), byref(index)))
        return index.value

    def add_part(self, positions, triangles, matrix, corner_normals=None, corner_uvs=None, corner_colours=None,
                 triangle_materials=None):
        """Arrays as in StippleMeshPart; shapes [V,3], [T,3], [4,4], [T,3,3], [T,3,2], [T,3,4], [T]."""
        positions = contiguous(positions)
        triangles = contiguous(triangles, np.uint32)
        count = len(triangles)
        corners = {'corner_normals': (corner_normals, (count, 3, 3)), 'corner_uvs': (corner_uvs, (count, 3, 2)),
                   'corner_colours': (corner_colours, (count, 3, 4))}
        kept = {}
        for name, (array, shape) in corners.items():
            if array is None:
                continue
            if array.shape != shape:
                raise invalid(f'Mesh array {name} has shape {array.shape}; allowed is {shape}.')
            kept[name] = contiguous(array)
        if triangle_materials is not None:
            kept['triangle_materials'] = contiguous(triangle_materials, np.uint32)
        part = StippleMeshPart(vertex_count=len(positions), triangle_count=count, positions=pointer_to(positions),
                               triangles=pointer_to(triangles), matrix=matrix16(matrix),
                               **{name: pointer_to(array) for name, array in kept.items()})
        self._check(self.library.stipple_mesh_add_part(self.pointer, byref(part)))

    def info(self):
        info = StippleMeshInfo()
        self._check(self.library.stipple_mesh_info(self.pointer, byref(info)))
        return info

    def read(self):
        """(positions [V,3], triangles [T,3]) as new arrays."""
        info = self.info()
        positions, triangles = np.empty((info.vertex_count, 3), np.float32), np.empty((info.triangle_count, 3),
                                                                                      np.uint32)
        buffers = StippleMeshBuffers(vertex_capacity=info.vertex_count, triangle_capacity=info.triangle_count,
                                     positions=pointer_to(positions), triangles=pointer_to(triangles))
        self._check(self.library.stipple_mesh_read(self.pointer, byref(buffers)))
        return positions, triangles

    def topology(self):
        topology = StippleMeshTopology()
        self._check(self.library.stipple_mesh_topology(self.pointer, byref(topology)))
        return topology

    def save(self, path):
        """Writes positions and triangles: .ply or .glb."""
        self._check(self.library.stipple_mesh_save(self.pointer, path_bytes(path)))

    def save_reshaped(self, source, path):
        """Writes the glTF file that the mesh was loaded from as a .glb, with its positions and normals; all else in it
        stays."""
        self._check(self.library.stipple_mesh_save_reshaped(self.pointer, path_bytes(source), path_bytes(path)))
