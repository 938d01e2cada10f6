# SPDX-License-Identifier: GPL-3.0-or-later
"""Differentiable rendering: what a loss changes by every number of the splats, and the loss of trained splats."""

from ctypes import byref, c_uint64

import numpy as np

from .errors import check, invalid
from .handle import contiguous, new_handle, pointer_to
from .job import Job
from .renderer import instance_array
from .structs import (StippleBackwardInput, StippleBackwardResult, StippleImageLoss, StippleImageLossOptions,
                      StippleSplatGradients)

# Statistic of a splat: shape after the number of splats, and the image that it needs.
STATISTICS = {'contributions': ((), 'residual'), 'blending_weights': ((), None), 'edge_weights': ((), 'edge_weights'),
              'screen_gradients': ((2,), None), 'absolute_screen_gradients': ((2,), None),
              'screen_gradient_norms': ((), None), 'errors': ((), 'errors'), 'largest_errors': ((), 'errors')}


class GradientsTask:
    """Derivatives that are being made: poll, cancel or wait through `job`, then read the rest."""

    def __init__(self, job, instances, result):
        self.job = job
        self.instances = instances  # one dictionary per instance: name as in StippleSplatGradients -> array
        self._result = result

    @property
    def camera(self):
        """[6] by a motion of the camera in its own frame: radians, then metres."""
        return np.array(self._result.camera)

    @property
    def background(self):
        """[3]; zeros without a background."""
        return np.array(self._result.background)

    @property
    def visible_count(self):
        return self._result.visible_count


class Backward:
    """The call's structs, with the arrays that they point into."""

    def __init__(self, instances, camera, colour_gradient, statistics, images):
        shape = (camera.height, camera.width)
        channels = {'colour_gradient': (4,), 'residual': (3,)}
        given = {name: contiguous(values) for name, values in
                 dict(images, colour_gradient=colour_gradient).items() if values is not None}
        for name, values in given.items():
            wanted = shape + channels.get(name, ())
            if values.shape != wanted:
                raise invalid(f'Image {name} has shape {values.shape}; allowed is {wanted}.')
        unknown = set(statistics) - set(STATISTICS)
        if unknown:
            raise invalid(f"Statistic '{min(unknown)}' is not known; allowed are {', '.join(STATISTICS)}.")
        self.arrays = [self._arrays(cloud, statistics) for cloud, _ in instances]
        self.input = StippleBackwardInput(**{name: pointer_to(values) for name, values in given.items()})
        self.gradients = (StippleSplatGradients * max(len(instances), 1))()
        for entry, arrays in zip(self.gradients, self.arrays):
            entry.__init__(capacity=len(arrays['opacities']),
                           **{name: pointer_to(values) for name, values in arrays.items()})
        self.result = StippleBackwardResult()
        self.placed = instance_array(instances)
        self.keep = (given, [cloud for cloud, _ in instances])

    @staticmethod
    def _arrays(cloud, statistics):
        info = cloud.info()
        shapes = {'positions': (3,), 'rotations': (4,), 'scales': (3,), 'opacities': (),
                  'sh': ((info.sh_degree + 1) ** 2, 3), **{name: STATISTICS[name][0] for name in statistics}}
        return {name: np.zeros((info.count,) + shape, np.float32) for name, shape in shapes.items()}


def start_backward(renderer, instances, camera, options, colour_gradient, statistics=(), residual=None,
                   residual_weights=None, edge_weights=None, errors=None, depth_gradient=None):
    """Starts the derivative of a loss by instances [(cloud, matrix)], from its derivative by the image that
    `renderer` draws of the same arguments, [H,W,4]. statistics: names of STATISTICS; images: see stipple.h.
    options must ask for composited colours. Clouds and images need not outlive the start."""
    call = Backward(instances, camera, colour_gradient, statistics,
                    {'residual': residual, 'residual_weights': residual_weights, 'edge_weights': edge_weights,
                     'errors': errors, 'depth_gradient': depth_gradient})
    job = Job(renderer.library,
              new_handle(renderer.library, 'stipple_renderer_backward_start', renderer.pointer, call.placed,
                         len(instances), byref(camera), byref(options), byref(call.input), call.gradients,
                         byref(call.result)), keep=call)
    return GradientsTask(job, call.arrays, call.result)


def backward_memory_bound(renderer, instances, camera, colour_gradient, statistics=(), **images):
    """Bytes that the same start_backward would allocate at most, beside its arrays."""
    call = Backward(instances, camera, colour_gradient, statistics, images)
    size = c_uint64()
    check(renderer.library, renderer.library.stipple_renderer_backward_memory_bound(
        renderer.pointer, call.placed, len(instances), byref(camera), byref(call.input), call.gradients, byref(size)))
    return size.value


def image_loss(context, rendered, target, weights=None, ssim_share=0.2, with_gradient=True):
    """(loss, l1, ssim, gradient) of images [H,W,3 or 4] as composited; gradient [as rendered] or None."""
    rendered, target = contiguous(rendered), contiguous(target)
    for name, image in (('rendered', rendered), ('target', target)):
        if image.ndim != 3 or image.shape[:2] != rendered.shape[:2]:
            raise invalid(f'Image {name} has shape {image.shape}; allowed is {rendered.shape[:2]} by 3 or 4.')
    weights = None if weights is None else contiguous(weights)
    if weights is not None and weights.shape != rendered.shape[:2]:
        raise invalid(f'Weights have shape {weights.shape}; allowed is {rendered.shape[:2]}.')
    library = context.library
    options = StippleImageLossOptions()
    library.stipple_image_loss_options_init(byref(options))
    options.rendered_channels, options.target_channels = rendered.shape[2], target.shape[2]
    options.ssim_share = ssim_share
    gradient = np.empty_like(rendered) if with_gradient else None
    value = StippleImageLoss()
    height, width = rendered.shape[:2]
    check(library, library.stipple_image_loss(context.pointer, width, height, pointer_to(rendered), pointer_to(target),
                                              pointer_to(weights), byref(options), byref(value), pointer_to(gradient)))
    return value.loss, value.l1, value.ssim, gradient
