"""Who fits, judges or draws splats does it through the interfaces that a context's backend factory makes."""
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Functions of one kind of processor, and what makes its implementations.
OF_A_PROCESSOR = re.compile(r'\b(renderTiled\w*|renderBackward\w*|renderAccurate|orderForDrawing|makeCpu\w+|'
                            r'CpuViewPass)\b')
#: Files that are that kind of processor, or say that there is one.
MAY = re.compile(r'train/loop/(cpu_\w+|backend_factory|view_pass|render_backend)\.(cpp|h)$')


def names_in(path):
    code = '\n'.join(line.split('//')[0] for line in path.read_text().splitlines())
    return sorted(set(OF_A_PROCESSOR.findall(code)))


def test_training_draws_through_the_factory_alone():
    seen = {}
    for path in sorted((ROOT / 'native' / 'train').rglob('*')):
        if path.suffix not in ('.cpp', '.h') or MAY.search(path.as_posix()):
            continue
        if found := names_in(path):
            seen[path.relative_to(ROOT).as_posix()] = found
    assert not seen


def test_images_are_drawn_through_the_factory():
    """F12, the viewport and their orders; `measure` times the processor's own renderers, and says so by their names."""
    for name in ('renderer.cpp', 'draw_order.cpp'):
        assert not names_in(ROOT / 'native' / 'api' / name), name
