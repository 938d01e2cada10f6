"""The helpers of the tool's tests, which make clouds and data sets."""
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / 'tests' / 'cli'))
sys.path.insert(0, str(ROOT / 'tests' / 'addon'))
