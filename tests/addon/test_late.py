# SPDX-License-Identifier: GPL-3.0-or-later
"""Modules that are imported when something is first taken out of them."""

import importlib
import sys
import threading

import pytest

from stipple import late


@pytest.fixture
def room(tmp_path, monkeypatch):
    """A package `house` with a room `house.cellar`, whose module `wine` is slow to import."""
    cellar = tmp_path / 'house' / 'cellar'
    cellar.mkdir(parents=True)
    (tmp_path / 'house' / '__init__.py').write_text('')
    (cellar / '__init__.py').write_text('import stipple.late\n__getattr__ = stipple.late.room(__name__)\n')
    (cellar / 'wine.py').write_text('import time\ntime.sleep(0.05)\nbottles = 3\ndef drink():\n    global bottles\n'
                                    '    bottles -= 1\n')
    (cellar / 'cask.py').write_text('from . import wine\n')
    monkeypatch.syspath_prepend(str(tmp_path))
    yield importlib.import_module('house.cellar')
    for name in [name for name in sys.modules if name.partition('.')[0] == 'house']:
        del sys.modules[name]


def test_a_module_is_imported_when_something_is_taken_out_of_it(room):
    from house.cellar import wine
    assert 'house.cellar.wine' not in sys.modules and not late.is_loaded(wine)
    assert wine.bottles == 3
    assert 'house.cellar.wine' in sys.modules and late.is_loaded(wine)
    assert room.wine is sys.modules['house.cellar.wine']


def test_it_has_the_module_s_own_names(room):
    from house.cellar import wine
    wine.drink()
    assert wine.bottles == 2
    wine.bottles = 7
    assert sys.modules['house.cellar.wine'].bottles == 7
    sys.modules['house.cellar.wine'].bottles = 8
    assert wine.bottles == 8
    del wine.bottles
    assert not hasattr(sys.modules['house.cellar.wine'], 'bottles')


def test_what_is_set_first_imports(room):
    from house.cellar import wine
    wine.bottles = 5
    assert sys.modules['house.cellar.wine'].bottles == 5 == wine.bottles


def test_a_module_that_is_not_there_is_an_error_at_once(room):
    with pytest.raises(ImportError, match='beer'):
        from house.cellar import beer  # noqa: F401
    with pytest.raises(AttributeError, match='house.cellar'):
        room.beer
    with pytest.raises(AttributeError, match='glasses'):
        room.wine.glasses


def test_modules_of_rooms_see_each_other_late(room):
    from house.cellar import cask
    assert cask.wine is not None and 'house.cellar.wine' not in sys.modules
    assert cask.wine.bottles == 3


def test_threads_wait_for_the_import_of_the_first(room):
    from house.cellar import wine
    found = []
    threads = [threading.Thread(target=lambda: found.append(wine.bottles)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [3] * 4
