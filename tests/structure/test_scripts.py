"""Scripts that no test starts (benchmarks, images of the docs, peers) name modules of the add-on that exist."""
import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
ADDON = ROOT / 'addon' / 'stipple'
FOLDERS = ('binding', 'operators', 'panels', 'scene', 'viewport')
# stipple.scene.view.cameras, '.scene.view.cameras' of a relative import and f'{name}.scene.view.cameras'.
NAMED = re.compile(r'''(?:\bstipple|['"}]\]?)\.((?:%s)(?:\.\w+)+)''' % '|'.join(FOLDERS))
IMPORTED = re.compile(r'from stipple\.?([\w.]*) import (.+)')


def scripts():
    files = [path for folder in ('blend-fixtures', 'tests', 'addon') for path in (ROOT / folder).rglob('*.py')]
    return [path for path in files if ADDON not in path.parents and 'structure' not in path.parts]


def is_there(dotted):
    """Whether the folders of a dotted name lead to a module; what follows a module is its own affair."""
    at = ADDON
    for part in dotted.split('.'):
        if (at / f'{part}.py').exists():
            return True
        package, at = at, at / part
        if not at.is_dir():
            return re.search(rf'^{part} = ', (package / '__init__.py').read_text(), re.M) is not None
    return True


def names_in(text):
    yield from NAMED.findall(text)
    for package, names in IMPORTED.findall(text):
        for name in re.findall(r'\w+', names.split('#')[0].split(' as ')[0]):
            yield f'{package}.{name}'.lstrip('.') if package else name


@pytest.mark.parametrize('path', scripts(), ids=lambda path: str(path.relative_to(ROOT)))
def test_a_script_names_modules_that_exist(path):
    missing = [name for name in names_in(path.read_text()) if not is_there(name)]
    assert not missing, f'{path.relative_to(ROOT)} names {missing}'


def test_what_moved_is_found():
    assert list(names_in("importlib.import_module('.scene.cameras', name)")) == ['scene.cameras']
    assert list(names_in('from stipple.scene import cameras')) == ['scene.cameras']
    assert not is_there('scene.cameras') and is_there('scene.view.cameras.from_parts')
