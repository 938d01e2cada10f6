# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds as 3D views of the engine Stipple show them: a picture of all directions, painted by Cycles.

A view may not render with Cycles, and a render of its own would take the user's window and the result of his last F12.
So another Blender in the background paints the world (paint_worlds.py): at once coarsely, then finely. The native
renderer looks up what each pixel sees, however the view turns. The world as it was before shows until the new picture is
there, and before the first one its single colour.
"""

import atexit
import json
import os
from pathlib import Path

import bpy
import numpy as np
from bpy.app.handlers import persistent

from .. import cycles_functions, late, log
from ..scene.view import facts

shutil, subprocess, tempfile = (late.module(name) for name in ('shutil', 'subprocess', 'tempfile'))

SCRIPT = Path(__file__).with_name('paint_worlds.py')
# Pixels around and samples of each picture that is painted of a world, one after the other. 4096 are as many as a
# common environment image has; they take 101 MB.
STEPS = ((1024, 1), (4096, 4))
POLL_SECONDS = 0.05


class Picture:
    """A world in all directions. pixels [H,W,3], row 0 straight up."""

    def __init__(self, pixels):
        self.pixels = pixels


class _Painter:
    """The other Blender, and the world that it paints."""

    def __init__(self):
        self._folder = tempfile.mkdtemp(prefix='stipple-worlds-', dir=bpy.app.tempdir)
        command = [bpy.app.binary_path, '--background', '--factory-startup', '--python', str(SCRIPT)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
                                         stderr=subprocess.DEVNULL, cwd=self._folder,
                                         creationflags=getattr(subprocess, 'CREATE_NO_WINDOW', 0))
        self._count = 0
        self._paths = []  # of pictures that are still to come

    def ask(self, world, frame):
        """Paints a world. What is still in the making is given up. Errors: OSError."""
        self._count += 1
        for path in Path(self._folder).glob('*.npy'):
            path.unlink()
        name = f'world{self._count}'
        if world.library is not None:
            file = bpy.path.abspath(world.library.filepath)
        else:
            file = os.path.join(self._folder, 'world.blend')
            bpy.data.libraries.write(file, {world}, path_remap='ABSOLUTE', fake_user=True)
        self._paths = [os.path.join(self._folder, f'{name}_{width}.npy') for width, _ in STEPS]
        steps = [[*step, path] for step, path in zip(STEPS, self._paths)]
        request = {'file': file, 'world': world.name, 'frame': frame, 'steps': steps}
        self._process.stdin.write((json.dumps(request) + '\n').encode())
        self._process.stdin.flush()

    def take(self):
        """The next Picture, if it is there."""
        if not self._paths or not os.path.exists(self._paths[0]):
            return None
        path = self._paths.pop(0)
        pixels = np.load(path, allow_pickle=False)
        os.remove(path)
        return Picture(pixels)

    def is_busy(self):
        return bool(self._paths) and self._process.poll() is None

    def is_beginning(self):
        """Whether the coarse picture is still to come: a slider that is dragged shows one after the other."""
        return len(self._paths) == len(STEPS) and self.is_busy()

    def is_alive(self):
        return self._process.poll() is None

    def close(self):
        self._process.kill()
        self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)


class _State:
    """The worlds of this file, of which one is painted at a time: that which a view has asked for last."""

    def __init__(self):
        self.painter = None
        self.versions = {}   # {name of a world: how often it has changed}
        self.wanted = None   # (name, version, frame) that a view shows
        self.asked = None    # (name, version) that is painted, or was
        self.shown = None    # (name, Picture)
        self.is_off = False  # after a failure nothing more is tried with this file


_state = _State()


@persistent
def _note_changes(_scene, depsgraph):
    """Worlds that have changed are painted anew."""
    for update in depsgraph.updates:
        changed = update.id.original
        if isinstance(changed, bpy.types.World):
            _touch(changed)
        elif isinstance(changed, bpy.types.Image):
            for world in bpy.data.worlds:
                if world.node_tree is not None and changed in _images_of(world.node_tree):
                    _touch(world)


def picture(depsgraph):
    """The Picture of the world of a view's scene, or None where a single colour tells all, or until there is one."""
    scene = depsgraph.scene
    world = scene.world
    if (world is None or scene.render.film_transparent or facts.plain_world_colour(world) is not None
            or cycles_functions.CyclesRender is None or not bpy.app.binary_path or _state.is_off):
        return None
    name = world.name_full
    _state.wanted = (name, _state.versions.get(name, 0), scene.frame_current_final)
    if _is_behind() and not bpy.app.timers.is_registered(_tend):
        bpy.app.timers.register(_tend, first_interval=0.0)  # nothing is written while a view draws
    return _state.shown[1] if _state.shown is not None and _state.shown[0] == name else None


def is_waiting():
    """Whether a picture is still to come."""
    return _state.painter is not None and _state.painter.is_busy()


def _touch(world):
    _state.versions[world.name_full] = _state.versions.get(world.name_full, 0) + 1


def _images_of(tree, seen=None):
    seen = set() if seen is None else seen
    if tree in seen:
        return set()
    seen.add(tree)
    found = {node.image for node in tree.nodes if getattr(node, 'image', None) is not None}
    for node in tree.nodes:
        if node.type == 'GROUP' and node.node_tree is not None:
            found |= _images_of(node.node_tree, seen)
    return found


def _tend():
    """Asks for what views want, and takes what is painted. A timer's function."""
    try:
        if _is_behind() and not (_state.painter is not None and _state.painter.is_beginning()):
            _ask()
        made = _state.painter.take() if _state.painter is not None else None
        if made is not None:
            _state.shown = (_state.asked[0], made)
            _redraw()
    except (OSError, ValueError, RuntimeError) as error:  # a full disk, a Blender that does not start
        log.error('The world cannot be painted for the 3D view: %s', error)
        _state.is_off = True
        return None
    return POLL_SECONDS if is_waiting() or _is_behind() else None


def _is_behind():
    return _state.wanted is not None and _state.asked != _state.wanted[:2]


def _ask():
    name, version, frame = _state.wanted
    world = next((world for world in bpy.data.worlds if world.name_full == name), None)
    if world is None:  # deleted meanwhile
        _state.wanted = None
        return
    if _state.painter is not None and not _state.painter.is_alive():
        _state.painter.close()
        _state.painter = None
    if _state.painter is None:
        _state.painter = _Painter()
    _state.painter.ask(world, frame)
    _state.asked = (name, version)


def _redraw():
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == 'VIEW_3D' and area.spaces.active.shading.type == 'RENDERED':
                area.tag_redraw()


@persistent
def _forget(*_):
    """Another file has other worlds."""
    global _state
    painter = _state.painter
    if bpy.app.timers.is_registered(_tend):
        bpy.app.timers.unregister(_tend)
    if painter is not None:
        painter.close()
    _state = _State()


def register():
    bpy.app.handlers.load_pre.append(_forget)
    bpy.app.handlers.depsgraph_update_post.append(_note_changes)
    bpy.app.handlers.frame_change_post.append(_note_changes)
    atexit.register(_forget)


def unregister():
    bpy.app.handlers.frame_change_post.remove(_note_changes)
    bpy.app.handlers.depsgraph_update_post.remove(_note_changes)
    bpy.app.handlers.load_pre.remove(_forget)
    atexit.unregister(_forget)
    _forget()
