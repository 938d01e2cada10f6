# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that take another shape and keep their triangles."""

from ctypes import byref, c_void_p

import numpy as np

from .cloud import Cloud
from .errors import check, invalid
from .handle import contiguous, new_handle, pointer_to
from .job import Job
from .mesh import Mesh
from .structs import StippleMeshAdaptOptions, StippleMeshAdaptReport, StippleMeshAdaptTarget
from .views import Views


class Adaptation(Job):
    """Such a job: it can be looked at and ended while it runs."""

    def preview(self):
        """The newest shape (Mesh), each once, or None; asks for the next. Never waits."""
        pointer = c_void_p()
        self._check(self.library.stipple_mesh_adapt_preview(self.pointer, byref(pointer)))
        return Mesh(self.library, pointer.value) if pointer.value else None

    def finish(self):
        """Asks the steps to end soon: the job then ends well, with the shape that it has. Does not wait."""
        self._check(self.library.stipple_mesh_adapt_finish(self.pointer))


def start_adapt(template, target, landmarks=(), **settings):
    """Starts giving a Mesh the shape of a target, as an Adaptation: Mesh.of_job() of it is the template with other
    positions.

    target: a Mesh, a Cloud, Views, or (points [P,3], normals [P,3] or None). landmarks: (vertex of the template, place [3])
    each, metres. settings: fields of StippleMeshAdaptOptions. Errors: StippleError."""
    library = template.library
    options = StippleMeshAdaptOptions()
    library.stipple_mesh_adapt_options_init(byref(options))
    for name, value in settings.items():
        setattr(options, name, value)
    vertices = contiguous([vertex for vertex, _ in landmarks], np.uint32)
    places = _rows([place for _, place in landmarks], 'places of landmarks')
    options.landmark_count = len(vertices)
    options.landmark_vertices, options.landmark_places = pointer_to(vertices), pointer_to(places)
    aim, kept = _target(target)
    return Adaptation(library, new_handle(library, 'stipple_mesh_adapt_start', template.pointer, byref(aim),
                                          byref(options)), keep=(vertices, places, kept))


def adapt_report(job):
    """StippleMeshAdaptReport of such a job that has ended well."""
    report = StippleMeshAdaptReport()
    check(job.library, job.library.stipple_job_adapt_report(job.pointer, byref(report)))
    return report


def _target(target):
    """(struct, what it points to)."""
    if isinstance(target, Mesh):
        return StippleMeshAdaptTarget(mesh=target.pointer), target
    if isinstance(target, Views):
        return StippleMeshAdaptTarget(views=target.pointer), target
    if isinstance(target, Cloud):
        return StippleMeshAdaptTarget(cloud=target.pointer), target
    points = _rows(target[0], 'points of the target')
    normals = None if target[1] is None else _rows(target[1], 'normals of the target')
    if normals is not None and len(normals) != len(points):
        raise invalid(f'The target has {len(normals)} normals; its {len(points)} points need one each.')
    return (StippleMeshAdaptTarget(points=pointer_to(points), normals=pointer_to(normals), point_count=len(points)),
            (points, normals))


def _rows(values, what):
    rows = contiguous(values)
    if rows.size == 0:
        return np.zeros((0, 3), np.float32)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise invalid(f'The {what} have shape {rows.shape}; [count, 3] is allowed.')
    return rows
