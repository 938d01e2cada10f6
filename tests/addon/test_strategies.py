# SPDX-License-Identifier: GPL-3.0-or-later
"""Strategies and parts through the binding, against the page that says what goes together."""

import re

from stipple.binding.errors import StippleError
from stipple.binding.strategies import check_strategy, strategies, strategy_parts
from stipple.binding.structs import FitModel


def goes(library, text):
    try:
        check_strategy(library, text)
    except StippleError as error:
        assert 'does not go with' in str(error)
        return False
    return True


def test_what_goes_with_the_parts_of_temporal_is_what_its_page_says(root, library):
    page = (root / 'docs' / 'methods' / 'temporal.md').read_text()
    rows = re.findall(r'^\| `(\w+)` \| (.*) \|$', page, re.MULTILINE)
    parts = re.findall(r'`(\w+)`', re.search(r'^\| \| (.*) \|$', page, re.MULTILINE).group(1))
    assert parts == ['visibility_weighted_score', 'lifespan_threshold', 'offset_warp']
    said = {name: [cell.split(':')[0] == 'yes' for cell in cells.split(' | ')] for name, cells in rows}
    found = {entry.name: [goes(library, f'{entry.name}+{part}') for part in parts] for entry in strategies(library)
             if entry.model == FitModel.EXPLICIT}
    assert found == said


def test_every_part_goes_with_temporal(library):
    assert all(goes(library, f'temporal+{part.name}') for part in strategy_parts(library))
