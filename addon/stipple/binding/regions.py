# SPDX-License-Identifier: GPL-3.0-or-later
"""Selecting splats by regions, keeping regions as text, and filling holes.

A selection is a uint8 array [N]: 1 for a selected splat. Regions, applied in order, make one of another.
"""

import base64
import binascii
import math
import zlib
from ctypes import byref, c_double, c_uint64
from dataclasses import dataclass, fields

import numpy as np

from .cloud import Cloud
from .errors import check, invalid
from .handle import contiguous, new_handle, pointer_to
from .job import Job
from .structs import RegionKind, RegionOperation, StippleFillOptions, StippleFillReport, StippleRegion

RECORD_VERSION = 1
MAX_VALUES = 1 << 24  # of an array in a record: an image of depths with 16 million pixels

_VIEW = ('cloud_to_pixels',)
_FRONT = ('cloud_to_pixels', 'cloud_to_depth', 'depths', 'depth_rect', 'depth_margin')
# What each kind reads; a record holds that, and what limits it to the front where there are depths.
_READS = {RegionKind.ALL: (), RegionKind.BRUSH: (*_VIEW, 'points', 'radius'), RegionKind.LASSO: (*_VIEW, 'points'),
          RegionKind.SPHERE: ('centre', 'radius', 'cloud_to_box'),
          RegionKind.COLOUR: ('colour', 'tolerance', 'centre', 'radius', 'cloud_to_box'),
          RegionKind.GROW: ('distance', 'shrink'),
          RegionKind.BOX: ('cloud_to_box',)}
_SHAPES = {'cloud_to_pixels': (4, 4), 'cloud_to_depth': (4,), 'points': (None, 2), 'depths': (None, None),
           'depth_rect': (4,), 'centre': (3,), 'colour': (3,), 'cloud_to_box': (4, 4)}
_SINGLE = ('points', 'depths')  # float32; all others are float64


@dataclass(frozen=True, eq=False)
class Region:
    """Where splats are selected, and what that does to the selection; fields as in StippleRegion."""
    kind: RegionKind
    operation: RegionOperation = RegionOperation.SET
    cloud_to_pixels: object = None  # [4,4]
    cloud_to_depth: object = None   # [4]
    points: object = None           # [n,2] pixels
    radius: float = 0.0
    depths: object = None           # [height,width]; None: through
    depth_rect: object = None       # [4] x0, y0, x1, y1
    depth_margin: float = 0.0
    centre: object = None           # [3]
    colour: object = None           # [3] linear
    tolerance: float = 0.0
    cloud_to_box: object = None     # [4,4]
    distance: float = 0.0
    shrink: bool = False

    def __post_init__(self):
        object.__setattr__(self, 'kind', RegionKind(self.kind))
        object.__setattr__(self, 'operation', RegionOperation(self.operation))
        object.__setattr__(self, 'shrink', bool(self.shrink))
        for name, shape in _SHAPES.items():
            value = getattr(self, name)
            if value is not None:
                value = contiguous(value, np.float32 if name in _SINGLE else np.float64)
                if len(value.shape) != len(shape) or any(n not in (None, m) for n, m in zip(shape, value.shape)):
                    wanted = ' x '.join('n' if n is None else str(n) for n in shape)
                    seen = ' x '.join(map(str, value.shape))
                    raise invalid(f'{name} of a region has the shape {seen}; {wanted} is needed.')
                object.__setattr__(self, name, value)
        for name in self._reads():
            if name in _SHAPES and getattr(self, name) is None and not self._is_optional(name):
                raise invalid(f'A region of the kind {self.kind.name} needs {name}.')

    def _reads(self):
        """Names of the fields that this region reads."""
        front = _FRONT if self.depths is not None and self.kind != RegionKind.GROW else ()
        return tuple(dict.fromkeys(_READS[self.kind] + front))

    def _is_optional(self, name):
        if name == 'cloud_to_box':
            return self.kind != RegionKind.BOX  # spheres lie in the space of the cloud then
        return name == 'centre' and self.kind == RegionKind.COLOUR and self.radius == 0

    def to_record(self):
        """A dictionary of texts and numbers, for JSON and ID properties."""
        record = {'version': RECORD_VERSION, 'kind': self.kind.name, 'operation': self.operation.name}
        for name in self._reads():
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                packed = base64.b64encode(zlib.compress(value.tobytes(), 6)).decode()
                record[name] = {'shape': list(value.shape), 'data': packed}
            elif value is not None:
                record[name] = float(value)
        return record

    @classmethod
    def from_record(cls, record):
        """The region of a record. Errors: StippleError for a record that this version cannot read."""
        if not hasattr(record, 'get'):
            raise invalid('A stored region is not a record.')
        version = record.get('version')
        if version != RECORD_VERSION:
            raise invalid(f'A stored region has the version {version}; this version of Stipple reads '
                          f'{RECORD_VERSION}. Open the file with the version that wrote it.')
        kind, operation = record.get('kind'), record.get('operation')
        if kind not in RegionKind.__members__:
            raise invalid(f'A stored region has the kind {kind}, which this version of Stipple does not know.')
        if operation not in RegionOperation.__members__:
            raise invalid(f'A stored region has the operation {operation}, which this version of Stipple does not '
                          'know.')
        names = {field.name for field in fields(cls)} - {'kind', 'operation'}
        values = {name: _array_of(name, record[name]) if name in _SHAPES else _number_of(name, record[name])
                  for name in names if name in record}
        return cls(RegionKind[kind], RegionOperation[operation], **values)


def _number_of(name, value):
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise invalid(f'{name} of a stored region is not a number.')
    return float(value)


def _array_of(name, packed):
    """The array of a record; its size is checked before anything is unpacked."""
    broken = invalid(f'{name} of a stored region cannot be read; its data are damaged.')
    if not hasattr(packed, 'get'):
        raise broken
    shape = packed.get('shape')
    try:
        shape = tuple(int(n) for n in shape)
    except (TypeError, ValueError, OverflowError):
        raise broken from None
    if not shape or len(shape) > 2 or any(n < 0 for n in shape) or math.prod(shape) > MAX_VALUES:
        raise invalid(f'{name} of a stored region has the shape {shape}; at most {MAX_VALUES} values are allowed.')
    dtype = np.dtype(np.float32 if name in _SINGLE else np.float64)
    wanted = math.prod(shape) * dtype.itemsize
    try:
        unpacker = zlib.decompressobj()
        data = unpacker.decompress(base64.b64decode(packed.get('data'), validate=True), wanted + 1)
    except (TypeError, ValueError, binascii.Error, zlib.error):
        raise broken from None
    if len(data) != wanted:
        raise broken
    return np.frombuffer(data, dtype).reshape(shape)


def _struct_of(library, region):
    """The region in C; its arrays belong to the region."""
    made = StippleRegion()
    library.stipple_region_init(byref(made))
    made.kind, made.operation = int(region.kind), int(region.operation)
    made.shrink = int(region.shrink)
    for name in ('radius', 'depth_margin', 'tolerance', 'distance'):
        setattr(made, name, getattr(region, name))
    for name, shape in _SHAPES.items():
        value = getattr(region, name)
        if value is not None and name not in _SINGLE:
            setattr(made, name, (c_double * math.prod(shape))(*value.reshape(-1)))
    if region.points is not None:
        made.points, made.point_count = pointer_to(region.points), len(region.points)
    if region.depths is not None:
        made.depths = pointer_to(region.depths)
        made.depth_height, made.depth_width = region.depths.shape
    return made


def select(cloud, regions, mask=None):
    """The selection after regions in order, from a selection before (None: nothing is selected)."""
    regions = list(regions)
    count = cloud.info().count
    # One of its own: the library writes into it.
    mask = np.zeros(count, np.uint8) if mask is None else np.array(mask, np.uint8, order='C')
    structs = (StippleRegion * len(regions))(*(_struct_of(cloud.library, region) for region in regions))
    check(cloud.library, cloud.library.stipple_cloud_select_regions(cloud.pointer, structs, len(regions),
                                                                    pointer_to(mask), len(mask), None))
    return mask


def selected_positions(cloud, mask, most):
    """Centres [n,3] of selected splats for drawing: all, or `most` that are evenly spread."""
    if most < 0:
        raise invalid(f'Positions to draw are {most}; allowed are 0 and above.')
    mask = contiguous(mask, np.uint8)
    most = min(most, int(np.count_nonzero(mask)))
    positions, written = np.empty((most, 3), np.float32), c_uint64()
    check(cloud.library, cloud.library.stipple_cloud_selected_positions(cloud.pointer, pointer_to(mask), len(mask),
                                                                        most, pointer_to(positions), byref(written)))
    return positions[:written.value]


def colours(cloud, indices):
    """Colours [n,3], linear Rec.709 of degree 0, of the splats with these indices: what a colour region compares."""
    indices = contiguous(indices, np.uint64).reshape(-1)
    found = np.empty((len(indices), 3), np.float64)
    check(cloud.library, cloud.library.stipple_region_colours(cloud.pointer, pointer_to(indices), len(indices),
                                                              pointer_to(found)))
    return found


@dataclass(frozen=True)
class FillSettings:
    radius: float = 0.0      # 0: from the distances of the removed splats
    ring_width: float = 0.0  # 0: from the size of the hole
    patch_size: float = 0.0  # 0: from the size of the hole
    seed: int = 0


class FillTask:
    """Holes being filled: wait for `job`, then read `report` and cloud()."""

    def __init__(self, job, report):
        self.job = job
        self.report = report

    def cloud(self):
        """The new splats alone; no splats where nothing could be filled."""
        return Cloud.of_job(self.job)


def fill_start(cloud, hole_mask, settings=FillSettings()):
    """A task for the splats that close the holes which the mask removes (1: removed)."""
    mask = contiguous(hole_mask, np.uint8)
    options = StippleFillOptions()
    cloud.library.stipple_fill_options_init(byref(options))
    options.radius, options.ring_width = settings.radius, settings.ring_width
    options.patch_size, options.seed = settings.patch_size, settings.seed
    report = StippleFillReport()
    job = Job(cloud.library, new_handle(cloud.library, 'stipple_cloud_fill_start', cloud.pointer, byref(options),
                                        pointer_to(mask), len(mask), byref(report)), keep=(report,))
    return FillTask(job, report)
