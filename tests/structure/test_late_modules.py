"""Modules of the add-on are imported late (addon/stipple/late.py): what is taken out of them is there.

Python finds a misspelt name of `from module import name` when it imports, and `module.name` not before it is used.
"""
import ast
import functools
import pathlib

ADDON = pathlib.Path(__file__).parents[2] / 'addon' / 'stipple'
ROOM = '__getattr__ = late.room(__name__)'


@functools.lru_cache(maxsize=None)
def path_of(parts):
    """The file of a module or package, None where there is none."""
    at = ADDON.joinpath(*parts)
    return at / '__init__.py' if at.is_dir() else at.with_suffix('.py') if at.with_suffix('.py').is_file() else None


@functools.lru_cache(maxsize=None)
def names_of(path):
    """What a module has once it is imported."""
    names = {'__name__', '__file__', '__doc__'}
    for node in ast.parse(path.read_text(encoding='utf-8')).body:
        for inner in ast.walk(node) if not isinstance(node, (ast.FunctionDef, ast.ClassDef)) else [node]:
            if isinstance(inner, (ast.FunctionDef, ast.ClassDef)):
                names.add(inner.name)
            elif isinstance(inner, ast.Name) and isinstance(inner.ctx, ast.Store):
                names.add(inner.id)
            elif isinstance(inner, (ast.Import, ast.ImportFrom)):
                names.update((alias.asname or alias.name).partition('.')[0] for alias in inner.names)
    return names


def modules_of(tree, package):
    """{name: parts} of this add-on's modules that a module has by `from ... import module`, at its top or in a
    function."""
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = package[:len(package) - node.level + 1] + tuple(node.module.split('.') if node.module else ())
            found.update({alias.asname or alias.name: (*base, alias.name) for alias in node.names
                          if path_of((*base, alias.name)) is not None})
    return found


def missing_names(tree, package):
    """[(line, what)] that is taken out of modules which do not have it."""
    modules = modules_of(tree, package)
    bound = {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    bound |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    missing = []
    for node in ast.walk(tree):
        parts = parts_of(node, modules, bound)
        if parts is None or path_of(parts) is not None:
            continue
        owner = path_of(parts[:-1])
        if owner is not None and parts[-1] not in names_of(owner):
            missing.append((node.lineno, '.'.join(parts)))
    return missing


def parts_of(node, modules, bound):
    """The dotted name that an attribute of a module stands for, from the add-on's folder on; None for anything else."""
    if isinstance(node, ast.Name):
        return modules.get(node.id) if node.id not in bound else None
    if not isinstance(node, ast.Attribute):
        return None
    owner = parts_of(node.value, modules, bound)
    return None if owner is None or path_of(owner) is None else (*owner, node.attr)


def test_a_name_that_is_not_there_is_found():
    tree = ast.parse('from . import binding\nfrom .binding import structs\n'
                     'binding.cloud.Cloud, structs.Status.OK, binding.cloud.Clod, structs.Statos, binding.nothing')
    assert sorted(what for _, what in missing_names(tree, ())) == [
        'binding.cloud.Clod', 'binding.nothing', 'binding.structs.Statos']


def test_what_is_taken_out_of_late_modules_is_there():
    missing, looked_at = [], 0
    for path in sorted(ADDON.rglob('*.py')):
        package = path.relative_to(ADDON).parent.parts
        tree = ast.parse(path.read_text(encoding='utf-8'))
        looked_at += len(modules_of(tree, package))
        missing += [f'{path.relative_to(ADDON)}:{line}: {what}' for line, what in missing_names(tree, package)]
    assert missing == []
    assert looked_at > 500  # or imports are written in another way, and this sees none


def test_every_room_hands_its_modules_out_late():
    rooms = {path.parent.relative_to(ADDON) for path in ADDON.rglob('__init__.py')
             if ROOM in path.read_text(encoding='utf-8')}
    assert {pathlib.Path(name) for name in ('.', 'binding', 'scene', 'viewport')} <= rooms
    assert {path.parent.relative_to(ADDON) for path in ADDON.glob('scene/*/__init__.py')} <= rooms
