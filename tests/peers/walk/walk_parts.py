# SPDX-License-Identifier: GPL-3.0-or-later
"""What the three Blenders of walk.py share."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'blender'))

ENGINES = ('STIPPLE', 'STIPPLE_CYCLES')
WIDTH, HEIGHT = 480, 320
arguments = sys.argv[sys.argv.index('--') + 1:]
OUT, WAY, ASSETS = Path(arguments[1]), Path(arguments[3]), Path(arguments[4])
facts = {}


def note(**values):
    facts.update(values)


def splats():
    return [obj for obj in bpy.data.objects if obj.type in ('MESH', 'POINTCLOUD') and obj.data.get('stipple_layout')]


def count(obj):
    data = obj.data
    return len(data.points) if obj.type == 'POINTCLOUD' else len(data.vertices)


def states():
    """What each splat object's source says of itself."""
    sources = sys.modules['stipple'].scene.source.sources
    return {obj.name: sources.state(obj.data) for obj in splats()}


def render(engine):
    """F12 into OUT/ENGINE.png."""
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    scene.render.image_settings.file_format = 'PNG'
    scene.render.filepath = str(OUT / f'{engine}.png')
    scene.view_settings.view_transform = 'Standard'
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.seed = 16, False, 0
    bpy.ops.render.render(write_still=True)


def render_all(_window):
    for engine in ENGINES:
        render(engine)
