# SPDX-License-Identifier: GPL-3.0-or-later
"""Every option that a user can see says what it does."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

_HAVE_NONE = {'PointerProperty', 'CollectionProperty'}


def options():
    """(place, name, keywords) of each property that the add-on declares."""
    for path in sorted((ROOT / 'addon').rglob('*.py')):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.AnnAssign) and isinstance(node.annotation, ast.Call):
                function = node.annotation.func
                kind = getattr(function, 'attr', getattr(function, 'id', ''))
                if kind.endswith('Property') and kind not in _HAVE_NONE:
                    keywords = {word.arg: ast.unparse(word.value) for word in node.annotation.keywords}
                    yield f'{path.relative_to(ROOT)}:{node.lineno}', node.target.id, keywords


def test_every_option_has_a_tooltip():
    found = list(options())
    assert len(found) > 100
    # A file browser fills in `directory`, and shows it nowhere.
    missing = [f'{place} {name}' for place, name, words in found if 'description' not in words
               and 'HIDDEN' not in words.get('options', '') and name != 'directory']
    assert not missing, missing
