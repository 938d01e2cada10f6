# SPDX-License-Identifier: GPL-3.0-or-later
"""Paints worlds in all directions, in a Blender of its own that view_world.py starts: a script, not a module.

Each line of the input is one request in JSON: `file`, a .blend with the world; `world`, its name; `frame`; `steps`,
[[width, samples, path]]. Each step writes its picture to its path when it is done. A newer request ends an older one
between two steps; the end of the input, or ten minutes without a request, ends the process.
"""

import json
import math
import os
import queue
import sys
import threading

import bpy
import numpy as np

IDLE_SECONDS = 600.0


def prepare():
    """An empty scene with a panoramic camera that looks along +y."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    scene = bpy.context.scene
    data = bpy.data.cameras.new('Camera')
    camera = bpy.data.objects.new('Camera', data)
    scene.collection.objects.link(camera)
    camera.rotation_euler = (math.pi / 2, 0.0, 0.0)
    data.type = 'PANO'
    lens = data if hasattr(data, 'panorama_type') else data.cycles  # as version.panorama_settings
    lens.panorama_type = 'EQUIRECTANGULAR'
    scene.camera = camera
    render, settings = scene.render, scene.cycles
    render.engine = 'CYCLES'
    render.resolution_percentage, render.use_compositing, render.use_sequencer = 100, False, False
    render.image_settings.file_format, render.image_settings.color_depth = 'OPEN_EXR', '32'
    render.image_settings.exr_codec = 'NONE'
    settings.use_adaptive_sampling = settings.use_denoising = False
    settings.device = 'CPU'
    return scene


def take_world(scene, request):
    """The world of a file in place of the one before, with what hangs on that one."""
    with bpy.data.libraries.load(request['file'], link=False) as (there, wanted):
        wanted.worlds = [name for name in there.worlds if name == request['world']]
    scene.world = wanted.worlds[0] if wanted.worlds else None
    bpy.data.orphans_purge(do_recursive=True)
    if scene.world is not None:
        scene.world.cycles.sampling_method = 'NONE'  # its light falls on nothing
    whole = math.floor(request['frame'])
    scene.frame_set(whole, subframe=request['frame'] - whole)


def paint(scene, width, samples, path):
    """[width / 2, width, 3] float32, row 0 straight up, into a .npy file that is whole when it is there."""
    scene.render.resolution_x, scene.render.resolution_y = width, width // 2
    scene.cycles.samples = samples
    picture = path + '.exr'
    scene.render.filepath = picture
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(picture)
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    os.remove(picture)
    with open(path + '.part', 'wb') as file:
        np.save(file, np.ascontiguousarray(pixels.reshape(width // 2, width, -1)[::-1, :, :3]))
    os.replace(path + '.part', path)


class Requests:
    """Lines of the input, of which the last one counts."""

    def __init__(self):
        self._lines = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def next(self):
        """Waits. None at the end."""
        try:
            return self.newer() or self._lines.get(timeout=IDLE_SECONDS)
        except queue.Empty:
            return None

    def newer(self):
        """The last request that has come meanwhile, or None."""
        found = None
        while not self._lines.empty():
            found = self._lines.get()
        return found

    def _read(self):
        for line in sys.stdin:
            self._lines.put(json.loads(line))
        os._exit(0)  # nobody waits for what is being painted


def main():
    if hasattr(os, 'nice'):
        os.nice(5)  # the user's own Blender comes first
    scene, requests = prepare(), Requests()
    request = requests.next()
    while request is not None:
        take_world(scene, request)
        newer = None
        for width, samples, path in request['steps']:
            paint(scene, width, samples, path)
            newer = requests.newer()
            if newer is not None:
                break
        request = requests.next() if newer is None else newer


main()
