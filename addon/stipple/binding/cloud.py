# SPDX-License-Identifier: GPL-3.0-or-later
"""Splat clouds."""

from ctypes import byref, c_uint64
from dataclasses import dataclass, field

import numpy as np

from .errors import check, invalid
from .handle import Handle, contiguous, matrix16, new_handle, path_bytes, pointer_to
from .job import Job
from .structs import (Antialias, ColourSpace, Frame, SplatQuantity, StippleCloudArrays, StippleCloudBuffers,
                      StippleCloudColumnBuffers, StippleCloudColumns, StippleCloudComparison, StippleCloudInfo,
                      StippleCloudSaveOptions, StippleSceneObject)

# Floats of a splat in each attribute that Blender stores. 'base' is the harmonics of degree 0 and the opacity; those
# above are columns of their own, named by number from 0 on.
COLUMN_WIDTHS = {'positions': 3, 'rotations': 4, 'scales': 3, 'base': 4}
_REST_WIDTH = 3

SAVE_OPTIONS = ('ascii', 'sh_degree_limit', 'format_version', 'frame', 'half')


def save_options(library, **options_given):
    """StippleCloudSaveOptions with some of its fields, such as ascii=1. Errors: StippleError for one that is
    unknown."""
    options = StippleCloudSaveOptions()
    library.stipple_cloud_save_options_init(byref(options))
    for name, value in options_given.items():
        if name not in SAVE_OPTIONS:
            raise invalid(f'Save option {name} is unknown; {", ".join(SAVE_OPTIONS)} are allowed.')
        setattr(options, name, int(value))
    return options


@dataclass
class SplatArrays:
    """Splats as arrays, float32; conventions of stipple.h."""

    positions: np.ndarray  # [N,3] metres
    rotations: np.ndarray  # [N,4] w,x,y,z
    scales: np.ndarray     # [N,3] linear standard deviations
    opacities: np.ndarray  # [N] 0..1
    sh: np.ndarray         # [N,(degree+1)^2,3]
    colour_space: int = ColourSpace.DISPLAY
    antialias: int = Antialias.CLASSIC
    frame: int = Frame.UNKNOWN  # which way the axes of the positions point
    seen: dict = field(default_factory=dict)  # what density control saw of each: [N] by SplatQuantity, SPLIT_AXIS never

    @property
    def count(self):
        return len(self.positions)

    @property
    def sh_degree(self):
        return sh_degree_of(self.sh.shape[1])

    def column(self, name):
        """[N,3] or [N,4] of an attribute as Blender stores it (COLUMN_WIDTHS)."""
        if isinstance(name, int):
            return self.sh[:, name + 1]
        if name != 'base':
            return getattr(self, name)
        return np.concatenate([self.sh[:, 0], self.opacities[:, None]], axis=1)

    def to_cloud(self, context):
        return Cloud.create(context, self)


class CloudColumns:
    """The splats of a native cloud, read an attribute at a time: what a SplatArrays tells, in a fraction of its
    memory."""

    def __init__(self, cloud):
        self._cloud = cloud
        info = cloud.info()
        self.count, self.sh_degree = info.count, info.sh_degree
        self.colour_space, self.antialias = ColourSpace(info.colour_space), Antialias(info.antialias)
        self.frame = Frame(info.frame)
        self.seen = cloud.seen()
        self._room = np.empty(4 * info.count, np.float32)

    def column(self, name):
        """As SplatArrays.column. The next column is read over it."""
        width = COLUMN_WIDTHS.get(name, _REST_WIDTH)
        values = self._room[:width * self.count].reshape(self.count, width)
        self._cloud.read_column(name, values)
        return values

    def to_cloud(self, _context):
        return self._cloud


def sh_degree_of(coefficient_count):
    """The degree whose harmonics have this many coefficients: 1, 4, 9, 16, 25."""
    for degree in range(5):
        if (degree + 1) ** 2 == coefficient_count:
            return degree
    raise invalid(f'A splat has {coefficient_count} harmonic coefficients; allowed are 1, 4, 9, 16 and 25.')


class Cloud(Handle):
    free_function = 'stipple_cloud_free'
    job_function = 'stipple_job_cloud'

    @classmethod
    def create(cls, context, arrays):
        positions = contiguous(arrays.positions)
        count = len(positions)
        fields = {'positions': (positions, (count, 3)), 'rotations': (contiguous(arrays.rotations), (count, 4)),
                  'scales': (contiguous(arrays.scales), (count, 3)),
                  'opacities': (contiguous(arrays.opacities), (count,)),
                  'sh': (contiguous(arrays.sh), (count, (arrays.sh_degree + 1) ** 2, 3))}
        for name, (array, shape) in fields.items():
            if array.shape != shape:
                raise invalid(f'Splat array {name} has shape {array.shape}; allowed is {shape}.')
        given = StippleCloudArrays(sh_degree=arrays.sh_degree, colour_space=int(arrays.colour_space),
                                   antialias=int(arrays.antialias), frame=int(arrays.frame), count=count,
                                   **{name: pointer_to(array) for name, (array, _) in fields.items()})
        return cls(context.library, new_handle(context.library, 'stipple_cloud_create', context.pointer, byref(given)))

    @classmethod
    def from_columns(cls, context, columns, rest, colour_space, antialias, frame):
        """The cloud of attributes as Blender stores them; columns: those of COLUMN_WIDTHS, rest: [[N,3]] in order.
        Arrays are flat or not, and are copied."""
        arrays = {name: contiguous(columns[name]) for name in COLUMN_WIDTHS}
        count = arrays['positions'].size // 3
        rest = [contiguous(values) for values in rest]
        for name, values in (*arrays.items(), *enumerate(rest)):
            if values.size != count * COLUMN_WIDTHS.get(name, _REST_WIDTH):
                raise invalid(f'Splat column {name} has {values.size} values; {count} splats have '
                              f'{count * COLUMN_WIDTHS.get(name, _REST_WIDTH)}.')
        given = StippleCloudColumns(sh_degree=sh_degree_of(len(rest) + 1), colour_space=int(colour_space),
                                    antialias=int(antialias), frame=int(frame), count=count,
                                    **{name: pointer_to(values) for name, values in arrays.items()})
        for i, values in enumerate(rest):
            given.rest[i] = pointer_to(values)
        return cls(context.library, new_handle(context.library, 'stipple_cloud_create_from_columns', context.pointer,
                                               byref(given)))

    @classmethod
    def load(cls, context, path):
        return cls(context.library,
                   new_handle(context.library, 'stipple_cloud_load', context.pointer, path_bytes(path)))

    @staticmethod
    def load_start(context, path):
        """A job that makes the Cloud of a file: reads ahead."""
        return Job(context.library,
                   new_handle(context.library, 'stipple_cloud_load_start', context.pointer, path_bytes(path)))

    def info(self):
        info = StippleCloudInfo()
        self._check(self.library.stipple_cloud_info(self.pointer, byref(info)))
        return info

    def read(self):
        """All splats as new arrays."""
        info = self.info()
        n, coefficients = info.count, (info.sh_degree + 1) ** 2
        arrays = SplatArrays(np.empty((n, 3), np.float32), np.empty((n, 4), np.float32), np.empty((n, 3), np.float32),
                             np.empty(n, np.float32), np.empty((n, coefficients, 3), np.float32),
                             ColourSpace(info.colour_space), Antialias(info.antialias), Frame(info.frame), self.seen())
        buffers = StippleCloudBuffers(capacity=n, positions=pointer_to(arrays.positions),
                                      rotations=pointer_to(arrays.rotations), scales=pointer_to(arrays.scales),
                                      opacities=pointer_to(arrays.opacities), sh=pointer_to(arrays.sh))
        self._check(self.library.stipple_cloud_read(self.pointer, byref(buffers)))
        return arrays

    def columns(self):
        return CloudColumns(self)

    def quantity(self, kind):
        """[N] or, of SPLIT_AXIS, [N,3] of a SplatQuantity; None where it is not known."""
        count = c_uint64()
        self._check(self.library.stipple_cloud_quantity(self.pointer, int(kind), 0, None, byref(count)))
        if count.value == 0:
            return None
        values = np.empty(count.value, np.float32)
        self._check(self.library.stipple_cloud_quantity(self.pointer, int(kind), values.size, pointer_to(values),
                                                        byref(count)))
        return values.reshape(-1, 3) if kind == SplatQuantity.SPLIT_AXIS else values

    def seen(self):
        """What density control saw of each splat, as SplatArrays has it."""
        found = {kind: self.quantity(kind) for kind in SplatQuantity if kind != SplatQuantity.SPLIT_AXIS}
        return {kind: values for kind, values in found.items() if values is not None}

    def read_column(self, name, values):
        """Fills a contiguous array with an attribute as Blender stores it (COLUMN_WIDTHS)."""
        buffers = StippleCloudColumnBuffers(capacity=len(values))
        if isinstance(name, int):
            buffers.rest[name] = pointer_to(values)
        else:
            setattr(buffers, name, pointer_to(values))
        self._check(self.library.stipple_cloud_read_columns(self.pointer, byref(buffers)))

    def positions(self):
        """[N,3] as a new array."""
        values = np.empty((self.info().count, 3), np.float32)
        buffers = StippleCloudBuffers(capacity=len(values), positions=pointer_to(values))
        self._check(self.library.stipple_cloud_read(self.pointer, byref(buffers)))
        return values

    def opacities(self):
        """[N] as a new array."""
        values = np.empty(self.info().count, np.float32)
        buffers = StippleCloudBuffers(capacity=len(values), opacities=pointer_to(values))
        self._check(self.library.stipple_cloud_read(self.pointer, byref(buffers)))
        return values

    def pack_into(self, geometry):
        """Fills rows [N,12] of a float texture that a graphics card draws the splats from."""
        self._check(self.library.stipple_cloud_pack(self.pointer, pointer_to(geometry), len(geometry)))

    def save(self, path, **options_given):
        """Writes by the extension; options_given: fields of StippleCloudSaveOptions, such as ascii=1."""
        options = save_options(self.library, **options_given)
        self._check(self.library.stipple_cloud_save(self.pointer, path_bytes(path), byref(options)))

    def transformed(self, matrix):
        """The cloud moved by any 4x4 matrix that can be inverted; harmonics are rotated too."""
        return Cloud(self.library, new_handle(self.library, 'stipple_cloud_transform', self.pointer, matrix16(matrix)))

    def compare(self, other):
        result = StippleCloudComparison()
        self._check(self.library.stipple_cloud_compare(self.pointer, other.pointer, byref(result)))
        return result


def save_scene(objects, path, matrices_lead_to=Frame.UNKNOWN, **options_given):
    """Writes [(name, cloud, 4x4 matrix)] as prims of a USD layer or package; splats that several objects show are in
    the file once. matrices_lead_to: a frame; options_given: as Cloud.save has them."""
    if not objects:
        raise invalid('There is nothing to write; at least one object is needed.')
    library = objects[0][1].library
    array = (StippleSceneObject * len(objects))()
    for entry, (name, cloud, matrix) in zip(array, objects):
        entry.__init__(name_utf8=name.encode(), cloud=cloud.pointer, matrix=matrix16(matrix))
    options = save_options(library, **options_given)
    check(library, library.stipple_scene_save(array, len(objects), int(matrices_lead_to), path_bytes(path), byref(options)))
