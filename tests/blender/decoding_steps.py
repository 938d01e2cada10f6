# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_decoding_window.py inside the Blender with a window; window.py runs them."""

import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from window_steps import addon  # noqa: E402

folder, weights, asset = (Path(sys.argv[sys.argv.index('--') + i]) for i in (2, 4, 5))
EACH = 32
FEW, MANY = 64, 31250  # anchors: MANY take a long time, even with this small network
facts = {'counts': [], 'decoded': [], 'said': []}


def package(name):
    return sys.modules[f'{addon().__name__}.{name}']


def splats():
    return bpy.data.objects['thing']


def count():
    data = splats().data
    return len(data.vertices) if hasattr(data, 'vertices') else len(data.points)


def decoded():
    return package('scene.source.decoded')


def build(window):
    """The splats, seen from the front, and the budget in the Properties editor."""
    chosen = package('preferences').get()
    chosen.weights_folder, chosen.threads = str(weights), 1
    sources = package('scene.source.sources')
    first = sources.first_settings
    sources.first_settings = lambda settings: package('binding.model').DecodeSettings(FEW, EACH)
    bpy.data.objects.remove(bpy.data.objects['Cube'])
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / 'a.blend'))
    with window.context():
        bpy.ops.stipple.splats_import(filepath=str(asset))
        bpy.ops.view3d.view_all()
    sources.first_settings = first
    editor = next(area for area in window.window.screen.areas if area.type == 'PROPERTIES')
    editor.spaces.active.context = 'DATA'
    facts['editor'] = editor.x, editor.y, editor.width, editor.height
    bpy.context.preferences.view.render_display_type = 'NONE'  # redraws of the 3D view are what steps wait for
    operator = package('jobs').JobOperator
    failed = operator._failed
    operator._failed = lambda self, error: facts['said'].append(str(error)) or failed(self, error)
    write = package('scene.source.splat_data').write
    package('scene.source.splat_data').write = lambda data, arrays, *more, **named: (
        facts['counts'].append(arrays.count) or write(data, arrays, *more, **named))
    model = package('binding.model').Model
    for name in ('decode', 'decode_start'):
        setattr(model, name, lambda self, settings, original=getattr(model, name):
                facts['decoded'].append(settings.anchors) or original(self, settings))


def shown(_window):
    return 'few'


def move(_window):
    begin = time.perf_counter()
    splats().data.stipple.anchors = MANY
    facts['move_seconds'] = time.perf_counter() - begin
    facts['count_after_move'] = count()


def busy(_window):
    """Until the panel has something to say."""
    share = decoded().decoding_share(splats().data)
    is_watched = bool(package('scene.source.decode_progress')._state['watched'])
    return None if share is not None and share > 0 and is_watched else False


def decoding(_window):
    facts['count_while_decoding'] = count()
    return 'decoding'


def escape(window):
    window.window.event_simulate(type='ESC', value='PRESS', x=10, y=10)
    window.window.event_simulate(type='ESC', value='RELEASE', x=10, y=10)


def stopped(_window):
    return False if decoded().names() or bpy.app.timers.is_registered(package('scene.source.sync').complete) else None


def cancelled(_window):
    facts['declined'] = decoded().is_declined(splats().data)
    facts['count_after_esc'] = count()
    facts['counts'].clear()
    return 'cancelled'


def several_moves(_window):
    for anchors in (MANY, 20000, 25000, 500):
        splats().data.stipple.anchors = anchors


def followed(_window):
    return False if count() != 500 * EACH or decoded().is_decoding() else None


def animate(window):
    facts['counts_of_moves'] = list(facts['counts'])
    settings = splats().data.stipple
    for frame, anchors in ((1, 100), (3, 300)):
        settings.anchors = anchors
        settings.keyframe_insert('anchors', frame=frame)
    settings.anchors_render = MANY
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 3
    scene.frame_set(1)
    decoded().forget()
    facts['decoded'].clear()
    with window.context():
        bpy.ops.stipple.decode_budgets('INVOKE_DEFAULT')


def preparing_begins(_window):
    """Until the large budget is the one that is decoded."""
    return None if MANY in facts['decoded'] else False


def preparing(_window):
    return 'preparing'


def preparing_cancelled(window):
    """Until the operator has ended: one budget is kept."""
    if not facts['said']:
        return False
    facts['kept_after_esc'] = decoded().cached()[0]
    settings = splats().data.stipple
    settings.anchors_render = 250
    facts['decoded'].clear()
    with window.context():
        bpy.ops.stipple.decode_budgets('INVOKE_DEFAULT')
    return None


def prepared(_window):
    return None if decoded().cached()[0] == 4 else False


def play(_window):
    facts['prepared'] = sorted(facts['decoded'])
    facts['decoded'].clear()
    facts['played'] = []
    for frame in (1, 2, 3, 1):
        bpy.context.scene.frame_set(frame)
        facts['played'].append(count())


def played(_window):
    facts['decoded_while_playing'] = list(facts['decoded'])
    return 'prepared'


def end(_window):
    return 'end'


def wait(_window):
    return None


def patient(step):
    """A step that waits for something, for so long at most."""
    begun = []

    def waited(window):
        begun.append(time.monotonic())
        assert begun[-1] - begun[0] < 120, f'{step.__name__} waits in vain: {facts}'
        return step(window)
    return waited


steps = [build, wait, shown, move, busy, decoding, escape, stopped, wait, cancelled, several_moves, followed, animate,
         preparing_begins, wait, preparing, escape, wait, stopped, preparing_cancelled, prepared, wait, play, played, end]
steps = [patient(step) for step in steps]
