"""The tables of hard cases are made by a test (the page's first lines say how); here that nobody forgot to."""
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def section(title):
    page = (ROOT / 'docs/numerical_stability.md').read_text()
    return page.split(f'\n## {title}\n')[1].split('\n## ')[0]


def test_the_table_of_levels_has_every_case():
    cases = re.findall(r'\badd\(\s*"([^"]+)"', (ROOT / 'tests/stability/level_cases.h').read_text())
    assert len(cases) >= 12
    rows = re.findall(r'^\| ([^|]+) \|', section('Levels'), flags=re.M)
    assert rows[0] == 'case' and rows[1:] == cases


def test_the_table_of_levels_has_every_level():
    kinds = re.findall(r'push_back\(\{"([^"]+)"', (ROOT / 'tests/stability/levels_test.cpp').read_text())
    columns = section('Levels').split('\n| case |')[1].split('\n')[0].split('|')
    assert [column.strip() for column in columns[2:-1]] == kinds and len(kinds) >= 6


def test_the_table_of_effects_has_every_case():
    source = (ROOT / 'tests/stability/effect_table.cpp').read_text()
    cases = re.findall(r'\badd\(\s*"([^"]+)",\s*"([^"]+)"', source)
    assert len(cases) >= 17
    rows = re.findall(r'^\| ([^|]+) \| ([^|]+) \|', section('Effects'), flags=re.M)
    assert rows[0] == ('effect', 'case') and rows[1:] == [(effect, case) for case, effect in cases]
