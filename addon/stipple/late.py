# SPDX-License-Identifier: GPL-3.0-or-later
"""Modules that are imported when something is first taken out of them.

A room, which is a package whose `__init__` says `__getattr__ = late.room(__name__)`, hands its modules out so:
`from ..scene.source import sources` costs nothing, and `sources.context()` imports it. `from ..scene.source.sources
import context` imports at once, as ever, and so does `import_module`. Registering needs few of the modules, and Blender
waits for it whenever it starts.
"""

import importlib
import os
import sys


class LateModule:
    """Stands for a module. From its import on it has the module's own names, so that it costs what a module does."""

    def __init__(self, name):
        object.__setattr__(self, '__name__', name)

    def __getattr__(self, name):
        """A name that is not here: the module is not imported yet, or makes it (a room), or has no such name.

        Threads: import_module holds a second thread back until the first has imported the module.
        """
        module = importlib.import_module(self.__name__)
        object.__setattr__(self, '__dict__', vars(module))
        return getattr(module, name)

    def __setattr__(self, name, value):
        setattr(importlib.import_module(self.__name__), name, value)

    def __delattr__(self, name):
        delattr(importlib.import_module(self.__name__), name)

    def __repr__(self):
        return f"<late module '{self.__name__}'>"


def is_loaded(module):
    """Whether a module is imported: what is not has nothing to forget."""
    return module.__name__ in sys.modules


def module(name):
    """A module of Python's own, for who seldom needs it."""
    return LateModule(name)


def room(package):
    """The `__getattr__` of a package that hands out its modules late."""
    names = vars(sys.modules[package])

    def hand_out(name):
        if not any(os.path.exists(os.path.join(folder, name + end)) for folder in names['__path__']
                   for end in ('.py', '/__init__.py')):
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        return names.setdefault(name, LateModule(f'{package}.{name}'))
    return hand_out
