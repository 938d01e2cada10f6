# SPDX-License-Identifier: GPL-3.0-or-later
"""What a graphics card needs to draw splats: geometry once per cloud, an order for every view."""

from ctypes import byref

import numpy as np

from .errors import invalid
from .handle import new_handle, pointer_to
from .job import Job
from .renderer import instance_array
from .structs import DRAW_GEOMETRY_FLOATS, DRAW_ROW_FLOATS, MAX_DRAW_ROWS, StippleDrawOrderBuffers


class OrderTask:
    """An order that is being made: poll or wait through `job`, then read `rows`."""

    def __init__(self, job, rows, count):
        self.job = job
        self.rows = rows    # [padded count, 4] back to front
        self.count = count  # of splats; rows behind them are zeros


def pack(clouds, counts, multiple=1):
    """Geometry [rows,12] of clouds one after the other, and the first row of each.

    multiple: the number of rows is rounded up to it; rows that no splat has are zeros.
    """
    first_rows = np.concatenate([[0], np.cumsum(counts)]).astype(np.uint64)
    total = int(first_rows[-1])
    if total > MAX_DRAW_ROWS:
        raise invalid(f'The view holds {total:,} splats; at most {MAX_DRAW_ROWS:,} can be drawn together.')
    geometry = np.zeros((-(-total // multiple) * multiple, DRAW_GEOMETRY_FLOATS), np.float32)
    for cloud, count, first in zip(clouds, counts, first_rows):
        part = geometry[int(first):int(first) + count]
        cloud.pack_into(part)
    return geometry, first_rows[:-1]


def start(renderer, instances, count, first_rows, camera, multiple=1, sh_degree_limit=4):
    """Orders instances [(cloud, matrix)] of `count` splats together; clouds must outlive the start only."""
    rows = np.zeros((-(-count // multiple) * multiple, DRAW_ROW_FLOATS), np.float32)
    first_rows = np.ascontiguousarray(first_rows, np.uint64)
    buffers = StippleDrawOrderBuffers(sh_degree_limit=sh_degree_limit, capacity=count, rows=pointer_to(rows),
                                      first_rows=pointer_to(first_rows))
    array = instance_array(instances)
    job = Job(renderer.library, new_handle(renderer.library, 'stipple_renderer_order_start', renderer.pointer, array,
                                           len(instances), byref(camera), byref(buffers)),
              keep=(rows, first_rows, buffers, array, [cloud for cloud, _ in instances]))
    return OrderTask(job, rows, count)
