# SPDX-License-Identifier: GPL-3.0-or-later
"""How long views take to render, by those that were rendered since Blender was started."""

# Weight of what is known already against a view that was just rendered.
_OLD = 0.8

_seconds = {}  # for each view, by the settings that they were rendered with


def note(settings, seconds):
    """A view was rendered. In: settings, view_capture.CaptureSettings."""
    known = _seconds.get(settings, seconds)
    _seconds[settings] = _OLD * known + (1 - _OLD) * seconds


def expected(settings, count):
    """Seconds that so many views take with these settings, None where none was rendered with this engine. Other sizes
    and samples are taken in proportion of their pixels and samples, which is too much for small ones."""
    if settings in _seconds:
        return _seconds[settings] * count
    for other, seconds in reversed(_seconds.items()):
        if other.engine == settings.engine:
            return seconds * _work(settings) / _work(other) * count
    return None


def _work(settings):
    return settings.size ** 2 * (1 if settings.engine == 'WORKBENCH' else settings.samples)
