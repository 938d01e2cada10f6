"""Who fits, judges, measures or draws splats does it through the interfaces that a context's backend factory makes."""
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Functions of one kind of processor, and what makes its implementations.
OF_A_PROCESSOR = re.compile(
    r'\b(render(?:Tiled|Backward|Rays|Reference|Accurate|RayTiles)|orderForDrawing|CpuViewPass'
    r'|makeCpu\w+|cpuBackends|(?:render|accurate|backward|ray|rayTile)Memory(?:Bound)?|drawOrderMemoryBound)\s*\(')
#: The processor's own renderers, the backends, and what times both.
THE_PROCESSOR = ('splat/', 'train/backend/', 'bench/')
#: All who go past the factory; docs/architecture.md says of each why.
EXCEPTIONS = {
    'api/backward.cpp': {'backwardMemoryBound', 'renderMemory'},
    'measure/picture_accuracy.cpp': {'rayMemory', 'renderRays'},
    'shot/renderer.cpp': {'rayMemory', 'renderBackward', 'renderRays', 'renderReference'},
    'shot/sampled_render.cpp': {'renderMemory'},
}


def calls_in(path):
    code = '\n'.join(line.split('//')[0] for line in path.read_text().splitlines())
    return set(OF_A_PROCESSOR.findall(code))


def seen_past_the_factory():
    seen = {}
    for path in sorted((ROOT / 'native').rglob('*')):
        name = path.relative_to(ROOT / 'native').as_posix()
        if path.suffix not in ('.cpp', '.h') or name.startswith(THE_PROCESSOR):
            continue
        if found := calls_in(path):
            seen[name] = found
    return seen


def test_nobody_but_the_exceptions_goes_past_the_factory():
    assert seen_past_the_factory() == EXCEPTIONS


def test_the_page_says_why_each_exception_is_one():
    text = (ROOT / 'docs' / 'architecture.md').read_text()
    section = text.split('## A step of a fit', 1)[1].split('\n## ', 1)[0]
    assert sorted(re.findall(r'^\| `([a-z_/]+\.cpp)` \|', section, flags=re.M)) == sorted(EXCEPTIONS)
