"""The table of hard cases is made by a test (its first lines say how); here that nobody forgot to."""
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_table_has_every_case():
    cases = re.findall(r'\badd\(\s*"([^"]+)"', (ROOT / 'tests/stability/level_cases.h').read_text())
    assert len(cases) >= 12
    rows = re.findall(r'^\| ([^|]+) \|', (ROOT / 'docs/numerical_stability.md').read_text(), flags=re.M)
    assert rows[0] == 'case' and rows[1:] == cases
