"""Turns mesh files into data sets that networks learn from: images from all around, and coloured points.

    blender -b --factory-startup -P addon/collect_for_training.py -- ASSETS OUT [--views 24] [--size 128]
        [--points 16384] [--samples 16] [--seed 0] [--index I --of N]

ASSETS is a folder of .blend, .glb, .gltf, .obj, .ply and .stl files. Each becomes the folder OUT/NAME; those that are
there already are passed over. With --index I --of N only every N-th file is taken, from I on, which counts from 0.
The library is the one of the environment variable STIPPLE_LIBRARY, else the add-on's own, else build/release/lib. Ends
with 0, with 1 where nothing could be collected, and with 2 where its arguments are not understood.
"""
import argparse
import os
import pathlib
import sys
import traceback

HERE = pathlib.Path(__file__).resolve().parent
BUILT = HERE.parent / 'build' / 'release' / 'lib' / 'libstipple.so'
if str(HERE) not in sys.path:
    sys.path.insert(0, str(HERE))
if BUILT.is_file() and not (HERE / 'stipple' / 'lib' / BUILT.name).is_file():
    os.environ.setdefault('STIPPLE_LIBRARY', str(BUILT))

from stipple.binding.errors import StippleError  # noqa: E402 (lies beside this file)
from stipple.scene.training import assets, collecting  # noqa: E402


def quiet_terminal():
    """A function that prints a line, while all that Blender says from now on, of samples and files, goes nowhere."""
    sys.stdout.flush()
    kept, silence = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.close(silence)
    return lambda line: os.write(kept, f'{line}\n'.encode())


def read_arguments():
    parser = argparse.ArgumentParser(prog='collect_for_training.py', description=__doc__.splitlines()[0])
    parser.add_argument('assets', help='folder of mesh files')
    parser.add_argument('out', help='folder that gets a folder for each of them')
    parser.add_argument('--views', type=positive, default=24, help='images of each')
    parser.add_argument('--size', type=positive, default=128, help='pixels along the sides of an image')
    parser.add_argument('--points', type=positive, default=16384, help='points on the surface of each')
    parser.add_argument('--samples', type=positive, default=16, help='samples of a pixel')
    parser.add_argument('--seed', type=int, default=0, help='another one puts cameras and points elsewhere')
    parser.add_argument('--index', type=int, default=0, help='which part of the files is taken, from 0 on')
    parser.add_argument('--of', type=positive, default=1, help='how many parts there are')
    given = sys.argv[sys.argv.index('--') + 1:] if '--' in sys.argv else []
    arguments = parser.parse_args(given)
    if not 0 <= arguments.index < arguments.of:
        parser.error(f'--index is {arguments.index}; allowed is 0 to {arguments.of - 1}')
    return arguments


def positive(text):
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f'{value} is below 1')
    return value


def main():
    arguments = read_arguments()
    folder = os.path.abspath(arguments.out)
    settings = collecting.CollectSettings(arguments.views, arguments.size, arguments.samples, arguments.points,
                                          arguments.seed)
    try:
        found = assets.of_folder(os.path.abspath(arguments.assets), left_out=folder)
        mine = collecting.chosen(found, arguments.index, arguments.of)
        say = quiet_terminal()
        task = collecting.CollectTask(mine, folder, settings, say)
        task.wait()
    except StippleError as error:
        print(error, file=sys.stderr)
        return 1
    collected = task.result
    say(f'{len(mine)} of {len(found)} assets: {collected.summary()}, in {folder}')
    return 1 if mine and not collected.done and not collected.kept else 0


try:
    CODE = main()
except Exception:  # after which Blender itself would end with 0
    traceback.print_exc()
    CODE = 1
sys.exit(CODE)
