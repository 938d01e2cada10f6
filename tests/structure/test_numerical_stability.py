"""The tables of hard cases are made by a test (the page's first lines say how); here that nobody forgot to."""
import os
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get('STIPPLE_BUILD_DIR', ROOT / 'build' / 'release'))


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


def numbers(page):
    """(row, column, value) of every figure like 8.0e-07 in the tables of the page."""
    rows = [line.split('|')[1:-1] for line in page.splitlines() if line.startswith('| ')]
    return [(row[0].strip() + ', ' + row[1].strip(), column, float(cell)) for row in rows for column,
            cell in enumerate(row)
            if re.fullmatch(r'\s*(0|\d\.\de[+-]\d+)\s*', cell)]


def test_the_figures_are_those_of_this_build(tmp_path):
    made = tmp_path / 'page.md'
    run = subprocess.run([BUILD / 'tests' / 'test_stability', '--gtest_filter=*Stability.EveryHardCase*'],
                         env=dict(os.environ, STIPPLE_STABILITY_TABLE=str(made)), capture_output=True, text=True)
    assert run.returncode == 0, run.stdout
    committed, today = numbers((ROOT / 'docs/numerical_stability.md').read_text()), numbers(made.read_text())
    assert len(committed) >= 80 and [row[:2] for row in committed] == [row[:2] for row in today]
    for (row, column, before), (_, _, now) in zip(committed, today):
        # Other instruction sets add in another order: the worst of many roundings differs by a few of them.
        assert max(before, now) <= 4 * min(before, now) + 1e-6, (row, column, before, now)
