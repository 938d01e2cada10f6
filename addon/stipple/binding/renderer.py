# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of splats."""

from ctypes import byref, c_double, c_uint32, c_uint64, pointer

import numpy as np

from .errors import invalid
from .handle import Handle, contiguous, matrix16, new_handle, pointer_to
from .job import Job
from .structs import (BlendSpace, LowPass, ObjectOrder, OutputColour, RenderMethod, StippleInstance,
                      StippleRenderBuffers, StippleRenderOptions)

EMPTY_DEPTH = 1e10  # metres; what Blender also writes where nothing is


def instance_array(instances):
    """[(cloud, 4x4 object to world)], or with a third value, whether it is a holdout, as the header's array; a
    GradedCloud brings its grade, which it must outlive."""
    array = (StippleInstance * max(len(instances), 1))()
    for entry, (cloud, matrix, *holdout) in zip(array, instances):
        grade = getattr(cloud, 'grade', None)
        entry.__init__(cloud=cloud.pointer, matrix=matrix16(matrix),
                       grade=pointer(grade) if grade is not None else None, holdout=any(holdout))
    return array


class Surface:
    """Something else between the splats, a mesh: arrays as in StippleRenderOptions, row 0 = top.

    depth [H,W] metres; colour [H,W,4] premultiplied, or None for a matte, of opacity [H,W]; with a colour, opacity is
    what it hides, its alpha and what it holds out, or None for its alpha. light [H,W,3] factors of the splats, or None.
    """

    def __init__(self, depth, colour=None, light=None, opacity=None):
        self.depth = contiguous(depth)
        shape = self.depth.shape
        self.colour = _layer('colour', colour, shape + (4,))
        self.opacity = _layer('opacity', opacity, shape)
        self.light = _layer('light', light, shape + (3,))

    def put_into(self, options):
        """A copy of the options, with this surface; the arrays must outlive its use."""
        options = type(options).from_buffer_copy(options)
        options.surface_height, options.surface_width = self.depth.shape
        options.surface_depth = pointer_to(self.depth)
        options.matte_opacity = pointer_to(self.opacity)
        options.surface_colour, options.splat_light = pointer_to(self.colour), pointer_to(self.light)
        return options


def _layer(name, array, shape):
    if array is None:
        return None
    if array.shape != shape:
        raise invalid(f'Surface array {name} has shape {array.shape}; allowed is {shape}.')
    return contiguous(array)


class RenderTask:
    """An image that is being made: poll, cancel or wait through `job`, then read the arrays."""

    def __init__(self, job, colour, depth, transmittance=None, normal=None, objects=None):
        self.job = job
        self.colour = colour  # [H,W,4] premultiplied, row 0 = top
        self.depth = depth    # [H,W] metres, or None
        self.transmittance = transmittance  # [H,W] of the light behind everything, or None
        self.normal = normal    # [H,W,3] in the world, 0 where no splat shows, or None
        self.objects = objects  # [H,W] 1 + the instance that weighs most, 0 for none, or None


class Renderer(Handle):
    free_function = 'stipple_renderer_free'

    def __init__(self, context):
        super().__init__(context.library, new_handle(context.library, 'stipple_renderer_create', context.pointer))

    def options(self, blend_space=BlendSpace.AS_TRAINED, output_colour=OutputColour.SCENE_LINEAR,
                low_pass=LowPass.FROM_CLOUD, method=RenderMethod.TILED, background=None, accuracy=None,
                object_order=ObjectOrder.TOGETHER, solid_depth=False):
        """background: three values in output_colour's space, or None for a transparent image. accuracy: a
        StippleAccuracy, or None for final. solid_depth: depth only where half of a pixel is covered or more."""
        options = StippleRenderOptions()
        self.library.stipple_render_options_init(byref(options))
        options.blend_space, options.output_colour = int(blend_space), int(output_colour)
        options.low_pass, options.method = int(low_pass), int(method)
        options.object_order, options.solid_depth = int(object_order), int(solid_depth)
        if background is not None:
            options.with_background = 1
            options.background = (c_double * 3)(*background)
        if accuracy is not None:
            options.accuracy = pointer(accuracy)
        return options

    def start(self, instances, camera, options, with_depth=True, median_depth=False, surface=None,
              with_transmittance=False, blur=None, with_normal=False, with_objects=False, background_image=None,
              surroundings=None):
        """Starts the image of instances, as of instance_array; clouds must outlive the start only.

        median_depth: where light is half gone, instead of the mean depth of what is seen. surface: a Surface that
        stands between the splats. blur: a Blur, aperture and shutter. background_image [H,W,3]: what stands behind
        everything, row 0 = top, in place of the options' background. surroundings [h,w,3]: the same of all
        directions, row 0 straight up, the middle column along +y, columns further right towards +x.
        """
        shape = (camera.height, camera.width)
        if background_image is not None:
            if background_image.shape != shape + (3,):
                raise invalid(f'The image behind the splats has shape {background_image.shape}; allowed is '
                              f'{shape + (3,)}.')
            background_image = contiguous(background_image)
            options = type(options).from_buffer_copy(options)
            options.background_image = pointer_to(background_image)
        if surroundings is not None:
            if surroundings.ndim != 3 or surroundings.shape[2] != 3:
                raise invalid(f'The surroundings have shape {surroundings.shape}; allowed is (height, width, 3).')
            surroundings = contiguous(surroundings)
            options = type(options).from_buffer_copy(options)
            options.surroundings = pointer_to(surroundings)
            options.surroundings_height, options.surroundings_width = surroundings.shape[:2]
        for layer in (surface, blur):
            options = layer.put_into(options) if layer is not None else options
        colour = np.empty(shape + (4,), np.float32)
        depth = np.empty(shape, np.float32) if with_depth else None
        transmittance = np.empty(shape, np.float32) if with_transmittance else None
        normal = np.empty(shape + (3,), np.float32) if with_normal else None
        objects = np.empty(shape, np.uint32) if with_objects else None
        buffers = StippleRenderBuffers(colour=pointer_to(colour), transmittance=pointer_to(transmittance),
                                       normal=pointer_to(normal), object_index=pointer_to(objects))
        setattr(buffers, 'median_depth' if median_depth else 'depth', pointer_to(depth))
        array = instance_array(instances)
        job = Job(self.library, new_handle(self.library, 'stipple_renderer_render_start', self.pointer, array,
                                           len(instances), byref(camera), byref(options), byref(buffers)),
                  keep=(colour, depth, transmittance, normal, objects, buffers, array, surface, background_image,
                        surroundings, [placed[0] for placed in instances]))
        return RenderTask(job, colour, depth, transmittance, normal, objects)

    def sample_count(self, instances, camera, options, blur):
        """How many images a Blur is averaged from."""
        count, options = c_uint32(), blur.put_into(options)
        self._check(self.library.stipple_renderer_sample_count(self.pointer, instance_array(instances), len(instances),
                                                               byref(camera), byref(options), byref(count)))
        return count.value

    def memory_bound(self, instances, camera):
        size = c_uint64()
        self._check(self.library.stipple_renderer_memory_bound(self.pointer, instance_array(instances), len(instances),
                                                               byref(camera), byref(size)))
        return size.value
